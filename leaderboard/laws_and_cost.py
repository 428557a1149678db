"""Tables of the physics and cost axes: what a model violates, and what it costs."""

from collections.abc import Callable, Sequence

from markupsafe import Markup

from granbench.benchmark.axes.cost.scores import COST_METRICS
from granbench.benchmark.axes.physics.checks import CHECKS, Check
from granbench.benchmark.protocols import COST, PHYSICS
from granbench.benchmark.scorecard import ALL, Score
from granbench.leaderboard.submission import Submission
from granbench.leaderboard.tables import Cell, Table, TableRow, number, of_seeds, ordered, share
from granbench.plotting.style import model_styles

Found = dict[tuple[str, str], Score]
"""Scores of a submission by protocol and metric."""


def physics_table(submissions: Sequence[Submission], split: str) -> Table | None:
    """Worst violation of every check, with the share of paths beyond the tolerance.

    None where no model was evaluated on the axis.
    """
    rows = _rows(
        submissions,
        [_of_axis(submission, PHYSICS, split) for submission in submissions],
        lambda scores: tuple(_violation(check, scores) for check in CHECKS.values()),
    )
    if not rows:
        return None
    titles = tuple(check.title for check in CHECKS.values())
    return Table(split, "violation_worst", "Physics", titles, ordered(rows, 0), 0)


def cost_table(submissions: Sequence[Submission]) -> Table | None:
    """Parameters and times; None where no model was evaluated on the axis."""
    rows = _rows(
        submissions,
        [_of_axis(submission, COST, ALL) for submission in submissions],
        lambda scores: tuple(_cost(scores.get((COST, metric.name))) for metric in COST_METRICS),
    )
    if not rows:
        return None
    titles = tuple(metric.title for metric in COST_METRICS)
    timed = next(i for i, metric in enumerate(COST_METRICS) if metric.points)
    return Table(ALL, "cost", "Cost", titles, ordered(rows, timed), timed)


def _rows(
    submissions: Sequence[Submission],
    found: Sequence[Found],
    cells: Callable[[Found], tuple[Cell, ...]],
) -> list[TableRow]:
    """A row for each submission, of what was found of it; none where that is nothing at all."""
    if not any(found):
        return []
    styles = model_styles(submission.name for submission in submissions)
    return [
        TableRow(submission.name, styles[submission.name].colour, submission, cells(scores))
        for submission, scores in zip(submissions, found, strict=True)
    ]


def _of_axis(submission: Submission, axis: str, split: str) -> Found:
    """Scores of an axis by protocol and metric; empty where it was left out."""
    return {
        (score.protocol, score.metric): score
        for score in submission.scores
        if (score.axis, score.split, score.group) == (axis, split, ALL)
        and score.status != "not_run"
    }


def _violation(check: Check, scores: Found) -> Cell:
    worst = scores.get((check.name, "violation_worst"))
    beyond = scores.get((check.name, "violated_share"))
    if worst is None or beyond is None:
        return Cell(Markup("not run"), note="the axis was left out of the evaluation")
    if worst.value is None or beyond.value is None:
        return Cell(Markup("n/a"), note=worst.reason or "")
    verdict = Markup("passes")
    if beyond.value:
        verdict = Markup("{} of paths").format(share(beyond.value))
    note = f"{worst.n} paths; up to {check.tolerance:g} passes"
    return Cell(number(worst.value), worst.value, verdict, note)


def _cost(score: Score | None) -> Cell:
    if score is None:
        return Cell(Markup("not run"), note="the axis was left out of the evaluation")
    if score.value is None:
        return Cell(Markup("n/a"), note=score.reason or "")
    text = number(score.value)
    if score.metric == "parameters":
        text = Markup(f"{score.value:,.0f}")
    elif score.unit == "s":
        text = (
            Markup(f"{1e6 * score.value:.3g} µs") if score.value < 1e-3 else text + Markup(" s")
        )  # fmt: skip
    return Cell(text, score.value, note=of_seeds(score))
