"""What an axis is described with: its variables, its parts, and the groups that are scored."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from granbench.benchmark.bootstrap import Resampling
from granbench.benchmark.metric import Metric
from granbench.benchmark.scorecard import rounded


@dataclass(frozen=True)
class Stored:
    """A variable of the predictions file.

    Parameters
    ----------
    dims : names of its dimensions
    units : SI
    long_name : what it is
    exact : whether it is kept as it is, not rounded to `predictions.KEEP_BITS`
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    exact: bool = False


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of an axis that has scores of its own: a protocol, a check, a solver.

    Parameters
    ----------
    name : label in the files (`Score.protocol`)
    axis : name of the axis (`Score.axis`)
    title : for people
    definition : in one sentence; "" where the title says it
    limit : largest value that passes; None where there is none
    seeded : whether the seed of a deterministic model changes its result, as that of noise does
    """

    name: str
    axis: str
    title: str
    definition: str = ""
    limit: float | None = None
    seeded: bool = False


@dataclass(frozen=True)
class Group:
    """The paths (or analyses) that a score is made from.

    Parameters
    ----------
    split, name : as `split` and `group` of `Score`
    n : how many
    rows : their positions in a statistic
    resampling : of them, by specimen; None: no interval
    """

    split: str
    name: str
    n: int
    rows: Sequence[int] | np.ndarray
    resampling: Resampling | None = None

    def interval(self, metric: Metric, values: np.ndarray) -> tuple[float | None, float | None]:
        """Ends of the bootstrap interval of a score; None for one that is not finite.

        Parameters
        ----------
        metric : of the score
        values : (seed, path) of the metric's statistic for the paths of the group
        """
        resampled = metric.aggregation.of_resamples
        if self.resampling is None or resampled is None:
            return None, None
        low, high = self.resampling.interval(resampled(values)) or (np.nan, np.nan)
        return _finite(low), _finite(high)


def _finite(end: np.ndarray | float) -> float | None:
    return rounded(end) if np.isfinite(end) else None


class PathSample(Protocol):
    """Predicted and true stress of whole paths: the samples of the axis with the headline."""

    @property
    def predicted(self) -> np.ndarray:
        """(seed, path, step, component), Pa; NaN after a breakdown."""

    @property
    def true(self) -> np.ndarray:
        """(path, step, component), Pa."""

    @property
    def truths(self) -> list[np.ndarray]:
        """The true stress, and others that predictions are compared with."""

    @property
    def stress_scale(self) -> np.ndarray:
        """(component,), training standard deviation, Pa."""


@dataclass(frozen=True)
class Highlight:
    """A score that is shown where there is room for few.

    Parameters
    ----------
    protocol, split, metric : which score
    title : of its column
    """

    protocol: str
    split: str
    metric: str
    title: str
