"""Tables of the pages: what an axis shows of its scores, with ranks, colours and an order."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from granbench.benchmark.metric import Direction
from granbench.benchmark.presentation import BoardView, Cell, ModelTable, Section
from granbench.benchmark.registry import headline_axis, of_every_axis
from granbench.leaderboard.ranking import (
    RankedErrorsByName,
    few_seeds,
    is_ranked,
    ranked_last,
    shared_ranks,
    standing,
    worse,
)
from granbench.leaderboard.submission import Submission
from granbench.plotting.style import model_styles


@dataclass(frozen=True)
class TableRow:
    """One model's row.

    Parameters
    ----------
    name, colour, cells : what it shows
    submission : None for a reference that is no model
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
class BoardTable:
    """Models against columns of numbers.

    Parameters
    ----------
    title : also read out by screen readers
    columns : headings of the scores
    rows : models, the best first
    ordered_by : index of the column that they are ordered by
    """

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


def sections(board: BoardView) -> list[Section]:
    """The sections of a task's page, axis after axis."""
    return list(of_every_axis(lambda axis: axis.board_sections(board)))


def headline_table(
    submissions: Sequence[Submission],
    split: str,
    floor: float | None = None,
    errors: RankedErrorsByName | None = None,
) -> BoardTable | None:
    """The scores of one split that models are ranked by; None where no model has any.

    Parameters
    ----------
    submissions : of one task
    split : which scores
    floor : normalised MSE of stress that scatter between packings alone gives
    errors : of single paths by model, where they are at hand, for ranks
    """
    axis = headline_axis()
    for section in axis.board_sections(BoardView(submissions, [split], floor)):
        for block in section.blocks:
            if axis.headline and block.table and block.metric == axis.headline.metric:
                return board_table(block.table, submissions, split, errors)
    return None


def board_table(
    table: ModelTable,
    submissions: Sequence[Submission],
    split: str | None,
    errors: RankedErrorsByName | None = None,
) -> BoardTable:
    """A table of an axis with colours, ranks and the best of every column.

    Parameters
    ----------
    table : made by an axis
    submissions : the models in it
    split : of the records, for the errors of single paths
    errors : of single paths by model, where they are at hand, for ranks
    """
    by_name = {submission.name: submission for submission in submissions}
    styles = model_styles(by_name)
    cells = _with_best(table, by_name) if table.marks_best else table.cells
    ranks: Mapping[str, str] = {}
    if table.ranked_by is not None:
        scores = {
            name: score
            for name, score in table.ranked_by.items()
            if score.value is not None and is_ranked(by_name[name])
        }
        ranks = shared_ranks(scores, split or "", errors or {}, table.direction)
    rows = [
        TableRow(name, styles[name].colour, by_name[name], row, ranks.get(name, ""))
        for name, row in cells.items()
    ]
    rows += [TableRow(name, "", None, row) for name, row in table.reference.items()]
    ordered_rows = ordered(rows, table.ordered_by, table.direction)
    return BoardTable(table.title, table.columns, ordered_rows, table.ordered_by)


def _with_best(table: ModelTable, by_name: Mapping[str, Submission]) -> dict[str, tuple[Cell, ...]]:
    """The cells, the best of the ranked models in every column marked."""
    best: list[float | None] = []
    for column in range(len(table.columns)):
        values = [
            value
            for name, row in table.cells.items()
            if is_ranked(by_name[name]) and (value := row[column].sort) is not None
        ]
        best.append(min(values, key=lambda value: worse(value, table.direction), default=None))
    return {
        name: tuple(
            replace(cell, best=cell.sort is not None and cell.sort == best[column])
            if is_ranked(by_name[name])
            else cell
            for column, cell in enumerate(row)
        )
        for name, row in table.cells.items()
    }


def ordered(
    rows: Sequence[TableRow], column: int, direction: Direction = "lower"
) -> tuple[TableRow, ...]:
    """Rows by the number in one column, those without one last; of few seeds after every ranked."""
    facts = []
    for row in rows:
        value = row.cells[column].sort
        few = row.submission is not None and few_seeds(row.submission)
        key = None if value is None else worse(value, direction)
        facts.append((key, row.name, row.ranked, few))
    return tuple(rows[place] for place in ranked_last(facts))
