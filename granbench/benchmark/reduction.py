"""From the values of every path to one score with its interval."""

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from granbench.benchmark.bootstrap import Resampling
from granbench.benchmark.metrics import Metric
from granbench.benchmark.scorecard import Score, rounded


class Part(Protocol):
    """A part of the benchmark that is evaluated as a whole: a protocol or a check."""

    @property
    def name(self) -> str:
        """Label in the files."""

    @property
    def axis(self) -> str:
        """The benchmark axis that it belongs to."""


@dataclass(frozen=True)
class Paths:
    """The paths that a score is made from.

    Parameters
    ----------
    split, group : as in `Score`
    n : how many
    resampling : of them, by specimen
    """

    split: str
    group: str
    n: int
    resampling: Resampling


def not_run(part: Part, metric: Metric, paths: Paths) -> Score:
    """What stands for a score of an axis that was left out."""
    reason = f"axis {part.axis} was left out of the evaluation"
    return Score(**_place(part, metric, paths), status="not_run", reason=reason)


def not_applicable(part: Part, metric: Metric, paths: Paths, reason: str) -> Score:
    """What stands for a score that cannot be."""
    return Score(**_place(part, metric, paths), status="not_applicable", reason=reason)


def reduced(part: Part, metric: Metric, paths: Paths, values: np.ndarray) -> Score:
    """The score of values (seed, path) or (seed, path, component)."""
    if metric.component is not None:
        values = values[..., metric.component]
    value = metric.estimate(values)
    if not math.isfinite(value):
        reason = "in some seed fewer than half of the paths diverge"
        return not_applicable(part, metric, paths, reason)
    resampled = metric.resampled(values)
    interval = paths.resampling.interval(resampled) if resampled else None
    low, high = interval or (math.inf, math.inf)
    return Score(
        **_place(part, metric, paths),
        status="scored",
        value=rounded(value),
        low=rounded(low) if math.isfinite(low) else None,
        high=rounded(high) if math.isfinite(high) else None,
        by_seed=tuple(rounded(single) for single in metric.by_seed(values)),
    )


def _place(part: Part, metric: Metric, paths: Paths) -> dict[str, Any]:
    return {
        "axis": part.axis,
        "protocol": part.name,
        "split": paths.split,
        "group": paths.group,
        "metric": metric.name,
        "unit": metric.unit,
        "n": paths.n,
    }


def split_order(splits: np.ndarray) -> list[str]:
    """The splits that occur, `test` first."""
    return sorted(set(splits), key=lambda name: (name != "test", name))
