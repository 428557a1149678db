"""Metrics: numbers for the board, each made from one statistic by one way of averaging.

Changing a definition here, in `statistics` or in `bootstrap` changes `METRIC_VERSION`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from granbench.benchmark.bootstrap import weighted_mean, weighted_median
from granbench.benchmark.protocols import ProtocolSpec

METRIC_VERSION = "1.3"
"""1.0: the errors along recorded paths. 1.1: besides them the physics axis, the cost axis, and
noise against the recomputed truth. 1.2: besides them the embedded axis, on tasks that state
boundary-value problems. 1.3: no interval where fewer than three specimens were tested, because
they say nothing of the scatter between specimens. No version changed a value of an earlier one."""


RECOMPUTED = "recomputed_"
"""Begins the statistics against the truth along the noised strain."""


@dataclass(frozen=True)
class Metric:
    """One metric.

    Parameters
    ----------
    name : as in the files
    title : for people
    statistic : the per-path statistic that it is made from
    reduction : over paths: "mean", "median" or "worst"
    unit : "1" for a dimensionless one, "step"
    by_family : whether it is also given for each loading family
    component : index of the stress component that it is about
    needs_free_run : whether it has a meaning only where the model feeds itself to the end
    """

    name: str
    title: str
    statistic: str
    reduction: str
    unit: str = "1"
    by_family: bool = False
    component: int | None = None
    needs_free_run: bool = False

    def obstacle(
        self, protocol: ProtocolSpec, statistics: list[str], no_noised_truth: str | None
    ) -> str | None:
        """Why the metric does not apply to a protocol and a model, or None.

        Parameters
        ----------
        protocol : that the predictions were made by
        statistics : those that there are of it
        no_noised_truth : why there is no truth for noised strain, or None
        """
        if self.needs_free_run and protocol.restart is not None:
            return "the true record is given again before a run can diverge"
        if self.statistic.startswith(RECOMPUTED) and no_noised_truth is not None:
            return no_noised_truth
        if self.statistic not in statistics:
            return "the model does not predict the void ratio"
        return None

    def estimate(self, values: np.ndarray) -> float:
        """The metric of values (seed, path): of each seed, then the mean (worst: the largest)."""
        by_seed = self.by_seed(values)
        return max(by_seed) if self.reduction == "worst" else float(np.mean(by_seed))

    def by_seed(self, values: np.ndarray) -> list[float]:
        """The metric of each seed."""
        reduce: dict[str, Callable[[np.ndarray], float]] = {
            "mean": np.mean,
            "median": np.median,
            "worst": np.max,
        }
        return [float(reduce[self.reduction](row)) for row in values]

    def resampled(self, values: np.ndarray) -> Callable[[np.ndarray], np.ndarray] | None:
        """Estimates under resample weights; None for the worst case, which has no interval.

        A resample never shows a path worse than the worst, so a percentile interval of a
        maximum would be an interval in name only.
        """
        if self.reduction == "mean":
            over_seeds = values.mean(axis=0)
            return lambda weights: weighted_mean(over_seeds, weights)
        if self.reduction == "median":
            return lambda weights: np.mean([weighted_median(row, weights) for row in values], 0)
        return None


def metrics(components: list[str], axis: str) -> tuple[Metric, ...]:
    """Every metric of this version for an axis whose predictions are compared with records.

    Parameters
    ----------
    components : labels of the stress components
    axis : on the noise axis there are metrics against the recomputed truth, too
    """
    found = (
        Metric("stress_mse_mean", "Stress MSE", "stress_squared_error", "mean", by_family=True),
        Metric(
            "stress_mse_median", "Stress MSE, median path", "stress_squared_error", "median",
            by_family=True,
        ),
        Metric("stress_mse_worst", "Stress MSE, worst path", "stress_squared_error", "worst"),
        *(
            Metric(
                f"stress_{label}_mse_mean", f"MSE of σ{label}", "component_squared_error",
                "mean", component=index,
            )
            for index, label in enumerate(components)
        ),
        Metric(
            "void_ratio_mse_mean", "Void-ratio MSE", "void_ratio_squared_error", "mean",
            by_family=True,
        ),
        Metric(
            "void_ratio_mse_median", "Void-ratio MSE, median path", "void_ratio_squared_error",
            "median",
        ),
        Metric(
            "void_ratio_mse_worst", "Void-ratio MSE, worst path", "void_ratio_squared_error",
            "worst",
        ),
        Metric("output_mse_mean", "MSE of stress and void ratio", "output_squared_error", "mean"),
        Metric(
            "relative_error_mean", "Relative stress error", "relative_error", "mean",
            by_family=True,
        ),
        Metric(
            "relative_error_median", "Relative stress error, median path", "relative_error",
            "median",
        ),
        Metric("error_point_share", "Error points", "error_point_share", "mean", by_family=True),
        Metric("diverged_share", "Diverged", "diverged", "mean", needs_free_run=True),
        Metric(
            "divergence_step_median", "Median step of divergence", "divergence_step", "median",
            unit="step", needs_free_run=True,
        ),
        Metric("failed_share", "Broken down", "failed", "mean"),
    )  # fmt: skip
    return found + NOISE_METRICS if axis == "noise" else found


NOISE_METRICS: tuple[Metric, ...] = (
    Metric(
        "recomputed_mse_mean", "Stress MSE, recomputed truth", "recomputed_squared_error", "mean",
        by_family=True,
    ),
    Metric(
        "recomputed_mse_median", "Stress MSE, recomputed truth, median path",
        "recomputed_squared_error", "median",
    ),
    Metric(
        "recomputed_mse_worst", "Stress MSE, recomputed truth, worst path",
        "recomputed_squared_error", "worst",
    ),
    Metric(
        "recomputed_relative_error_mean", "Relative stress error, recomputed truth",
        "recomputed_relative_error", "mean",
    ),
    Metric(
        "recomputed_error_point_share", "Error points, recomputed truth",
        "recomputed_error_point_share", "mean",
    ),
)  # fmt: skip
"""Against the ground truth, recomputed along the noised strain (Eq 5.13)."""

PHYSICS_METRICS: tuple[Metric, ...] = (
    Metric("violation_mean", "Violation", "violation", "mean"),
    Metric("violation_worst", "Violation, worst path", "violation", "worst"),
    Metric("violated_share", "Paths beyond the tolerance", "violated", "mean"),
)
"""Of every check."""

TANGENT_METRICS: tuple[Metric, ...] = (
    Metric("kink_share", "Points without a derivative", "kink_share", "mean"),
)
"""Of the tangent check besides."""
