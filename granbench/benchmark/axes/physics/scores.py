"""Scores of the physics axis: from the responses to the checks to violations."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from granbench.benchmark.applicability import physics_obstacles
from granbench.benchmark.axes.physics.checks import CHECKED_STRAIN, CHECKS, Check, checked_paths
from granbench.benchmark.bootstrap import Resampling
from granbench.benchmark.metrics import PHYSICS_METRICS, TANGENT_METRICS, Metric
from granbench.benchmark.predictions import PHYSICS_OBSTACLES
from granbench.benchmark.reduction import Paths, not_applicable, not_run, reduced
from granbench.benchmark.scorecard import ALL, Score
from granbench.benchmark.statistics import CEILING
from granbench.data.normalisation import Normalisation
from granbench.errors import SubmissionError
from granbench.tensors import component_order, normal_mask

TANGENT = "tangent"
_RESPONSE = {
    TANGENT: "tangent_error", "dissipation": "cycle_work", "compression": "tension_share",
}  # fmt: skip
"""Variable that holds the response to a check; that of the others is `stress_change`."""


@dataclass(frozen=True)
class PhysicsStatistics:
    """Violations of every checked path.

    Parameters
    ----------
    records : the checked paths
    violations : of each check that applies, (seed, path), dimensionless, at most `CEILING`, which
        is also what a breakdown counts as
    kink_share : (seed, path), see `granbench.benchmark.axes.physics.tangent`; None where it was not
    measured obstacles : why the other checks do not apply
    """

    records: xr.Dataset
    violations: Mapping[str, np.ndarray] = field(default_factory=dict)
    kink_share: np.ndarray | None = None
    obstacles: Mapping[str, str] = field(default_factory=dict)


def physics_statistics(
    predictions: xr.Dataset, truth: xr.Dataset, normalisation: Normalisation, reads: bool
) -> PhysicsStatistics:
    """Violations from the stored responses; none where the axis was left out.

    Parameters
    ----------
    predictions : see `granbench.benchmark.predictions`
    truth : the scored records, in the order of the predictions
    normalisation : training standard deviations
    reads : whether the model is the ceiling, see `granbench.benchmark.applicability.reads_records`

    Raises
    ------
    SubmissionError
        If other paths were checked than the benchmark checks, a response is missing, or a check is
        left out that applies.
    """
    records = truth.isel(path=checked_paths(truth))
    if PHYSICS_OBSTACLES not in predictions.attrs:
        return PhysicsStatistics(records)
    obstacles = physics_obstacles(predictions, truth, reads)
    applicable = [name for name in CHECKS if name not in obstacles]
    if applicable:
        _check_paths(predictions, records)
    violations = {
        name: _clipped(_violation(name, predictions, records, normalisation)) for name in applicable
    }
    kinks = predictions.get("kink_share")
    return PhysicsStatistics(
        records, violations, None if kinks is None else _clipped(kinks.values), obstacles
    )


def physics_scores(statistics: PhysicsStatistics, split: str) -> list[Score]:
    """Every score of the checked paths of one split."""
    inside = np.flatnonzero(statistics.records["split"].values.astype(str) == split)
    specimens = statistics.records["specimen"].values[inside]
    paths = Paths(split, ALL, len(inside), Resampling.by_specimen(specimens))
    return [
        _score(statistics, check, metric, paths, inside)
        for check in CHECKS.values()
        for metric in PHYSICS_METRICS + (TANGENT_METRICS if check.name == TANGENT else ())
    ]


def _score(
    statistics: PhysicsStatistics, check: Check, metric: Metric, paths: Paths, inside: np.ndarray
) -> Score:
    if check.name in statistics.obstacles:
        return not_applicable(check, metric, paths, statistics.obstacles[check.name])
    if check.name not in statistics.violations:
        return not_run(check, metric, paths)
    values = statistics.violations[check.name]
    if metric.statistic == "violated":
        values = (values > check.tolerance).astype(np.float64)
    elif metric.statistic == "kink_share" and statistics.kink_share is not None:
        values = statistics.kink_share
    return reduced(check, metric, paths, values[:, inside])


def _check_paths(predictions: xr.Dataset, records: xr.Dataset) -> None:
    expected = [str(name) for name in records["path_id"].values]
    if "checked_path" not in predictions.coords or expected != [
        str(name) for name in predictions["checked_path"].values
    ]:
        raise SubmissionError(
            "the physics checks were not made on the paths that the benchmark checks; run "
            "`granbench evaluate` again"
        )


def _violation(
    name: str, predictions: xr.Dataset, records: xr.Dataset, normalisation: Normalisation
) -> np.ndarray:
    """Violations (seed, path), NaN where the model broke down."""
    variable = _RESPONSE.get(name, "stress_change")
    missing = variable not in predictions or (
        variable == "stress_change" and name not in predictions["check"].values
    )
    if missing:
        raise SubmissionError(
            f"the predictions lack the response to the check {name!r}; run `granbench evaluate` "
            "again"
        )
    response = predictions[variable]
    order = component_order(tuple(map(str, records["component"].values)))
    count = 2.0 - np.asarray(normal_mask(order))  # a shear component stands twice in the tensor
    if variable == "stress_change":
        change = response.sel(check=name).values.astype(np.float64)
        if name.startswith("substeps"):
            std = normalisation.std
            stiffness = _norm(std["stress"], count) / _norm(std["strain"], count)
            return _norm(change, count) / (stiffness * CHECKED_STRAIN)
        return np.max(np.abs(change) / normalisation.std["stress"], axis=-1)
    if name == "dissipation":
        # Against a stress of one standard deviation along the path and back.
        strain = records["strain"].values.astype(np.float64)
        length = 2.0 * np.abs(np.diff(strain, axis=1)).sum(axis=1)
        scale = (count * normalisation.std["stress"] * length).sum(axis=-1)
        return np.maximum(-response.values.astype(np.float64), 0.0) / scale
    return response.values.astype(np.float64)


def _norm(components: np.ndarray, count: np.ndarray) -> np.ndarray:
    return np.sqrt((count * components**2).sum(axis=-1))


def _clipped(violation: np.ndarray) -> np.ndarray:
    return np.minimum(np.nan_to_num(violation, nan=CEILING, posinf=CEILING), CEILING)
