"""Statistics and metrics of predictions that are compared with recorded paths."""

from functools import partial
from typing import Any

import numpy as np

from granbench.benchmark.axes.along_paths.path_errors import PathErrors
from granbench.benchmark.axes.along_paths.protocols import NOISE
from granbench.benchmark.metric import MEDIAN, WORST, Metric, Statistic
from granbench.benchmark.tolerance import SHARE_OF_PATHS, SHARE_OF_STEPS, STEP

NAME = "along-paths"
HEADLINE = "stress_mse_mean"
"""The metric that models are ranked by, and that has curves."""


def _joint(errors: PathErrors) -> np.ndarray:
    stress = errors.by_component
    return (np.sum(stress, axis=-1) + errors.void_ratio_error) / (stress.shape[-1] + 1)


STRESS = Statistic("stress_squared_error", lambda errors: errors.by_component.mean(axis=-1))
COMPONENT = Statistic("component_squared_error", lambda errors: errors.by_component)
VOID_RATIO = Statistic("void_ratio_squared_error", lambda errors: errors.void_ratio_error)
OUTPUT = Statistic("output_squared_error", _joint)
RELATIVE = Statistic("relative_error", lambda errors: errors.relative.mean(axis=-1))
ERROR_POINTS = Statistic("error_point_share", lambda errors: errors.error_point.mean(axis=-1))
DIVERGENCE_STEP = Statistic("divergence_step", lambda errors: errors.divergence_step)
DIVERGED = Statistic(
    "diverged", lambda errors: np.isfinite(errors.divergence_step).astype(np.float64)
)
FAILED = Statistic("failed", lambda errors: errors.failed.astype(np.float64))
RECOMPUTED = Statistic(
    "recomputed_squared_error", lambda errors: errors.against_noised_truth.squared
)
RECOMPUTED_RELATIVE = Statistic(
    "recomputed_relative_error", lambda errors: errors.against_noised_truth.relative
)
RECOMPUTED_ERROR_POINTS = Statistic(
    "recomputed_error_point_share", lambda errors: errors.against_noised_truth.error_point_share
)

_metric: Any = partial(Metric, axis=NAME)
_noised: Any = partial(Metric, axis=NAME, parts=(NOISE,))

_OF_STRESS = "squared normalised stress error, mean over steps and components"
_OF_VOIDS = "squared normalised error of the void ratio, where the model predicts it"
_OF_NORMS = "Frobenius norm of the stress error over that of the true stress"
_OF_RECOMPUTED = "as `stress_mse`, against the ground truth along the *noised* strain"

METRICS: tuple[Metric, ...] = (
    _metric(
        name=HEADLINE, title="Stress MSE", heading="stress\nMSE", definition=_OF_STRESS,
        statistic=STRESS, by_group=True, finds_copies=True,
        shown=("terminal", "board", "board by family"),
    ),
    _metric(
        name="stress_mse_median", title="Stress MSE, median path", definition=_OF_STRESS,
        statistic=STRESS, aggregation=MEDIAN, by_group=True, shown=("board",),
    ),
    _metric(
        name="stress_mse_worst", title="Stress MSE, worst path", heading="worst\npath",
        definition=_OF_STRESS, statistic=STRESS, aggregation=WORST,
    ),
    _metric(
        name="stress_{component}_mse_mean", title="MSE of σ{component}",
        definition="the same of one component", statistic=COMPONENT, finds_copies=True, shown=(),
    ),
    _metric(
        name="void_ratio_mse_mean", title="Void-ratio MSE", heading="void\nMSE",
        definition=_OF_VOIDS, statistic=VOID_RATIO, by_group=True, finds_copies=True,
    ),
    _metric(
        name="void_ratio_mse_median", title="Void-ratio MSE, median path", definition=_OF_VOIDS,
        statistic=VOID_RATIO, aggregation=MEDIAN, shown=(),
    ),
    _metric(
        name="void_ratio_mse_worst", title="Void-ratio MSE, worst path", definition=_OF_VOIDS,
        statistic=VOID_RATIO, aggregation=WORST, shown=(),
    ),
    _metric(
        name="output_mse_mean", title="MSE of stress and void ratio",
        definition="mean over stress components and void ratio, the loss of Sec 2.2",
        statistic=OUTPUT, finds_copies=True, shown=("board",),
    ),
    _metric(
        name="relative_error_mean", title="Relative stress error", heading="relative\nerror",
        definition=_OF_NORMS, statistic=RELATIVE, by_group=True, style="percent",
        shown=("terminal", "board", "board by family"),
    ),
    _metric(
        name="relative_error_median", title="Relative stress error, median path",
        definition=_OF_NORMS, statistic=RELATIVE, aggregation=MEDIAN, style="percent", shown=(),
    ),
    _metric(
        name="error_point_share", title="Error points", heading="error\npoints",
        definition="share of steps with a relative error above 50 % (Sec 5.3)",
        statistic=ERROR_POINTS, by_group=True, style="percent", tolerance=SHARE_OF_STEPS,
    ),
    _metric(
        name="diverged_share", title="Diverged",
        definition="share of paths that are error points from some step to their end",
        statistic=DIVERGED, style="percent", tolerance=SHARE_OF_PATHS, shown=("board",),
    ),
    _metric(
        name="divergence_step_median", title="Median step of divergence",
        definition="first such step", statistic=DIVERGENCE_STEP, aggregation=MEDIAN, unit="step",
        direction="higher", tolerance=STEP, of_truth=None, shown=(),
        undefined="in some seed fewer than half of the paths diverge",
    ),
    _metric(
        name="failed_share", title="Broken down", heading="failed",
        definition="share of paths with a step that has no finite stress", statistic=FAILED,
        style="percent", tolerance=SHARE_OF_PATHS,
    ),
    _noised(
        name="recomputed_mse_mean", title="Stress MSE, recomputed truth",
        definition=_OF_RECOMPUTED, statistic=RECOMPUTED, by_group=True, shown=("board",),
    ),
    _noised(
        name="recomputed_mse_median", title="Stress MSE, recomputed truth, median path",
        definition=_OF_RECOMPUTED, statistic=RECOMPUTED, aggregation=MEDIAN, shown=(),
    ),
    _noised(
        name="recomputed_mse_worst", title="Stress MSE, recomputed truth, worst path",
        definition=_OF_RECOMPUTED, statistic=RECOMPUTED, aggregation=WORST, shown=("board",),
    ),
    _noised(
        name="recomputed_relative_error_mean", title="Relative stress error, recomputed truth",
        definition="as `relative_error`, against the same", statistic=RECOMPUTED_RELATIVE,
        style="percent", shown=(),
    ),
    _noised(
        name="recomputed_error_point_share", title="Error points, recomputed truth",
        definition="as `error_point_share`, against the same", statistic=RECOMPUTED_ERROR_POINTS,
        style="percent", tolerance=SHARE_OF_STEPS, shown=(),
    ),
)  # fmt: skip
"""The metrics in the order of the scorecard. Those against the recomputed truth take the ground
truth along the noised strain (Eq 5.13) in place of the record."""

AGAINST_NOISED_TRUTH = {
    HEADLINE: "recomputed_mse_mean",
    "stress_mse_worst": "recomputed_mse_worst",
    "relative_error_mean": "recomputed_relative_error_mean",
    "error_point_share": "recomputed_error_point_share",
    "failed_share": "failed_share",
}
"""Metrics against the truth along the noised strain, by the metric whose column they stand in."""
