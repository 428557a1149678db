"""What an axis shows of scores: tables, charts and sections, however they are drawn.

The terminal (`granbench.cli.score_tables`) and the board (`granbench.leaderboard`) turn these
into rich tables and into HTML.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

from markupsafe import Markup

from granbench.benchmark.metric import Direction
from granbench.benchmark.scorecard import Curve, Score


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
        """Seeds of the models, or of the noise."""

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
