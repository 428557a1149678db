"""The page of a task: what every axis shows of the submitted models."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from granbench.benchmark.presentation import Block, BoardView
from granbench.benchmark.registry import find_part, of_every_axis
from granbench.benchmark.scorecard import ALL
from granbench.benchmark.task_summary import shortages_of_scores
from granbench.data.replicates import ReplicateScatter
from granbench.leaderboard.agreement import lost_results
from granbench.leaderboard.curves import DrawnChart, drawn_chart
from granbench.leaderboard.ranking import RankedErrorsByName
from granbench.leaderboard.rows import Row, slug
from granbench.leaderboard.submission import Submission
from granbench.leaderboard.tables import BoardTable, board_table, headline_table, sections


@dataclass(frozen=True)
class PageBlock:
    """Something below a heading of a page.

    Parameters
    ----------
    heading : without the name of the split
    split, metric : shown only where the reader chose them; None: always
    table, charts : what it holds
    full : whether the table also has badges and the number of parameters
    """

    heading: str
    split: str | None
    metric: str | None
    table: BoardTable | None
    charts: tuple[DrawnChart, ...]
    full: bool


@dataclass(frozen=True)
class PageSection:
    """A section of a page.

    Parameters
    ----------
    heading, hint : of the section
    blocks : what it holds
    """

    heading: str
    blocks: tuple[PageBlock, ...]
    hint: str


def task_page(
    task: str,
    version: str,
    board: Sequence[Row],
    scatter: ReplicateScatter | None,
    errors: RankedErrorsByName,
) -> dict[str, Any]:
    """What the template of a task's page shows.

    Parameters
    ----------
    task, version : of the page
    board : the submissions to it
    scatter : between packings of its dataset, where it is known
    errors : of single paths by model, for ranks
    """
    submissions = [row.submission for row in board]
    scores = [score for submission in submissions for score in submission.scores]
    splits = list(dict.fromkeys(score.split for score in scores if score.split != ALL))
    name = slug(f"{task}-{version}")
    floor, note = None, ""
    if scatter:
        floor = scatter.floor_mse
        note = f"{scatter.pairs} pairs of paths, {scatter.specimens} packings prepared twice"
    view = BoardView(submissions, splits, floor, note)
    first = headline_table(submissions, splits[0], floor, errors)
    shown = _sections(view, submissions, errors)
    return {
        "task": task,
        "version": version,
        "slug": name,
        "file": f"{name}.html",
        "splits": [
            {
                "name": split,
                "paths": max(s.n for s in scores if s.split == split and s.group == ALL),
            }
            for split in splits
        ],
        "metrics": _metrics(view),
        "sections": shown,
        "glossary": list(of_every_axis(lambda axis: axis.glossary(view))),
        "submissions": sorted(submissions, key=lambda item: (item.role != "model", item.name)),
        "dataset": submissions[0].dataset,
        "scatter": scatter,
        "leader": first.leader if first else None,
        "notes": shortages_of_scores(scores),
        "lost": {
            submission.name: _lost(submission)
            for submission in submissions
            if submission.badge == "rerun"
        },
    }


def _sections(
    view: BoardView, submissions: Sequence[Submission], errors: RankedErrorsByName
) -> list[PageSection]:
    names = [submission.name for submission in submissions]
    return [
        PageSection(
            section.heading,
            tuple(
                PageBlock(
                    block.heading,
                    block.split,
                    block.metric,
                    _table(block, submissions, errors),
                    tuple(drawn_chart(chart, names) for chart in block.charts),
                    block.full,
                )
                for block in section.blocks
            ),
            section.hint,
        )
        for section in sections(view)
    ]


def _table(
    block: Block, submissions: Sequence[Submission], errors: RankedErrorsByName
) -> BoardTable | None:
    if block.table is None:
        return None
    return board_table(block.table, submissions, block.split, errors)


def _metrics(view: BoardView) -> dict[str, str]:
    """Metrics that a reader may choose, with their titles."""
    return {
        block.metric: block.metric_title
        for section in sections(view)
        for block in section.blocks
        if block.metric is not None
    }


def _lost(submission: Submission) -> list[str]:
    """Results of a model that rounding decides."""
    found = []
    for protocol, group in lost_results(submission.scores):
        part = find_part(protocol)
        if group != ALL:
            found.append(f"{group.replace('-', ' ')} ({part.title if part else protocol})")
    return sorted(found)
