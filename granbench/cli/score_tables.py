"""Scores of a submission as tables for a terminal of 80 columns.

The axes define the contents (`Axis.text_tables`).
"""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.table import Table
from rich.text import Text

from granbench.benchmark.presentation import TextTable, found_scores
from granbench.benchmark.registry import axes, axis_code
from granbench.benchmark.score_text import written
from granbench.benchmark.scorecard import ALL

if TYPE_CHECKING:
    from granbench.benchmark.axis import Axis
    from granbench.benchmark.scorecard import Score
    from granbench.leaderboard.submission import Submission

TIED = "≈"


def tables(
    submission: "Submission", others: Sequence["Submission"], chosen: Sequence[str]
) -> Iterator[Table | Text]:
    """Tables of each split, with the scores of other submissions, and of scores without split.

    Parameters
    ----------
    submission : the scored model
    others : submissions to compare with
    chosen : names of the axes that the model was evaluated on
    """
    shown_axes = [axis for axis in axes() if set(axis.names) & set(chosen)]
    splits = (score.split for score in submission.scores if score.split != ALL)
    for split in (*dict.fromkeys(splits), ALL):
        for axis in shown_axes:
            with axis_code(axis):
                found = tuple(axis.text_tables(submission, split))
            for shown in found:
                yield Text(shown) if isinstance(shown, str) else _rich_table(shown)
            if axis.headline is not None and others:
                yield from _beside(axis, axis.headline.metric, submission, others, split)


def _rich_table(shown: TextTable) -> Table:
    table = _plain_table(shown.title, shown.caption)
    wraps = any(column.wraps for column in shown.columns)
    for column in shown.columns:
        table.add_column(
            column.heading,
            justify="left" if column.left else "right",
            no_wrap=not column.wraps and (wraps or bool(column.heading)),
            overflow="fold" if column.wraps else "ellipsis",
        )
    for row in shown.rows:
        table.add_row(*row)
    return table


def _beside(
    axis: "Axis",
    metric: str,
    submission: "Submission",
    others: Sequence["Submission"],
    split: str,
) -> Iterator[Table]:
    """The headline metric of several models, under every protocol."""
    from granbench.leaderboard.ranking import standing

    found = found_scores(submission, axis.names, split)
    shown = [part.name for part in axis.parts if (part.name, ALL, metric) in found]
    if not shown:
        return
    title = next(one.title for one in axis.metrics() if one.name == metric)
    tied = False
    rows = []
    for name in shown:
        main = found[name, ALL, metric]
        cells = [_of_other(other, main) for other in others]
        tied = tied or any(cell.startswith(TIED) for cell in cells)
        rows.append((name, written(main), *cells))
    caption = f"{TIED} tied with {submission.name}: the 95 % intervals overlap\n" if tied else ""
    table = _plain_table(f"{title} compared with others, split {split}", caption)
    table.add_column("protocol")
    for one in (submission, *others):
        note = standing(one)
        table.add_column(f"{one.name}\n({note})" if note else one.name, justify="right")
    for row in rows:
        table.add_row(*row)
    yield table


def _of_other(other: "Submission", score: "Score") -> str:
    from granbench.leaderboard.ranking import overlapping

    same = [item for item in other.scores if item.key == score.key]
    if not same:
        return "–"
    known = same[0].value is not None and score.value is not None
    tied = known and overlapping(same[0], score)
    return f"{TIED} {written(same[0])}" if tied else written(same[0])


def _plain_table(title: str, caption: str = "") -> Table:
    return Table(
        title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0),
        caption=caption or None, caption_justify="left",
    )  # fmt: skip
