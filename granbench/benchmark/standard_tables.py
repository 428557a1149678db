"""Tables of an axis that says nothing of its own presentation."""

from collections.abc import Iterator

from granbench.benchmark.axis import Axis
from granbench.benchmark.presentation import (
    Block,
    BoardView,
    Column,
    ModelTable,
    ModelView,
    Section,
    TextTable,
    found_scores,
)
from granbench.benchmark.score_text import cell, written, written_interval
from granbench.benchmark.scorecard import ALL
from granbench.benchmark.section_file import metrics_table


def text_tables(axis: Axis, model: ModelView, split: str) -> Iterator[TextTable | str]:
    """One row for each part and metric: the value, its interval, or why there is none."""
    found = found_scores(model, axis.names, split)
    rows = []
    for part in axis.parts:
        for metric in axis.metrics():
            score = found.get((part.name, ALL, metric.name))
            if score is not None and "terminal" in metric.shown:
                label = metric.title if len(axis.parts) == 1 else f"{part.title}: {metric.title}"
                value = written(score, metric.style)
                rows.append((label, value, written_interval(score), score.reason or ""))
    if not rows:
        return
    where = f"{model.name} on {model.task}" + ("" if split == ALL else f", split {split}")
    yield TextTable(
        f"{axis.title} of {where}",
        (
            Column("", left=True),
            Column("value"),
            Column("95 %\ninterval"),
            Column("", left=True, wraps=True),
        ),
        tuple(rows),
    )


def board_sections(axis: Axis, board: BoardView) -> Iterator[Section]:
    """One table a split: models against metrics; ordered by the first metric."""
    blocks = []
    metrics = [metric for metric in axis.metrics() if "board" in metric.shown]
    for split in (*board.splits, ALL):
        found = {model.name: found_scores(model, axis.names, split) for model in board.models}
        places = [
            (part, metric)
            for part in axis.parts
            for metric in metrics
            if any((part.name, ALL, metric.name) in scores for scores in found.values())
        ]
        if not places:
            continue
        single = len(axis.parts) == 1
        table = ModelTable(
            axis.title if split == ALL else f"{axis.title}, split {split}",
            tuple(m.title if single else f"{part.title}: {m.title}" for part, m in places),
            {
                name: tuple(
                    cell(scores.get((part.name, ALL, metric.name)), metric)
                    for part, metric in places
                )
                for name, scores in found.items()
            },
            direction=places[0][1].direction,
        )
        blocks.append(Block(axis.title, None if split == ALL else split, table=table))
    if blocks:
        yield Section(axis.title, tuple(blocks))


def glossary(axis: Axis, board: BoardView) -> Iterator[tuple[str, str]]:
    """Titles and definitions of the parts and metrics, where a model was evaluated on the axis."""
    if any(
        score.axis in axis.names and score.status != "not_run"
        for model in board.models
        for score in model.scores
    ):
        for part in axis.parts:
            if part.definition:
                yield part.title, part.definition
        for metric in axis.metrics():
            yield metric.title, metric.definition


def plugged_in_definitions(axis: Axis) -> Iterator[tuple[str, str]]:
    """Titles and definitions of metrics that other packages have registered for an axis."""
    for metric in axis.metrics():
        if metric not in axis.own_metrics:
            yield metric.title, metric.definition


def section(axis: Axis) -> str:
    """Title, what the class of the axis says of itself, and the table of metrics."""
    text = (type(axis).__doc__ or "").strip().splitlines()
    summary = f"{text[0]}\n\n" if text else ""
    return f"## {axis.title}\n\n{summary}{metrics_table(axis.metrics())}\n"
