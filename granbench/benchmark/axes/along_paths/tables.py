"""Tables and charts of the errors along recorded paths."""

import math
from collections.abc import Iterator
from dataclasses import replace

from markupsafe import Markup

from granbench.benchmark.axes.along_paths.metrics import AGAINST_NOISED_TRUTH, HEADLINE
from granbench.benchmark.axes.along_paths.protocols import PROTOCOLS, ROLLOUT, ProtocolSpec
from granbench.benchmark.axis import Axis
from granbench.benchmark.metric import Metric
from granbench.benchmark.presentation import (
    Block,
    BoardView,
    Cell,
    Chart,
    Column,
    Found,
    ModelTable,
    ModelView,
    Section,
    TextTable,
    found_scores,
)
from granbench.benchmark.score_text import number, of_seeds, rendered, written, written_interval
from granbench.benchmark.scorecard import ALL, Score
from granbench.benchmark.standard_tables import plugged_in_definitions

FAILED = "failed_share"
SMALLEST_EXPONENT = -300
"""Smallest exponent of a power of ten that both ends of an interval are divided by."""


def text_tables(axis: Axis, model: ModelView, split: str) -> Iterator[TextTable]:
    """The errors of a split, one row a protocol."""
    found = found_scores(model, axis.names, split)
    protocols = [name for name in PROTOCOLS if (name, ALL, HEADLINE) in found]
    if not protocols:
        return
    rows: dict[str, dict[str, Score | None]] = {}
    metrics = [m for m in axis.metrics() if "terminal" in m.shown]
    for name in protocols:
        rows[name] = {m.name: found.get((name, ALL, m.name)) for m in metrics}
        recomputed = found.get((name, ALL, AGAINST_NOISED_TRUTH[HEADLINE]))
        if recomputed is not None and recomputed.value is not None:
            rows[f"{name}*"] = {
                m.name: found.get((name, ALL, AGAINST_NOISED_TRUTH.get(m.name, "")))
                for m in metrics
            }
    if not any(row[FAILED] and row[FAILED].value for row in rows.values()):  # type: ignore[union-attr]
        metrics = [metric for metric in metrics if metric.name != FAILED]
    columns = [Column("protocol", left=True)]
    for metric in metrics:
        columns.append(Column(metric.column()))
        if metric.name == HEADLINE:
            columns.append(Column("95 %\ninterval"))
    starred = any(name.endswith("*") for name in rows)
    first = found[protocols[0], ALL, HEADLINE]
    yield TextTable(
        f"{model.name} on {model.task}, split {split}: {first.n} paths, {_seeds(model)}",
        tuple(columns),
        tuple(_text_row(name, row, metrics) for name, row in rows.items()),
        "* against the ground truth, recomputed along the noised strain\n" if starred else "",
    )


def _text_row(name: str, row: dict[str, Score | None], metrics: list[Metric]) -> tuple[str, ...]:
    cells = [name]
    for metric in metrics:
        cells.append(written(row[metric.name], metric.style))
        if metric.name == HEADLINE:
            cells.append(written_interval(row[metric.name]))
    return tuple(cells)


def _seeds(model: ModelView) -> str:
    labels = ", ".join(map(str, model.seeds))
    return f"one model, noise seeds {labels}" if model.deterministic else f"seeds {labels}"


def board_sections(axis: Axis, board: BoardView) -> Iterator[Section]:
    """Scores by protocol, errors against horizon, and scores by loading family."""
    found = {
        split: {
            model.name: found_scores(model, axis.names, split, with_left_out=True)
            for model in board.models
        }
        for split in board.splits
    }
    shown = _metrics_shown(axis, board)
    yield Section(
        "Scores by protocol",
        tuple(
            Block(
                metric.title, split, metric.name, metric.title, full=True,
                table=_main_table(metric, split, found[split], board.floor),
            )
            for split in board.splits
            for metric in shown
        ),
        "Click a heading to sort. Small print: 95 % bootstrap interval over specimens; hover for "
        "the seeds. Bold: the best model. The number before a model is its rank on whole paths; an "
        "equals sign marks models that share it, because the scored paths do not separate them "
        "(the 95 % interval of their difference, path by path, contains zero, or their intervals "
        "overlap). Grey rows are shown for comparison, or have fewer than three seeds, and are not "
        "ranked.",
    )  # fmt: skip
    yield Section(
        "Error against horizon",
        tuple(
            Block(split=split, charts=tuple(_charts(axis, board, split))) for split in board.splits
        ),
        "Mean over paths and seeds, band: 95 % interval."
        + ("" if board.floor is None else " Dashed: scatter between packings made alike "
           f"({board.floor_note}). A model that predicts whole paths cannot score below it "
           "without having seen them."),
    )  # fmt: skip
    families = tuple(_family_blocks(axis, board, found))
    if families:
        yield Section("Whole-path rollout by loading family", families)


def _metrics_shown(axis: Axis, board: BoardView) -> list[Metric]:
    """Metrics that a page offers; those of some protocols only where a model has a value."""
    valued = {
        score.metric
        for model in board.models
        for score in model.scores
        if score.axis in axis.names and score.value is not None
    }
    metrics = [metric for metric in axis.metrics() if "board" in metric.shown]
    return [metric for metric in metrics if not metric.parts or metric.name in valued]


def _main_table(
    metric: Metric, split: str, found: dict[str, Found], floor: float | None
) -> ModelTable:
    """Every protocol's score of one metric, ordered by that of the whole-path rollout."""
    specs = list(PROTOCOLS.values())
    table = ModelTable(
        f"{metric.title}, split {split}",
        tuple(spec.title for spec in specs),
        {
            name: tuple(_cell(scores.get((spec.name, ALL, metric.name)), metric) for spec in specs)
            for name, scores in found.items()
        },
        ordered_by=list(PROTOCOLS).index(ROLLOUT),
        ranked_by={
            name: score
            for name, scores in found.items()
            if (score := scores.get((ROLLOUT, ALL, metric.name))) is not None
        },
        marks_best=True,
        direction=metric.direction,
    )
    if metric.name != HEADLINE or floor is None:
        return table
    scatter = tuple(_scatter(spec, floor) for spec in specs)
    return replace(table, reference={"replicate scatter": scatter})


def _scatter(spec: ProtocolSpec, floor: float) -> Cell:
    if spec.name == ROLLOUT:
        return Cell(number(floor), floor, note="half the mean square between packings made alike")
    return Cell(Markup("–"), note="scatter between packings is a floor of whole paths only")


def _family_blocks(
    axis: Axis, board: BoardView, found: dict[str, dict[str, Found]]
) -> Iterator[Block]:
    """Whole-path scores by loading family, where a split has several."""
    for split in board.splits:
        groups = sorted({key[1] for scores in found[split].values() for key in scores} - {ALL})
        if len(groups) < 2:
            continue
        for metric in axis.metrics():
            if "board by family" not in metric.shown:
                continue
            table = ModelTable(
                f"{metric.title} by loading family, split {split}",
                tuple(groups),
                {
                    name: tuple(
                        _cell(scores.get((ROLLOUT, group, metric.name)), metric) for group in groups
                    )
                    for name, scores in found[split].items()
                },
                marks_best=True,
                direction=metric.direction,
            )
            yield Block(metric.title, split, table=table)


def _charts(axis: Axis, board: BoardView, split: str) -> Iterator[Chart]:
    for spec in PROTOCOLS.values():
        curves = {
            model.name: curve
            for model in board.models
            for curve in model.curves
            if (curve.split, curve.protocol) == (split, spec.name)
        }
        if curves:
            yield Chart(
                spec.title,
                f"{spec.title}, split {split}: stress error against horizon",
                "decades",
                curves,
                # A window starts from this packing's own truth, so scatter between packings is no
                # floor for it.
                reference=board.floor if spec.restart is None else None,
                zero="Off the scale, zero everywhere",
            )


def _cell(score: Score | None, metric: Metric) -> Cell:
    if score is None:
        return Cell(Markup("–"), note="no such score")
    if score.value is None:
        text = "n/a" if score.status == "not_applicable" else "not run"
        return Cell(Markup(text), note=score.reason or "")
    interval: Markup | str = ""
    if score.low is not None and score.high is not None and score.high > score.low:
        interval = _interval(score.low, score.value, score.high, metric)
    note = f"{score.n} paths; {of_seeds(score)}"
    return Cell(rendered(score.value, metric.style), score.value, interval, note)


def _interval(low: float, value: float, high: float, metric: Metric) -> Markup:
    """Both ends in the unit of the value above them: one power of ten, one per cent sign."""
    if metric.style == "percent":
        return Markup("{:.3g} … {:.3g} %").format(100.0 * low, 100.0 * high)
    exponent = math.floor(math.log10(value)) if value > 0.0 else 0
    if not SMALLEST_EXPONENT <= exponent < -2:
        return Markup("{} … {}").format(number(low), number(high))
    scale = 10.0**exponent
    power = str(exponent).replace("-", "−")
    return Markup("{:.3g} … {:.3g} ·10<sup>{}</sup>").format(low / scale, high / scale, power)


def glossary(axis: Axis, board: BoardView) -> Iterator[tuple[str, str]]:
    """What the protocols and the metrics on the page are."""
    yield "Single step", "stress at step n from the state that the true record up to n − 1 implies"
    yield (
        PROTOCOLS["window"].title,
        "the truth is given every 20 steps, the model runs on its own between (thesis Sec 2.2.3)",
    )
    yield "Whole-path rollout", "the truth is given once, at the start"
    yield (
        "Noise",
        "rollout along increments Δε (1 + ξ R), R standard normal, against the clean truth "
        "(Eq 5.13)",
    )
    if any(metric.parts for metric in _metrics_shown(axis, board)):
        yield (
            "Recomputed truth",
            "noise against the ground-truth model along the same noised increments, in place of "
            "the clean truth",
        )
    yield "Error point", "a step whose stress is off by more than half of the true stress (Sec 5.3)"
    yield "Diverged", "from some step on, every step is an error point"
    yield (
        "Broken down",
        "the model returned no number; such steps count as ten standard deviations, and the "
        "path counts in every mean",
    )
    yield from plugged_in_definitions(axis)
