"""Statistics and metrics of the cost axis: what a model costs, whatever it is worth."""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from granbench.benchmark.metric import Metric, NotApplicable, Statistic
from granbench.benchmark.scored_task import NO_GROUND_TRUTH, ScoredPredictions
from granbench.benchmark.tolerance import CLOCK

NAME = "cost"
PARAMETERS, TRAINING = "parameters", "training_seconds"
UPDATE, TRUTH_UPDATE = "update_seconds", "truth_update_seconds"
POINTS = (100, 10_000)
"""Gauss points in one call of `step`: a coarse mesh in the plane, and a fine one."""


@dataclass(frozen=True)
class Costs:
    """What was measured of a model; statistics are (seed, 1).

    Parameters
    ----------
    predictions : with the variables of the cost axis
    reads_records : whether the model looks its answers up, which is no update
    has_ground_truth : whether there is a ground truth to compare with
    """

    predictions: xr.Dataset
    reads_records: bool
    has_ground_truth: bool

    @classmethod
    def of(cls, scored: ScoredPredictions) -> "Costs":
        """The costs in a predictions file."""
        return cls(scored.predictions, scored.reads_records, scored.task.has_ground_truth)

    @property
    def parameters(self) -> np.ndarray:
        """Number of trained or fitted parameters."""
        return self._column(self.predictions[PARAMETERS])

    @property
    def training(self) -> np.ndarray:
        """Time of training, s.

        Raises
        ------
        NotApplicable
            If it is not known.
        """
        seconds = self._column(self.predictions[TRAINING])
        if not np.isfinite(seconds).all():
            raise NotApplicable("how long the model was trained is not known")
        return seconds

    def update(self, points: int) -> np.ndarray:
        """CPU time of one update of one point, s, in a batch of `points`.

        Raises
        ------
        NotApplicable
            If nothing was timed, or the model broke down meanwhile.
        """
        if self.reads_records:
            raise NotApplicable("the model reads its answers from the records, which is no update")
        seconds = self._column(self.predictions[UPDATE].sel(points=points))
        if not np.isfinite(seconds).all():
            raise NotApplicable("the model broke down while it was timed")
        return seconds

    def update_ratio(self, points: int) -> np.ndarray:
        """The same divided by that of the ground truth.

        Raises
        ------
        NotApplicable
            As `update`, and if there is no ground truth or it was not timed.
        """
        if not self.has_ground_truth:
            raise NotApplicable(NO_GROUND_TRUTH)
        if self.reads_records:
            return self.update(points)
        not_timed = NotApplicable("the ground truth was not timed")
        if TRUTH_UPDATE not in self.predictions:
            raise not_timed
        truth = self._column(self.predictions[TRUTH_UPDATE].sel(points=points))
        if not np.isfinite(truth).all():
            raise not_timed
        return self.update(points) / truth

    @staticmethod
    def _column(values: xr.DataArray) -> np.ndarray:
        return values.values.astype(np.float64)[:, None]


def _updates(points: int) -> Statistic:
    return Statistic(f"update_seconds_{points}", lambda costs: costs.update(points))


def _ratios(points: int) -> Statistic:
    return Statistic(f"update_ratio_{points}", lambda costs: costs.update_ratio(points))


_metric: Any = partial(Metric, axis=NAME, of_truth=None)
_UPDATE = (
    "CPU time of one update of one Gauss point, with 100 or 10,000 points in one call of `step`, "
    "without gradients"
)
_RATIO = "the same divided by that of the ground truth"

METRICS: tuple[Metric, ...] = (
    _metric(
        name=PARAMETERS, title="Parameters", definition="trained or fitted parameters",
        statistic=Statistic(PARAMETERS, lambda costs: costs.parameters), style="count",
    ),
    _metric(
        name=TRAINING, title="Training", unit="s",
        definition="time of training, as the model's files state it",
        statistic=Statistic(TRAINING, lambda costs: costs.training), style="time",
    ),
    _metric(
        name="update_seconds_100", title="Update of a point, 100 at once", unit="s",
        definition=_UPDATE, statistic=_updates(100), style="time", tolerance=CLOCK,
    ),
    _metric(
        name="update_seconds_10000", title="Update of a point, 10,000 at once", unit="s",
        definition=_UPDATE, statistic=_updates(10_000), style="time", tolerance=CLOCK,
    ),
    _metric(
        name="update_ratio_100", title="Update over ground truth, 100 at once",
        definition=_RATIO, statistic=_ratios(100), tolerance=CLOCK, of_truth=1.0,
    ),
    _metric(
        name="update_ratio_10000", title="Update over ground truth, 10,000 at once",
        definition=_RATIO, statistic=_ratios(10_000), tolerance=CLOCK, of_truth=1.0,
    ),
)  # fmt: skip
"""The metrics in the order of the scorecard."""
