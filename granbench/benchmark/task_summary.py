"""What a task consists of, for people: splits with their sizes, analyses, and what is too few."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from granbench.benchmark.bootstrap import MINIMUM_SPECIMENS
from granbench.benchmark.registry import axes_for, headline_axis
from granbench.benchmark.scorecard import ALL, Score
from granbench.benchmark.task import Task, axes_with_analyses

MINIMUM_ANALYSES = 3


@dataclass(frozen=True)
class SplitSize:
    """Numbers of paths and of specimens in a split."""

    paths: int
    specimens: int


def split_sizes(task: Task, records: xr.Dataset) -> dict[str, SplitSize]:
    """Size of every split that the task lists, by its name in the file.

    Parameters
    ----------
    task : see `granbench.benchmark.task.Task`
    records : its whole dataset
    """
    split = records["split"].values.astype(str)
    specimen = records["specimen"].values.astype(str)
    return {
        name: SplitSize(int((split == name).sum()), len(np.unique(specimen[split == name])))
        for name in task.splits.roles()
    }


def shortages_of_task(task: Task, sizes: Mapping[str, SplitSize]) -> list[str]:
    """Sentences about scored splits and analyses that are too few for an interval."""
    few = [
        name
        for name in task.splits.scored
        if name in sizes and sizes[name].specimens < MINIMUM_SPECIMENS
    ]
    return _sentences(few, len(task.analyses), axes_with_analyses(axes_for(task.axes)))


def shortages_of_scores(scores: Iterable[Score]) -> list[str]:
    """The same, as far as scores show it: the mean error of few specimens has no interval."""
    headline = headline_axis().headline
    assert headline is not None  # that is what the axis was chosen by
    splits: dict[str, bool] = {}
    analyses = 0
    analysed = axes_with_analyses()
    for score in scores:
        if score.status == "scored" and score.group == ALL:
            if score.metric == headline.metric:
                splits[score.split] = score.low is None
            if score.axis in analysed:
                analyses = max(analyses, score.n)
    return _sentences([name for name, missing in splits.items() if missing], analyses, analysed)


def _sentences(few: Sequence[str], analyses: int, analysed: Sequence[str]) -> list[str]:
    found = [
        f"split {name} has fewer than {MINIMUM_SPECIMENS} specimens: its scores have no interval"
        for name in few
    ]
    if 0 < analyses < MINIMUM_ANALYSES:
        which = "one analysis" if analyses == 1 else f"{analyses} analyses"
        axis = ", ".join(analysed)
        found.append(
            f"the axis {axis} has {which}, fewer than {MINIMUM_ANALYSES}: its means say little of "
            "other problems"
        )
    return found


def task_as_json(task: Task, sizes: Mapping[str, SplitSize] | None = None) -> dict[str, Any]:
    """Plain values of a task for JSON.

    Parameters
    ----------
    task : see `granbench.benchmark.task.Task`
    sizes : of its splits; None where its records are not at hand
    """
    content = task.model_dump(mode="json", exclude_none=True)
    if sizes is not None:
        content["sizes"] = {
            name: {"paths": size.paths, "specimens": size.specimens} for name, size in sizes.items()
        }
        content["notes"] = shortages_of_task(task, sizes)
    return content
