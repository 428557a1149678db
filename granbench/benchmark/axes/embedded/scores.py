"""Scores of the embedded axis: analyses with a model against those with the ground truth."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr

from granbench.benchmark.applicability import embedded_obstacle
from granbench.benchmark.axes.embedded.metrics import (
    EMBEDDED_METRICS,
    LARGEST_RATIO,
    SPEED,
    EmbeddedMetric,
)
from granbench.benchmark.predictions import EMBEDDED_OBSTACLE, quantise
from granbench.benchmark.protocols import EMBEDDED
from granbench.benchmark.scorecard import ALL, Curve, Score, rounded
from granbench.benchmark.statistics import CEILING, ERROR_POINT, relative_error
from granbench.data.normalisation import Normalisation
from granbench.errors import SubmissionError
from granbench.fem.statement import EXPLICIT, SOLVERS, EmbeddedAnalysis

Values = dict[str, np.ndarray]
"""By metric: (seed, analysis); NaN where it does not apply."""


def embedded_scores(
    predictions: xr.Dataset,
    truth: xr.Dataset,
    normalisation: Normalisation,
    reads: bool,
    analyses: Sequence[EmbeddedAnalysis],
) -> tuple[list[Score], list[Curve]]:
    """Every score and curve of the axis on a task that has analyses; nothing on any other.

    Parameters
    ----------
    predictions : see `granbench.benchmark.predictions`
    truth : the scored records
    normalisation : training standard deviations
    reads : whether the model is the ceiling, see `granbench.benchmark.applicability.reads_records`
    analyses : of the task

    Raises
    ------
    SubmissionError
        If the predictions excuse a model to which the axis applies, hold other analyses than the
        task has, or lack a response.
    """
    if not analyses:
        return [], []
    if EMBEDDED_OBSTACLE not in predictions.attrs:
        reason = f"axis {EMBEDDED} was left out of the evaluation"
        return list(_without(analyses, "not_run", reason)), []
    obstacle = embedded_obstacle(truth, reads)
    if obstacle is not None:
        return list(_without(analyses, "not_applicable", obstacle)), []
    if predictions.attrs[EMBEDDED_OBSTACLE] != "":
        raise SubmissionError(
            "the predictions say that the embedded axis does not apply to a model that computes "
            "its answers; run `granbench evaluate` again"
        )
    _check(predictions, truth, analyses)
    scores: list[Score] = []
    curves: list[Curve] = []
    for solver in SOLVERS:
        inside = [a.name for a in analyses if solver in a.solvers]
        if not inside:
            continue
        part = predictions.sel(solver=solver, analysis=inside)
        shares = _error_points(part)
        values = _values(part, normalisation, shares, solver)
        scores += _scores(solver, inside, values)
        curves += _curves(solver, inside, shares)
    return scores, curves


def _without(analyses: Sequence[EmbeddedAnalysis], status: str, reason: str) -> Iterator[Score]:
    for solver in SOLVERS:
        inside = [a.name for a in analyses if solver in a.solvers]
        for group in _groups(inside):
            for metric in _metrics(solver):
                place = _place(solver, group, metric, inside)
                yield Score(**place, status=status, reason=reason)


def _groups(names: Sequence[str]) -> Sequence[str]:
    return (ALL, *names) if names else ()


def _metrics(solver: str) -> list[EmbeddedMetric]:
    return [m for m in EMBEDDED_METRICS.values() if solver == EXPLICIT or not m.explicit_only]


def _place(solver: str, group: str, metric: EmbeddedMetric, names: Sequence[str]) -> dict[str, Any]:
    return {
        "axis": EMBEDDED, "protocol": f"{EMBEDDED}-{solver}", "split": ALL, "group": group,
        "metric": metric.name, "n": len(names) if group == ALL else 1,
    }  # fmt: skip


def _scores(solver: str, names: Sequence[str], values: Values) -> Iterator[Score]:
    """Of every analysis, and the mean over them."""
    for group in _groups(names):
        for metric in _metrics(solver):
            place = _place(solver, group, metric, names)
            found = values[metric.name]
            found = found if group == ALL else found[:, [names.index(group)]]
            if not np.isfinite(found).all():
                reason = "the run ended early, so that its time says nothing"
                yield Score(**place, status="not_applicable", reason=reason)
                continue
            by_seed = _geometric_mean(found) if metric.ratio else found.mean(axis=1)
            yield Score(
                **place,
                status="scored",
                value=rounded(by_seed.mean()),
                by_seed=tuple(rounded(value) for value in by_seed),
            )


def _geometric_mean(ratios: np.ndarray) -> np.ndarray:
    """Over the analyses, (seed,); exactly 1 where all are."""
    return np.exp(np.log(ratios).mean(axis=1))


def _curves(solver: str, names: Sequence[str], shares: np.ndarray) -> Iterator[Curve]:
    """Error points against the output step, mean over seeds, of every analysis."""
    for index, name in enumerate(names):
        share = shares[:, index].mean(axis=0)
        yield Curve(
            protocol=f"{EMBEDDED}-{solver}",
            split=ALL,
            group=name,
            metric="error_point_share",
            n=1,
            horizon=tuple(range(1, len(share) + 1)),
            value=tuple(rounded(value) for value in share),
        )


def _values(
    part: xr.Dataset, normalisation: Normalisation, shares: np.ndarray, solver: str
) -> Values:
    reaction = _counted(part["embedded_reaction"])
    reached = np.isfinite(reaction).mean(axis=-1)
    values = {
        name: _curve_error(part, variable)
        for name, variable in (
            ("reaction_error", "reaction"),
            ("volumetric_strain_error", "volumetric_strain"),
        )
    }
    values["point_stress_mse"] = _point_stress_mse(part, normalisation)
    values["error_point_share"] = shares.mean(axis=-1)
    values["error_point_growth"] = _slope(shares)
    if solver == EXPLICIT:
        values["acceleration_ratio"] = _acceleration_ratio(part, reached == 1.0)
    values["reached_share"] = reached
    ended = reached == 1.0
    for name, variable in (("analysis", "seconds"), ("cell", "cell_seconds")):
        true = part[f"embedded_truth_{variable}"].values.astype(np.float64)
        taken = part[f"embedded_{variable}"].values.astype(np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = _bounded(true / taken)
        values[f"{name}_{SPEED}"] = np.where(ended, ratio, np.nan)
    return values


def _counted(variable: xr.DataArray) -> np.ndarray:
    """Quantised values of the output steps from 1 on; `output` is moved last."""
    outputs = variable.transpose(..., "output").values
    return quantise(outputs[..., 1:]).astype(np.float64)


def _pair(part: xr.Dataset, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Predicted (seed, analysis, ...), true (analysis, ...), and where there is a truth."""
    predicted = _counted(part[f"embedded_{name}"])
    true = _counted(part[f"embedded_truth_{name}"])
    return predicted, np.nan_to_num(true), np.isfinite(true)


def _curve_error(part: xr.Dataset, name: str) -> np.ndarray:
    """Relative L2 error (seed, analysis) of a curve."""
    predicted, true, known = _pair(part, name)
    size = np.sqrt(_mean(true**2, known))[..., None]
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.abs(predicted - true)
        relative = np.where(error == 0.0, 0.0, error / size)
    return np.sqrt(_mean(_clipped(relative) ** 2, known))


def _point_stress_mse(part: xr.Dataset, normalisation: Normalisation) -> np.ndarray:
    """Squared normalised error (seed, analysis) at the Gauss points."""
    predicted, true, known = _pair(part, "stress")  # (.., gauss_point, component, output)
    scale = normalisation.std["stress"][:, None]
    error = _clipped(np.abs(predicted - true) / scale) ** 2
    return _mean(error.mean(axis=(-3, -2)), np.asarray(known.all(axis=(-3, -2))))


def _error_points(part: xr.Dataset) -> np.ndarray:
    """Share of error points (seed, analysis, output); 0 where there is no truth."""
    predicted, true, known = _pair(part, "stress")
    labels = list(part["component"].values.astype(str))
    predicted, true = (np.moveaxis(values, -2, -1) for values in (predicted, true))
    broken = np.logical_not(np.isfinite(predicted).all(axis=-1))
    relative = relative_error(np.nan_to_num(predicted), true, labels, broken)
    there = known.all(axis=(-3, -2))
    return np.where(there, (relative > ERROR_POINT).mean(axis=-2), 0.0)


def _slope(shares: np.ndarray) -> np.ndarray:
    """Least-squares slope of shares (.., output) against the share of the output steps."""
    steps = np.arange(1, shares.shape[-1] + 1) / shares.shape[-1]
    centred = steps - steps.mean()
    moment = (centred * (shares - shares.mean(axis=-1, keepdims=True))).sum(axis=-1)
    return moment / max((centred**2).sum(), np.finfo(float).tiny)


def _acceleration_ratio(part: xr.Dataset, ended: np.ndarray) -> np.ndarray:
    """Ratio (seed, analysis) of the largest accelerations; the cap where a run did not end."""
    predicted, true, known = _pair(part, "acceleration")
    largest = predicted.max(axis=-1, initial=0.0)
    reference = np.where(known, true, 0.0).max(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(largest == reference, 1.0, largest / reference)
    return np.where(ended, _bounded(ratio), LARGEST_RATIO)


def _bounded(ratio: np.ndarray) -> np.ndarray:
    return np.clip(ratio, 1.0 / LARGEST_RATIO, LARGEST_RATIO)


def _clipped(error: np.ndarray) -> np.ndarray:
    """Errors of at most `CEILING`, which what is missing counts as."""
    return np.minimum(np.nan_to_num(error, nan=CEILING, posinf=CEILING), CEILING)


def _mean(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Mean over the output steps at which there is a truth."""
    weight = known / np.maximum(known.sum(axis=-1, keepdims=True), 1)
    return (weight * values).sum(axis=-1)


def _check(
    predictions: xr.Dataset, truth: xr.Dataset, analyses: Sequence[EmbeddedAnalysis]
) -> None:
    """Refuse predictions of other analyses than the task has."""
    expected: dict[str, list[Any]] = {
        "solver": list(SOLVERS),
        "analysis": [analysis.name for analysis in analyses],
        "output": list(range(analyses[0].outputs + 1)),
        "gauss_point": list(range(analyses[0].points)),
        "component": list(truth["component"].values),
    }
    for label, wanted in expected.items():
        if label not in predictions.coords or list(predictions[label].values) != wanted:
            raise SubmissionError(
                f"the predictions' {label} labels are not those of the embedded analyses of "
                f"{truth.attrs.get('dataset', 'the dataset')}; run `granbench evaluate` again"
            )
    for name in ("reaction", "volumetric_strain", "acceleration", "stress", "seconds",
                 "cell_seconds"):  # fmt: skip
        for variable in (f"embedded_{name}", f"embedded_truth_{name}"):
            if variable not in predictions:
                raise SubmissionError(
                    f"the predictions lack {variable!r}; run `granbench evaluate` again"
                )
