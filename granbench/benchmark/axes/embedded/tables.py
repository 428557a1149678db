"""Tables and charts of the embedded axis: models in place of the ground truth."""

from collections.abc import Iterator, Mapping

from markupsafe import Markup

from granbench.benchmark.axes.embedded.metrics import ERROR_POINTS, NAME, REACHED, REACTION
from granbench.benchmark.axis import Axis, Part
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
from granbench.benchmark.score_text import cell, share, written
from granbench.benchmark.scorecard import ALL, Score


def text_tables(axis: Axis, model: ModelView) -> Iterator[TextTable | str]:
    """A table of analyses for each solver, or why there is none.

    Nothing is shown of a task without analyses.
    """
    run = [score for score in model.scores if score.axis == NAME and score.status != "not_run"]
    for part in axis.parts:
        scores = [score for score in run if score.protocol == part.name]
        if not any(score.value is not None for score in scores):
            reasons = dict.fromkeys(score.reason for score in scores)
            yield from (f"{part.title}: n/a, {reason}." for reason in reasons)
            continue
        yield _text_table(axis, model.name, part, scores)


def _text_table(axis: Axis, name: str, part: Part, scores: list[Score]) -> TextTable:
    groups = list(dict.fromkeys(score.group for score in scores))
    found = {(score.metric, score.group): score for score in scores}
    solver = part.name.removeprefix(f"{NAME}-")
    headings = ("mean" if group == ALL else group.replace("-", "\n") for group in groups)
    return TextTable(
        f"{name} in place of the ground truth, {solver}",
        (Column("", left=True), *(Column(heading) for heading in headings)),
        tuple(
            (metric.title, *(_text_cell(found.get((metric.name, g)), metric) for g in groups))
            for metric in axis.metrics()
            if "terminal" in metric.shown and (metric.name, ALL) in found
        ),
    )


def _text_cell(score: Score | None, metric: Metric) -> str:
    return written(score, "percent" if metric.style == "percent" else "number")


def board_sections(axis: Axis, board: BoardView) -> Iterator[Section]:
    """For each solver the reaction in every analysis, and means of the metrics; error points.

    Nothing where no model was evaluated on the axis, or the task has no analyses.
    """
    found = {model.name: found_scores(model, axis.names, ALL) for model in board.models}
    blocks = [block for part in axis.parts for block in _blocks(axis, part, found)]
    if not blocks:
        return
    yield Section(
        "In place of the ground truth",
        tuple(blocks),
        "The model at the Gauss points of boundary-value problems, against the same analyses with "
        "the ground truth. Small print: whether a run failed, and how far it came; steps that it "
        "did not reach count as ten times the true curve.",
    )
    yield Section(
        "Error points along the analyses",
        (Block(charts=tuple(_charts(axis, board))),),
        "Share of the compared Gauss points whose stress is off by more than half of the true one, "
        "against the output step (thesis Sec 5.3); mean over seeds.",
    )


def _blocks(axis: Axis, part: Part, found: Mapping[str, Found]) -> Iterator[Block]:
    of_part = [key for scores in found.values() for key in scores if key[0] == part.name]
    groups = [group for group in dict.fromkeys(key[1] for key in of_part) if group != ALL]
    if not groups:
        return
    present = {metric for _, _, metric in of_part}
    known = {metric.name: metric for metric in axis.metrics()}
    title = f"{part.title}: error of the reaction"
    cells = {
        name: tuple(_reaction(scores, part, group, known[REACTION]) for group in (ALL, *groups))
        for name, scores in found.items()
    }
    columns = ("mean", *(group.replace("-", " ") for group in groups))
    yield Block(title, table=ModelTable(title, columns, cells))
    shown = [m for m in known.values() if m.name in present and "board" in m.shown]
    title = f"{part.title}: means over the analyses"
    cells = {
        name: tuple(cell(scores.get((part.name, ALL, metric.name)), metric) for metric in shown)
        for name, scores in found.items()
    }
    yield Block(title, table=ModelTable(title, tuple(metric.title for metric in shown), cells))


def _reaction(scores: Found, part: Part, group: str, metric: Metric) -> Cell:
    """The error of the reaction; below it, how far a run came that ended early."""
    found = cell(scores.get((part.name, group, REACTION)), metric)
    reached = scores.get((part.name, group, REACHED))
    if reached is None or reached.value is None or reached.value == 1.0:
        return found
    note = Markup("fails after {}").format(share(reached.value))
    return Cell(found.text, found.sort, note, found.note)


def _charts(axis: Axis, board: BoardView) -> Iterator[Chart]:
    """Share of error points against the output step (Sec 5.3), of each solver and analysis."""
    for part in axis.parts:
        curves = [
            (model.name, curve)
            for model in board.models
            for curve in model.curves
            if (curve.protocol, curve.metric) == (part.name, ERROR_POINTS)
        ]
        for group in dict.fromkeys(curve.group for _, curve in curves):
            title = f"{part.title}: {group.replace('-', ' ')}"
            yield Chart(
                title,
                f"{title}: error points",
                "shares",
                {name: curve for name, curve in curves if curve.group == group},
                across="output step",
                up="error points",
                zero="Without an error point",
            )
