"""What an axis shows of scores: tables, charts and sections, whoever draws them.

The terminal (`granbench.cli.score_tables`) and the board (`granbench.leaderboard`) turn these
into rich tables and into HTML.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

from markupsafe import Markup, escape

from granbench.benchmark.metric import Direction, Metric, Style
from granbench.benchmark.scorecard import ALL, Curve, Score

LEFT_OUT = "the axis was left out of the evaluation"


class ModelView(Protocol):
    """A model with its scores, such as a submission."""

    @property
    def name(self) -> str:
        """Name of the model."""

    @property
    def task(self) -> str:
        """Name of the task."""

    @property
    def seeds(self) -> tuple[int, ...]:
        """Of the models, or of the noise."""

    @property
    def deterministic(self) -> bool | None:
        """Whether it is one model under every seed."""

    @property
    def scores(self) -> tuple[Score, ...]:
        """All of them."""

    @property
    def curves(self) -> tuple[Curve, ...]:
        """All of them."""


@dataclass(frozen=True)
class BoardView:
    """The models on the page of a task.

    Parameters
    ----------
    models : in the order of the board
    splits : of the records, the test split first
    floor : normalised MSE of stress that scatter between packings alone gives; None: not known
    floor_note : what it was computed from
    """

    models: Sequence[ModelView]
    splits: Sequence[str]
    floor: float | None = None
    floor_note: str = ""


@dataclass(frozen=True)
class Column:
    """A column of a table in the terminal.

    Parameters
    ----------
    heading : may have two lines
    left : whether it is text, aligned to the left
    wraps : whether a long entry goes on in the next line
    """

    heading: str
    left: bool = False
    wraps: bool = False


@dataclass(frozen=True)
class TextTable:
    """A table for the terminal.

    Parameters
    ----------
    title, columns, rows : what stands in it
    caption : below it, "" for nothing
    """

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""


@dataclass(frozen=True)
class Cell:
    """One number of a table of the board.

    Parameters
    ----------
    text : the value, or what stands for it
    sort : the number that it is sorted by; None puts it last either way
    interval : small print below: the 95 % interval, or another remark
    note : what stands behind it, shown on hovering
    best : whether it is the best of the ranked models
    """

    text: Markup
    sort: float | None = None
    interval: Markup | str = ""
    note: str = ""
    best: bool = False


@dataclass(frozen=True)
class ModelTable:
    """Models against columns of numbers.

    Parameters
    ----------
    title : also read out by screen readers
    columns : headings
    cells : of each model, by its name
    ordered_by : index of the column that the models are ordered by
    reference : rows without a model, by their names
    ranked_by : scores of the models in the column that they are ordered by, where the table ranks
        them; None where it does not
    marks_best : whether the best of every column is marked
    direction : which values are better
    """

    title: str
    columns: tuple[str, ...]
    cells: Mapping[str, tuple[Cell, ...]]
    ordered_by: int = 0
    reference: Mapping[str, tuple[Cell, ...]] = field(default_factory=dict)
    ranked_by: Mapping[str, Score] | None = None
    marks_best: bool = False
    direction: Direction = "lower"


@dataclass(frozen=True)
class Chart:
    """Curves of several models.

    Parameters
    ----------
    title : above it
    label : read out by screen readers
    scale : "decades" for errors, "shares" for shares from 0 to 1
    across, up : titles of the axes of a chart of shares
    curves : by name of the model
    reference : a dashed line across; None for none
    zero : begins the sentence that names models which are zero everywhere
    """

    title: str
    label: str
    scale: Literal["decades", "shares"]
    curves: Mapping[str, Curve]
    across: str = ""
    up: str = ""
    reference: float | None = None
    zero: str = ""


@dataclass(frozen=True)
class Block:
    """Something below a heading, shown for one split or one metric where these are chosen.

    Parameters
    ----------
    heading : without the name of the split
    split, metric, metric_title : shown only where the reader chose them; None: always
    table, charts : what it holds
    full : whether the table also has badges and the number of parameters
    """

    heading: str = ""
    split: str | None = None
    metric: str | None = None
    metric_title: str = ""
    table: ModelTable | None = None
    charts: tuple[Chart, ...] = ()
    full: bool = False


@dataclass(frozen=True)
class Section:
    """A section of a page.

    Parameters
    ----------
    heading : of the section
    blocks : what it holds
    hint : how it is read, in small print
    """

    heading: str
    blocks: tuple[Block, ...]
    hint: str = ""


Found = dict[tuple[str, str, str], Score]
"""Scores by protocol, group and metric."""


def found_scores(
    model: ModelView, names: Sequence[str], split: str, *, with_left_out: bool = False
) -> Found:
    """Scores of some axes and one split, by protocol, group and metric.

    Parameters
    ----------
    model : with its scores
    names : of the axes
    split : one of the records, or "all"
    with_left_out : whether scores of axes that were not run are among them
    """
    return {
        (score.protocol, score.group, score.metric): score
        for score in model.scores
        if score.axis in names
        and score.split == split
        and (with_left_out or score.status != "not_run")
    }


def written(score: Score | None, style: Style = "number") -> str:
    """A score for the terminal, in three significant digits."""
    if score is None:
        return "–"
    if score.value is None:
        return "n/a"
    value = score.value
    if style == "percent":
        percent = 100.0 * value
        return f"{percent:.0f} %" if percent >= 100.0 else f"{percent:.3g} %"
    if style == "count":
        return f"{value:,.0f}"
    if style == "time":
        if value < 1e-3:
            return f"{1e6 * value:.3g} µs"
        return f"{value:,.0f} s" if value >= 100.0 else f"{value:.3g} s"
    return f"{value:.3g}"


def written_interval(score: Score | None) -> str:
    """The interval of a score for the terminal."""
    if score is None or score.low is None or score.high is None:
        return "–"
    return f"{score.low:.2g}–{score.high:.2g}"


def number(value: float) -> Markup:
    """Three significant digits for the board; small and large ones as a power of ten."""
    if value == 0.0:
        return Markup("0")
    if 1e-2 <= abs(value) < 1e4:
        digits = f"{value:.3g}"
        return Markup(escape(f"{value:.0f}" if "e" in digits else digits))
    mantissa, exponent = f"{value:.2e}".split("e")
    power = str(int(exponent)).replace("-", "−")
    return Markup(f"{mantissa}·10<sup>{power}</sup>")


def share(value: float) -> Markup:
    """A share in per cent, for the board."""
    percent = 100.0 * value
    digits = f"{percent:.0f}" if percent >= 100.0 else f"{percent:.3g}"
    return Markup(escape("0 %" if percent == 0.0 else f"{digits} %"))


def rendered(value: float, style: Style) -> Markup:
    """A value for the board, as its metric is written."""
    if style == "percent":
        return share(value)
    if style == "count":
        return Markup(f"{value:,.0f}")
    if style == "time":
        return Markup(f"{1e6 * value:.3g} µs") if value < 1e-3 else number(value) + Markup(" s")
    return number(value) + (Markup(" ×") if style == "speed-up" else "")


def of_seeds(score: Score) -> str:
    """The values of the seeds, or that they agree."""
    if len(score.by_seed) > 1 and len(set(score.by_seed)) == 1:
        return "the same for every seed"
    return f"{len(score.by_seed)} seeds: {', '.join(f'{value:.3g}' for value in score.by_seed)}"


def cell(score: Score | None, metric: Metric | None) -> Cell:
    """A score on the board: its value, or why there is none; of an axis that may be left out."""
    if score is None:
        return Cell(Markup("not run"), note=LEFT_OUT)
    if score.value is None:
        return Cell(Markup("n/a"), note=score.reason or "")
    style = metric.style if metric else "number"
    return Cell(rendered(score.value, style), score.value, note=of_seeds(score))


__all__ = [
    "ALL",
    "LEFT_OUT",
    "Block",
    "BoardView",
    "Cell",
    "Chart",
    "Column",
    "Found",
    "ModelTable",
    "ModelView",
    "Section",
    "TextTable",
    "cell",
    "found_scores",
    "number",
    "of_seeds",
    "rendered",
    "share",
    "written",
    "written_interval",
]
