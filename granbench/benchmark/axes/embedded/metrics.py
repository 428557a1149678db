"""Statistics and metrics of analyses with a model in place of the ground truth."""

from functools import partial
from typing import Any

from granbench.benchmark.metric import GEOMETRIC_MEAN, Metric, Statistic
from granbench.benchmark.tolerance import CLOCK, LostTolerance, Tolerance
from granbench.fem.statement import EXPLICIT

NAME = "embedded"
REACTION, REACHED, ERROR_POINTS = "reaction_error", "reached_share", "error_point_share"

_CLOSE, _FACTOR = 0.02, 3.0
ANALYSIS = Tolerance("value of an analysis", relative=_CLOSE, lost=LostTolerance(factor=_FACTOR))
"""Through the thousands of steps of an analysis a difference of 1e-13 stayed 1e-13 with the
classical models and 1e-7 with a network 2e-7, as long as it followed the truth. Where it does not
(`LOST`) only the order of an error comes out again."""

SQUARE = Tolerance("square of an analysis", relative=_CLOSE, lost=LostTolerance(factor=_FACTOR**2))
UNCERTAIN = Tolerance("value of an analysis, uncertain where it is lost", relative=_CLOSE)
"""The ratio of the largest accelerations is 1000 for a run that fails, and in a lost analysis
rounding decides whether it fails."""

SHARE = Tolerance("share in an analysis", absolute=_CLOSE, lost=LostTolerance(absolute=0.5))
"""One of 90 output steps, or of 64 points, may fall on the other side of a limit."""

GROWTH = Tolerance("growth of a share in an analysis", absolute=_CLOSE)

_metric: Any = partial(
    Metric,
    axis=NAME,
    by_group=True,
    undefined="the run ended early, so that its time says nothing",
)


def _statistic(name: str) -> Statistic:
    """The statistic that an attribute of `AnalysisErrors` holds."""
    return Statistic(name, lambda errors: getattr(errors, name))


METRICS: tuple[Metric, ...] = (
    _metric(
        name=REACTION, title="Reaction",
        definition="relative L2 error of the reaction over the output steps: root of the mean "
        "square of the error, each step's divided by the root mean square of the true curve",
        statistic=_statistic("reaction_error"), style="percent", tolerance=ANALYSIS,
    ),
    _metric(
        name="volumetric_strain_error", title="Volumetric strain",
        definition="the same of the global volumetric strain",
        statistic=_statistic("volumetric_strain_error"), style="percent", tolerance=ANALYSIS,
    ),
    _metric(
        name="point_stress_mse", title="Point stress MSE",
        definition="squared normalised error of the stress at the compared Gauss points, mean "
        "over components, points and output steps",
        statistic=_statistic("point_stress_mse"), tolerance=SQUARE,
    ),
    _metric(
        name=ERROR_POINTS, title="Error points",
        definition="share of the compared Gauss points with a relative stress error above 50 % "
        "(Sec 5.3), mean over output steps",
        statistic=_statistic("error_point_share"), style="percent", tolerance=SHARE,
    ),
    _metric(
        name="error_point_growth", title="Growth of error points",
        definition="slope of the line that fits this share against the share of the output steps, "
        "from 0 to 1; negative where error points grow fewer",
        statistic=_statistic("error_point_growth"), tolerance=GROWTH,
    ),
    _metric(
        name="acceleration_ratio", title="Acceleration ratio",
        definition="largest nodal acceleration over that with the ground truth, from 1/1000 to "
        "1000, which a run that fails counts as; of several analyses the geometric mean",
        statistic=_statistic("acceleration_ratio"), aggregation=GEOMETRIC_MEAN,
        direction="target 1", of_truth=1.0, parts=(f"{NAME}-{EXPLICIT}",), tolerance=UNCERTAIN,
    ),
    _metric(
        name=REACHED, title="Steps before failure",
        definition="share of the output steps before the first failure; 1 where there is none",
        statistic=_statistic("reached_share"), style="percent", direction="higher", of_truth=1.0,
        tolerance=SHARE,
    ),
    _metric(
        name="analysis_speed_ratio", title="Speed-up",
        definition="CPU time of the analysis with the ground truth over that with the model, each "
        "the fastest of up to three runs; of several analyses the geometric mean",
        statistic=_statistic("analysis_speed"), aggregation=GEOMETRIC_MEAN, direction="higher",
        of_truth=1.0, tolerance=CLOCK, style="speed-up",
    ),
    _metric(
        name="cell_speed_ratio", title="Speed-up of the cell",
        definition="the same of the time inside the cells alone",
        statistic=_statistic("cell_speed"), aggregation=GEOMETRIC_MEAN, direction="higher",
        of_truth=1.0, tolerance=CLOCK, style="speed-up",
    ),
)  # fmt: skip
"""The metrics in the order of the scorecard."""
