"""Tables of the physics axis: which laws a model violates, and by how much."""

from collections.abc import Iterator, Mapping, Sequence

from markupsafe import Markup

from granbench.benchmark.axes.physics.checks import CHECKS, TANGENT, Check
from granbench.benchmark.axes.physics.metrics import KINK_SHARE, VIOLATED_SHARE, WORST_VIOLATION
from granbench.benchmark.axis import Axis
from granbench.benchmark.metric import Metric
from granbench.benchmark.presentation import (
    Block,
    BoardView,
    Cell,
    Column,
    Found,
    ModelTable,
    ModelView,
    Section,
    TextTable,
    found_scores,
)
from granbench.benchmark.score_text import LEFT_OUT, cell, number, share, written
from granbench.benchmark.scorecard import ALL
from granbench.benchmark.standard_tables import plugged_in_definitions
from granbench.data.markdown import table


def text_tables(axis: Axis, model: ModelView, split: str) -> Iterator[TextTable | str]:
    """One row a check: its violation, what is allowed and the verdict; or what does not apply."""
    if split == ALL:
        yield from _reasons(axis, model)
        return
    found = found_scores(model, axis.names, split)
    if not found:
        return
    metrics = [metric for metric in axis.metrics() if "terminal" in metric.shown]
    paths = found[next(iter(CHECKS)), ALL, WORST_VIOLATION].n
    where = f"{model.name} on {model.task}, split {split}"
    columns = [Column("check", left=True)]
    for metric in metrics:
        columns.append(Column(metric.column()))
        if metric.name == WORST_VIOLATION:
            columns.append(Column("allowed"))
    rows = [_text_row(check, found, metrics) for check in CHECKS.values()]
    kinks = found[TANGENT, ALL, KINK_SHARE].value
    yield TextTable(
        f"Physics of {where}: {paths} paths",
        (*columns, Column("", left=True)),
        tuple(rows),
        f"{100.0 * kinks:.3g} % of the tangents are at kinks and left out\n" if kinks else "",
    )


def _text_row(check: Check, found: Found, metrics: list[Metric]) -> tuple[str, ...]:
    applies = found[check.name, ALL, WORST_VIOLATION].value is not None
    cells = [check.title]
    for metric in metrics:
        cells.append(written(found.get((check.name, ALL, metric.name)), metric.style))
        if metric.name == WORST_VIOLATION:
            cells.append(f"{check.tolerance:g}" if applies else "–")
    if not applies:
        return (*cells, "does not apply")
    beyond = found[check.name, ALL, VIOLATED_SHARE].value
    return (*cells, "VIOLATED" if beyond else "passes")


def _reasons(axis: Axis, model: ModelView) -> Iterator[str]:
    """Why checks do not apply, each reason once."""
    reasons = {
        CHECKS[score.protocol].title: score.reason
        for score in model.scores
        if score.axis in axis.names and score.status == "not_applicable"
    }
    for reason in dict.fromkeys(reasons.values()):
        titles = [title for title, text in reasons.items() if text == reason]
        named = "No check applies" if len(titles) == len(CHECKS) else f"{', '.join(titles)}: n/a"
        yield f"{named}, {reason}."


def board_sections(axis: Axis, board: BoardView) -> Iterator[Section]:
    """Worst violation of every check, with the share of paths beyond the tolerance."""
    blocks = []
    for split in board.splits:
        found = {model.name: found_scores(model, axis.names, split) for model in board.models}
        if not any(found.values()):
            continue
        cells = {
            name: tuple(_violation(check, scores) for check in CHECKS.values())
            for name, scores in found.items()
        }
        blocks.append(_block("Worst violation", f"Physics, split {split}", split, cells))
        for metric in axis.metrics():
            if metric not in axis.own_metrics and "board" in metric.shown:
                cells = {
                    name: tuple(
                        cell(scores.get((check.name, ALL, metric.name)), metric)
                        for check in CHECKS.values()
                    )
                    for name, scores in found.items()
                }
                title = f"{metric.title}, split {split}"
                blocks.append(_block(metric.title, title, split, cells))
    if blocks:
        yield Section(
            "Physics",
            tuple(blocks),
            "Worst checked path; small print: whether all paths pass, or the share that does not. "
            "The definitions and tolerances are at the end of the page. A model can pass every "
            "check and be wrong everywhere: these laws hold for any material.",
        )


def _block(heading: str, title: str, split: str, cells: Mapping[str, tuple[Cell, ...]]) -> Block:
    titles = tuple(check.title for check in CHECKS.values())
    return Block(heading, split, table=ModelTable(title, titles, cells))


def _violation(check: Check, scores: Found) -> Cell:
    worst = scores.get((check.name, ALL, WORST_VIOLATION))
    beyond = scores.get((check.name, ALL, VIOLATED_SHARE))
    if worst is None or beyond is None:
        return Cell(Markup("not run"), note=LEFT_OUT)
    if worst.value is None or beyond.value is None:
        return Cell(Markup("n/a"), note=worst.reason or "")
    verdict = Markup("passes")
    if beyond.value:
        verdict = Markup("{} of paths").format(share(beyond.value))
    note = f"{worst.n} paths; up to {check.tolerance:g} passes"
    return Cell(number(worst.value), worst.value, verdict, note)


def glossary(axis: Axis, board: BoardView) -> Iterator[tuple[str, str]]:
    """What every check measures and allows."""
    for check in CHECKS.values():
        yield check.title, f"{check.definition}; up to {check.tolerance:g} passes"
    yield from plugged_in_definitions(axis)


def measured_table(models: Sequence[ModelView]) -> str:
    """Worst violation of every check over all scored splits, one column a model, in Markdown."""
    rows = []
    for check in CHECKS.values():
        cells = [f"`{check.name}`"]
        for model in models:
            violations = [
                score.value
                for score in model.scores
                if (score.protocol, score.metric) == (check.name, WORST_VIOLATION)
                and score.value is not None
            ]
            if not violations:
                cells.append("n/a")
                continue
            worst = max(violations)
            shown = f"{worst:.1e}" if worst else "0"
            cells.append(f"**{shown}**" if worst > check.tolerance else shown)
        rows.append(cells)
    return table(["check", *(f"`{model.name}` on `{model.task}`" for model in models)], rows)
