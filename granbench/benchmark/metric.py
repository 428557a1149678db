"""Metrics: one number of a scorecard each, made of a statistic and an aggregation.

A *statistic* is one number for each path (or analysis) and seed. An *aggregation* turns the
statistic of many paths into one number, with an interval. Several metrics may share a statistic,
which is then computed once.

A metric is one object. The built-in ones stand in the folder of their axis; any other package
registers its own under the entry-point group `granbench.metrics`. It then appears in the scorecard,
in the tables of the terminal and of the board, and in the documentation.

Changing the definition of a metric here, in an axis or in `bootstrap` changes `METRIC_VERSION`.
"""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from granbench.benchmark.bootstrap import weighted_mean, weighted_median
from granbench.benchmark.tolerance import VALUE, Tolerance

METRIC_VERSION = "1.3"
"""1.0: the errors along recorded paths. 1.1: besides them the physics axis, the cost axis, and
noise against the recomputed truth. 1.2: besides them the embedded axis, on tasks that state
boundary-value problems. 1.3: no interval where fewer than three specimens were tested, because
they say nothing of the scatter between specimens. No version changed a value of an earlier one."""


Direction = Literal["lower", "higher", "target 1"]
"""Which values are better."""

Style = Literal["number", "percent", "count", "time", "speed-up"]
"""How a value is written: `time` in s or µs, `speed-up` with a multiplication sign."""

Place = Literal["terminal", "board", "board by family"]
"""Where a metric has a column or a row; the scorecard and the documentation have all of them."""

COMPONENT = "{component}"
"""Stands in the name and title of a metric that there is for each stress component."""


class NotApplicable(Exception):
    """Raised by a statistic that does not exist for a model or a protocol; the text says why.

    The score is `not_applicable` then, and the text is its reason.
    """


@dataclass(frozen=True)
class Statistic:
    """One number for each path (or analysis) and seed.

    Parameters
    ----------
    name : unique within the axis: statistics of one name are computed once
    compute : maps the sample of a protocol, check or solver (see `Axis.sample`) to values
        (seed, path), or (seed, path, component) for a metric of each component. It may raise
        `NotApplicable`.
    """

    name: str
    compute: Callable[[Any], np.ndarray]


@dataclass(frozen=True)
class Aggregation:
    """Turns the statistic of many paths into one number.

    Parameters
    ----------
    name : as in the names of metrics
    of_paths : maps the values of one seed (path,) to a number
    of_seeds : maps the numbers of all seeds to the score
    of_resamples : maps values (seed, path) to a function of resample weights (resample, path) that
        gives estimates (resample,), for the bootstrap interval; None where there is no interval
    """

    name: str
    of_paths: Callable[[np.ndarray], float]
    of_seeds: Callable[[Sequence[float]], float]
    of_resamples: Callable[[np.ndarray], Callable[[np.ndarray], np.ndarray]] | None = None

    def by_seed(self, values: np.ndarray) -> list[float]:
        """The number of each seed, from values (seed, path)."""
        return [float(self.of_paths(row)) for row in values]


def _mean_of_resamples(values: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    over_seeds = values.mean(axis=0)
    return lambda weights: weighted_mean(over_seeds, weights)


def _median_of_resamples(values: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    return lambda weights: np.mean([weighted_median(row, weights) for row in values], 0)


def _mean_of_seeds(numbers: Sequence[float]) -> float:
    return float(np.mean(numbers))


MEAN = Aggregation("mean", np.mean, _mean_of_seeds, _mean_of_resamples)
MEDIAN = Aggregation("median", np.median, _mean_of_seeds, _median_of_resamples)
WORST = Aggregation("worst", np.max, max)
"""A resample never shows a path worse than the worst, so a percentile interval of a maximum would
be an interval in name only: there is none."""

GEOMETRIC_MEAN = Aggregation(
    "geometric mean", lambda ratios: np.exp(np.log(ratios).mean()), _mean_of_seeds
)
"""Mean of ratios; exactly 1 where all of them are."""


@dataclass(frozen=True, kw_only=True)
class Metric:
    """One metric.

    Parameters
    ----------
    name : as in the files; with `COMPONENT` for one metric of each stress component
    axis : name of the registered axis that it belongs to (`Axis.name`)
    title : for people
    definition : in one sentence; metrics that share it share a row of the documentation
    statistic, aggregation : what it is made of
    unit : "1" for a dimensionless one
    direction : which values are better
    tolerance : how far two computations of it may differ
    of_truth : what the ground truth itself scores; None where that is not determined
    parts : names of axes, protocols, checks or solvers that have it; empty: all of the axis
    by_group : whether it is also given for each loading family
    component : index of the stress component; None for one metric of all components
    undefined : reason where the aggregation gives no finite number
    style : how a value is written
    shown : where it has a column or a row
    heading : of a column in the terminal, two lines at most; made from the title by default
    finds_copies : whether equal values of two models make them suspect of being one model
    package : name of the package that registers it, which the registry enters; None for metrics of
        an axis itself
    """

    name: str
    axis: str
    title: str
    definition: str
    statistic: Statistic
    aggregation: Aggregation = MEAN
    unit: str = "1"
    direction: Direction = "lower"
    tolerance: Tolerance = VALUE
    of_truth: float | None = 0.0
    parts: tuple[str, ...] = ()
    by_group: bool = False
    component: int | None = None
    undefined: str = "the value is not a finite number"
    style: Style = "number"
    shown: tuple[Place, ...] = ("terminal", "board")
    heading: str = ""
    finds_copies: bool = False
    package: str | None = field(default=None, repr=False, compare=False)

    @property
    def by_component(self) -> bool:
        """Whether it stands for one metric of each stress component."""
        return COMPONENT in self.name

    def of_components(self, labels: Sequence[str]) -> tuple["Metric", ...]:
        """The metrics that it stands for: itself, or one for each of the components."""
        if not self.by_component:
            return (self,)
        return tuple(
            replace(
                self,
                name=self.name.replace(COMPONENT, label),
                title=self.title.replace(COMPONENT, label),
                component=index,
            )
            for index, label in enumerate(labels)
        )

    def is_named(self, name: str) -> bool:
        """Whether it is the metric of a score, whatever the component."""
        pattern = re.escape(self.name).replace(re.escape(COMPONENT), r"\w+")
        return re.fullmatch(pattern, name) is not None

    def applies_to(self, part: Any) -> bool:
        """Whether a protocol, check or solver (`Part`) has it."""
        return not self.parts or part.name in self.parts or part.axis in self.parts

    def column(self) -> str:
        """Heading of its column in the terminal."""
        return self.heading or self.title.replace(" ", "\n", 1)

    def estimate(self, values: np.ndarray) -> tuple[float, list[float]] | None:
        """The score of values (seed, path), and the number of each seed; None: not finite."""
        by_seed = self.aggregation.by_seed(values)
        value = self.aggregation.of_seeds(by_seed)
        return (value, by_seed) if math.isfinite(value) else None
