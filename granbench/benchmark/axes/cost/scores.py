"""Scores of the cost axis: what a model costs, whatever it is worth."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from granbench.benchmark.protocols import COST
from granbench.benchmark.scorecard import ALL, Score, rounded
from granbench.errors import SubmissionError


@dataclass(frozen=True)
class CostMetric:
    """One metric of cost.

    Parameters
    ----------
    name : as in the files
    title : for people
    unit : "s" or "1"
    points : Gauss points in the batch that is timed; None where nothing is timed
    against_truth : whether it is divided by that of the ground truth
    """

    name: str
    title: str
    unit: str
    points: int | None = None
    against_truth: bool = False


COST_METRICS: tuple[CostMetric, ...] = (
    CostMetric("parameters", "Parameters", "1"),
    CostMetric("training_seconds", "Training", "s"),
    CostMetric("update_seconds_100", "Update of a point, 100 at once", "s", 100),
    CostMetric("update_seconds_10000", "Update of a point, 10,000 at once", "s", 10_000),
    CostMetric("update_ratio_100", "Update over ground truth, 100 at once", "1", 100, True),
    CostMetric("update_ratio_10000", "Update over ground truth, 10,000 at once", "1", 10_000, True),
)


def cost_scores(
    predictions: xr.Dataset, no_truth: str | None, reads: bool = False
) -> Iterator[Score]:
    """Every score of the cost axis; they belong to no split.

    Parameters
    ----------
    predictions : see `granbench.benchmark.predictions`
    no_truth : why there is no ground truth to compare with, or None
    reads : whether the model is the ceiling, to which nothing is timed

    Raises
    ------
    SubmissionError
        If the times of a model that computes its answers are missing.
    """
    for metric in COST_METRICS:
        place: dict[str, Any] = {
            "axis": COST, "protocol": COST, "split": ALL, "metric": metric.name,
            "unit": metric.unit,
        }  # fmt: skip
        if "parameters" not in predictions:
            reason = f"axis {COST} was left out of the evaluation"
            yield Score(**place, status="not_run", reason=reason)
            continue
        obstacle, values = _values(predictions, metric, no_truth, reads)
        if obstacle:
            yield Score(**place, status="not_applicable", reason=obstacle)
        else:
            by_seed = tuple(rounded(value) for value in values)
            value = rounded(np.mean(values))
            yield Score(**place, status="scored", value=value, by_seed=by_seed)


def _values(
    predictions: xr.Dataset, metric: CostMetric, no_truth: str | None, reads: bool
) -> tuple[str | None, np.ndarray]:
    """Why the metric does not apply, or None; and its values (seed,)."""
    none = np.empty(0)
    if metric.points is None:
        if metric.name not in predictions:
            raise _lacks(metric.name)
        values = predictions[metric.name].values.astype(np.float64)
        known = np.isfinite(values).all()
        return (None if known else "how long the model was trained is not known"), values
    if metric.against_truth and no_truth:
        return no_truth, none
    if reads:
        return "the model reads its answers from the records, which is no update", none
    seconds = _timed(predictions, "update_seconds", metric.points)
    if seconds is None:
        raise _lacks("update_seconds")
    if metric.against_truth:
        truth = _timed(predictions, "truth_update_seconds", metric.points)
        if truth is None or not np.isfinite(truth).all():
            return "the ground truth was not timed", none
        seconds = seconds / truth
    if not np.isfinite(seconds).all():
        return "the model broke down while it was timed", none
    return None, seconds


def _timed(predictions: xr.Dataset, name: str, points: int) -> np.ndarray | None:
    if name not in predictions or points not in predictions["points"].values:
        return None
    return predictions[name].sel(points=points).values.astype(np.float64)


def _lacks(name: str) -> SubmissionError:
    return SubmissionError(f"the predictions lack {name!r}; run `granbench evaluate` again")
