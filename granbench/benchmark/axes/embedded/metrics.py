"""What is scored of an analysis with a model in place of the ground truth."""

from dataclasses import dataclass

from granbench.fem.statement import SOLVERS

TITLES = {solver: f"Embedded, {solver}" for solver in SOLVERS}
"""Of the protocols of this axis, for people."""

LARGEST_RATIO = 1e3
"""Of accelerations and CPU times, and one over it the least; a body that flies apart is no further
off than that."""

SPEED = "speed_ratio"
"""Ends the metrics that are measured with a clock."""


@dataclass(frozen=True)
class EmbeddedMetric:
    """One metric of an analysis.

    Parameters
    ----------
    name : as in the files
    title : for people
    definition : in one sentence
    error : whether the ground truth itself has exactly zero
    ratio : whether it is a ratio to the ground truth, of which the mean is the geometric one
    percent : whether it is shown in per cent
    explicit_only : whether only the explicit solver has it
    """

    name: str
    title: str
    definition: str
    error: bool = True
    ratio: bool = False
    percent: bool = False
    explicit_only: bool = False


EMBEDDED_METRICS: dict[str, EmbeddedMetric] = {
    metric.name: metric
    for metric in (
        EmbeddedMetric(
            "reaction_error",
            "Reaction",
            "relative L2 error of the reaction over the output steps: root of the mean square of "
            "the error, each step's divided by the root mean square of the true curve",
            percent=True,
        ),
        EmbeddedMetric(
            "volumetric_strain_error",
            "Volumetric strain",
            "the same of the global volumetric strain",
            percent=True,
        ),
        EmbeddedMetric(
            "point_stress_mse",
            "Point stress MSE",
            "squared normalised error of the stress at the compared Gauss points, mean over "
            "components, points and output steps",
        ),
        EmbeddedMetric(
            "error_point_share",
            "Error points",
            "share of the compared Gauss points with a relative stress error above 50 % "
            "(Sec 5.3), mean over output steps",
            percent=True,
        ),
        EmbeddedMetric(
            "error_point_growth",
            "Growth of error points",
            "slope of the line that fits this share against the share of the output steps, from "
            "0 to 1; negative where error points grow fewer",
        ),
        EmbeddedMetric(
            "acceleration_ratio",
            "Acceleration ratio",
            "largest nodal acceleration over that with the ground truth, from 1/1000 to 1000, "
            "which a run that fails counts as; of several analyses the geometric mean",
            error=False,
            ratio=True,
            explicit_only=True,
        ),
        EmbeddedMetric(
            "reached_share",
            "Steps before failure",
            "share of the output steps before the first failure; 1 where there is none",
            error=False,
            percent=True,
        ),
        EmbeddedMetric(
            f"analysis_{SPEED}",
            "Speed-up",
            "CPU time of the analysis with the ground truth over that with the model, each the "
            "fastest of up to three runs; of several analyses the geometric mean",
            error=False,
            ratio=True,
        ),
        EmbeddedMetric(
            f"cell_{SPEED}",
            "Speed-up of the cell",
            "the same of the time inside the cells alone",
            error=False,
            ratio=True,
        ),
    )
}
