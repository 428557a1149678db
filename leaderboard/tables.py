"""What the pages show: scores of submissions as tables and lines."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from markupsafe import Markup, escape

from granbench.benchmark.metrics import metrics
from granbench.benchmark.protocols import PROTOCOLS
from granbench.benchmark.scorecard import ALL, Curve, Score
from granbench.leaderboard.ranking import (
    PathErrorsByName,
    few_seeds,
    is_ranked,
    ranked_last,
    shared_ranks,
    standing,
)
from granbench.leaderboard.submission import Submission
from granbench.plotting.error_curves import ErrorLine
from granbench.plotting.style import ModelStyle, model_styles

_TITLES = {metric.name: metric.title for metric in metrics([], "noise")}
METRICS_SHOWN: dict[str, str] = {
    name: _TITLES[name]
    for name in (
        "stress_mse_mean",
        "stress_mse_median",
        "stress_mse_worst",
        "void_ratio_mse_mean",
        "output_mse_mean",
        "relative_error_mean",
        "error_point_share",
        "diverged_share",
        "failed_share",
    )
}
RECOMPUTED_METRICS: dict[str, str] = {
    name: _TITLES[name] for name in ("recomputed_mse_mean", "recomputed_mse_worst")
}
"""Shown where a model made the records, so that there is a truth along noised strain."""
FAMILY_METRICS = ("stress_mse_mean", "relative_error_mean")
SHARES = ("error_point_share", "diverged_share", "failed_share", "relative_error_mean")
RANKED_PROTOCOL = "rollout"
SMALLEST_EXPONENT = -300
"""Of a power of ten that both ends of an interval are divided by."""


@dataclass(frozen=True)
class Cell:
    """One number of a table as it is shown.

    Parameters
    ----------
    text : the value, or what stands for it
    sort : the number that it is sorted by; None puts it last either way
    interval : 95 % interval, "" where there is none
    note : what stands behind it, shown on hovering
    best : whether it is the best of the ranked models
    """

    text: Markup
    sort: float | None = None
    interval: Markup | str = ""
    note: str = ""
    best: bool = False


@dataclass(frozen=True)
class TableRow:
    """One model's row.

    Parameters
    ----------
    name, colour, cells : what it shows
    submission : None for the scatter between packings
    rank : such as "1", or "1=" where it is shared; "" of what is not ranked
    """

    name: str
    colour: str
    submission: Submission | None
    cells: tuple[Cell, ...]
    rank: str = ""

    @property
    def ranked(self) -> bool:
        """Whether it is a model that takes part in the ranking."""
        return self.submission is not None and is_ranked(self.submission)

    @property
    def standing(self) -> str:
        """What it says of its seeds."""
        return "" if self.submission is None else standing(self.submission)


@dataclass(frozen=True)
class Table:
    """Models against protocols or loading families, for one split and metric.

    Parameters
    ----------
    split, metric, title : what it shows
    columns : headings of the scores
    rows : models, the best first
    ordered_by : index of the column that they are ordered by
    """

    split: str
    metric: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[TableRow, ...]
    ordered_by: int

    @property
    def leader(self) -> str | None:
        """Names of the best ranked models, if any: several where they share the first rank."""
        ranked = [row for row in self.rows if row.ranked]
        if not ranked:
            return None
        best = ranked[0]
        shared = [row.name for row in ranked if best.rank and row.rank == best.rank]
        return " and ".join(shared or [best.name])


def metrics_shown(submissions: Sequence[Submission]) -> dict[str, str]:
    """Metrics that a page offers, with their titles."""
    recomputed = any(
        score.metric in RECOMPUTED_METRICS and score.value is not None
        for submission in submissions
        for score in submission.scores
    )
    return METRICS_SHOWN | (RECOMPUTED_METRICS if recomputed else {})


def main_table(
    submissions: Sequence[Submission],
    split: str,
    metric: str,
    floor: float | None,
    errors: PathErrorsByName | None = None,
) -> Table:
    """Every protocol's score of one metric, ordered by that of the whole-path rollout.

    Parameters
    ----------
    submissions : of one task
    split, metric : which scores
    floor : normalised MSE of stress that scatter between packings alone gives
    errors : of single paths by model, where they are at hand, for ranks
    """
    columns = [(spec.title, spec.name, ALL) for spec in PROTOCOLS.values()]
    table = _table(submissions, split, metric, columns, errors or {})
    if metric != "stress_mse_mean" or floor is None:
        return table
    cells = tuple(
        Cell(number(floor), floor, note="half the mean square between packings made alike")
        if spec.name == RANKED_PROTOCOL
        else Cell(Markup("–"), note="scatter between packings is a floor of whole paths only")
        for spec in PROTOCOLS.values()
    )
    scatter = TableRow("replicate scatter", "", None, cells)
    return replace(table, rows=ordered([*table.rows, scatter], table.ordered_by))


def family_table(submissions: Sequence[Submission], split: str, metric: str) -> Table | None:
    """Whole-path scores of one metric by loading family; None where there is one family."""
    families = sorted(
        {
            score.group
            for submission in submissions
            for score in submission.scores
            if score.split == split and score.group != ALL
        }
    )
    if len(families) < 2:
        return None
    columns = [(family, RANKED_PROTOCOL, family) for family in families]
    return _table(submissions, split, metric, columns)


def lines_of(submissions: Sequence[Submission], split: str, protocol: str) -> list[ErrorLine]:
    """The error curves of one protocol and split."""
    styles = model_styles(submission.name for submission in submissions)
    lines = []
    for submission in submissions:
        for curve in submission.curves:
            if (curve.split, curve.protocol) == (split, protocol):
                lines.append(line_of(submission.name, styles[submission.name], curve))
    return lines


def line_of(name: str, style: ModelStyle, curve: Curve) -> ErrorLine:
    """A model's curve in its colour and line style."""
    return ErrorLine(name, style, curve.horizon, curve.value, curve.low, curve.high)


def number(value: float) -> Markup:
    """Three significant digits; small and large ones as a power of ten."""
    if value == 0.0:
        return Markup("0")
    if 1e-2 <= abs(value) < 1e4:
        digits = f"{value:.3g}"
        return Markup(escape(f"{value:.0f}" if "e" in digits else digits))
    mantissa, exponent = f"{value:.2e}".split("e")
    power = str(int(exponent)).replace("-", "−")
    return Markup(f"{mantissa}·10<sup>{power}</sup>")


def share(value: float) -> Markup:
    """A share in percent."""
    percent = 100.0 * value
    digits = f"{percent:.0f}" if percent >= 100.0 else f"{percent:.3g}"
    return Markup(escape("0 %" if percent == 0.0 else f"{digits} %"))


def _interval(low: float, value: float, high: float, metric: str) -> Markup:
    """Both ends in the unit of the value above them: one power of ten, one per cent sign."""
    if metric in SHARES:
        return Markup("{:.3g} … {:.3g} %").format(100.0 * low, 100.0 * high)
    exponent = math.floor(math.log10(value)) if value > 0.0 else 0
    if not SMALLEST_EXPONENT <= exponent < -2:
        return Markup("{} … {}").format(number(low), number(high))
    scale = 10.0**exponent
    power = str(exponent).replace("-", "−")
    return Markup("{:.3g} … {:.3g} ·10<sup>{}</sup>").format(low / scale, high / scale, power)


def _table(
    submissions: Sequence[Submission],
    split: str,
    metric: str,
    columns: list[tuple[str, str, str]],
    errors: PathErrorsByName | None = None,
) -> Table:
    styles = model_styles(submission.name for submission in submissions)
    found = {
        submission.name: {
            (score.protocol, score.group): score
            for score in submission.scores
            if score.split == split and score.metric == metric
        }
        for submission in submissions
    }
    best = {}
    for _, protocol, group in columns:
        ranked = [
            score.value
            for submission in submissions
            if is_ranked(submission)
            and (score := found[submission.name].get((protocol, group))) is not None
            and score.value is not None
        ]
        best[protocol, group] = min(ranked, default=None)
    ranking = next(
        (i for i, column in enumerate(columns) if column[1:] == (RANKED_PROTOCOL, ALL)), 0
    )
    ranks: dict[str, str] = {}
    if errors is not None:
        scores = {
            submission.name: score
            for submission in submissions
            if is_ranked(submission)
            and (score := found[submission.name].get(columns[ranking][1:])) is not None
            and score.value is not None
        }
        ranks = shared_ranks(scores, split, metric, errors)
    rows = [
        TableRow(
            submission.name,
            styles[submission.name].colour,
            submission,
            tuple(
                _cell(
                    found[submission.name].get((protocol, group)),
                    metric,
                    best[protocol, group] if is_ranked(submission) else None,
                )
                for _, protocol, group in columns
            ),
            ranks.get(submission.name, ""),
        )
        for submission in submissions
    ]

    return Table(
        split,
        metric,
        _TITLES[metric],
        tuple(title for title, _, _ in columns),
        ordered(rows, ranking),
        ranking,
    )


def ordered(rows: list[TableRow], column: int) -> tuple[TableRow, ...]:
    """Rows by the number in one column, those without one last; of few seeds after every ranked."""
    facts = [
        (
            row.cells[column].sort,
            row.name,
            row.ranked,
            row.submission is not None and few_seeds(row.submission),
        )
        for row in rows
    ]
    return tuple(rows[place] for place in ranked_last(facts))


def of_seeds(score: Score) -> str:
    """The values of the seeds, or that they agree."""
    if len(score.by_seed) > 1 and len(set(score.by_seed)) == 1:
        return "the same for every seed"
    return f"{len(score.by_seed)} seeds: {', '.join(f'{value:.3g}' for value in score.by_seed)}"


def _cell(score: Score | None, metric: str, best: float | None) -> Cell:
    if score is None:
        return Cell(Markup("–"), note="no such score")
    if score.value is None:
        text = "n/a" if score.status == "not_applicable" else "not run"
        return Cell(Markup(text), note=score.reason or "")
    render = share if metric in SHARES else number
    interval: Markup | str = ""
    if score.low is not None and score.high is not None and score.high > score.low:
        interval = _interval(score.low, score.value, score.high, metric)
    return Cell(
        render(score.value),
        score.value,
        interval,
        f"{score.n} paths; {of_seeds(score)}",
        best is not None and score.value == best,
    )
