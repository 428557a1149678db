"""Tables and charts of the embedded axis: models in place of the ground truth."""

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from granbench.benchmark.axes.embedded.metrics import EMBEDDED_METRICS, SPEED, TITLES
from granbench.benchmark.protocols import EMBEDDED
from granbench.benchmark.scorecard import ALL, Score
from granbench.fem.statement import SOLVERS
from granbench.leaderboard.chart import not_zero, share_chart
from granbench.leaderboard.submission import Submission
from granbench.leaderboard.tables import (
    Cell,
    Table,
    TableRow,
    line_of,
    number,
    of_seeds,
    ordered,
    share,
)
from granbench.plotting.error_curves import ErrorLine
from granbench.plotting.style import model_styles

REACTION, REACHED = "reaction_error", "reached_share"
ERROR_POINTS = "error_point_share"

Found = dict[tuple[str, str, str], Score]
"""Scores of the axis by solver, group and metric; empty where it was left out."""


def analyses_tables(submissions: Sequence[Submission]) -> list[Table]:
    """Of each solver the reaction in every analysis, and the means of every metric.

    Nothing where no model was evaluated on the axis, or the task states no analyses.
    """
    found = {submission.name: _of_axis(submission) for submission in submissions}
    tables = []
    for solver in SOLVERS:
        of_solver = [key for scores in found.values() for key in scores if key[0] == solver]
        groups = [group for group in dict.fromkeys(key[1] for key in of_solver) if group != ALL]
        if not groups:
            continue
        present = {metric for _, _, metric in of_solver}
        metrics = [name for name in EMBEDDED_METRICS if name in present]
        tables.append(
            _table(
                submissions,
                f"{TITLES[solver]}: error of the reaction",
                ["mean", *(group.replace("-", " ") for group in groups)],
                {
                    name: [_reaction(scores, solver, group) for group in (ALL, *groups)]
                    for name, scores in found.items()
                },
            )
        )
        tables.append(
            _table(
                submissions,
                f"{TITLES[solver]}: means over the analyses",
                [EMBEDDED_METRICS[name].title for name in metrics],
                {
                    name: [_cell(scores.get((solver, ALL, metric))) for metric in metrics]
                    for name, scores in found.items()
                },
            )
        )
    return tables


@dataclass(frozen=True)
class AnalysisChart:
    """Error points of every model in one analysis.

    Parameters
    ----------
    title : solver and analysis
    svg : the picture; None where no model has an error point
    clean : names of the models that have none
    """

    title: str
    svg: Markup | None
    clean: list[str]


def analyses_charts(submissions: Sequence[Submission]) -> list[AnalysisChart]:
    """Share of error points against the output step (Sec 5.3), of each solver and analysis."""
    styles = model_styles(submission.name for submission in submissions)
    lines: dict[tuple[str, str], list[ErrorLine]] = {}
    for submission in submissions:
        for curve in submission.curves:
            solver = curve.protocol.removeprefix(f"{EMBEDDED}-")
            if curve.metric != ERROR_POINTS or solver not in SOLVERS:
                continue
            line = line_of(submission.name, styles[submission.name], curve)
            lines.setdefault((solver, curve.group), []).append(line)
    ordered_places = sorted(lines, key=lambda place: SOLVERS.index(place[0]))
    return [_chart(solver, group, lines[solver, group]) for solver, group in ordered_places]


def _chart(solver: str, group: str, lines: Sequence[ErrorLine]) -> AnalysisChart:
    title = f"{TITLES[solver]}: {group.replace('-', ' ')}"
    svg = share_chart(lines, f"{title}: error points", "output step", "error points")
    shown = {line.name for line in not_zero(lines)}
    return AnalysisChart(title, svg, [line.name for line in lines if line.name not in shown])


def _of_axis(submission: Submission) -> Found:
    return {
        (score.protocol.removeprefix(f"{EMBEDDED}-"), score.group, score.metric): score
        for score in submission.scores
        if score.axis == EMBEDDED and score.split == ALL and score.status != "not_run"
    }


def _table(
    submissions: Sequence[Submission],
    title: str,
    columns: Sequence[str],
    cells: dict[str, list[Cell]],
) -> Table:
    styles = model_styles(submission.name for submission in submissions)
    rows = [
        TableRow(
            submission.name,
            styles[submission.name].colour,
            submission,
            tuple(cells[submission.name]),
        )
        for submission in submissions
    ]
    return Table(ALL, EMBEDDED, title, tuple(columns), ordered(rows, 0), 0)


def _reaction(scores: Found, solver: str, group: str) -> Cell:
    """The error of the reaction; below it, how far a run came that ended early."""
    cell = _cell(scores.get((solver, group, REACTION)))
    reached = scores.get((solver, group, REACHED))
    if reached is None or reached.value is None or reached.value == 1.0:
        return cell
    note = Markup("fails after {}").format(share(reached.value))
    return Cell(cell.text, cell.sort, note, cell.note)


def _cell(score: Score | None) -> Cell:
    if score is None:
        return Cell(Markup("not run"), note="the axis was left out of the evaluation")
    if score.value is None:
        return Cell(Markup("n/a"), note=score.reason or "")
    percent = EMBEDDED_METRICS[score.metric].percent
    text = share(score.value) if percent else number(score.value)
    if score.metric.endswith(SPEED):
        text += Markup(" ×")
    return Cell(text, score.value, note=of_seeds(score))
