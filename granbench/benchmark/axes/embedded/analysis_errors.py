"""Analyses with a model against those with the ground truth, before they are averaged."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr

from granbench.benchmark.comparison import (
    CEILING,
    ERROR_POINT,
    clipped,
    quantise,
    relative_error,
)
from granbench.benchmark.metric import NotApplicable
from granbench.fem.statement import EXPLICIT

LARGEST_RATIO = 1e3
"""Largest ratio of accelerations and of CPU times that counts, and one over it the least; a body
that flies apart is no further off than that."""


@dataclass(frozen=True)
class AnalysisErrors:
    """Every analysis of one solver with a model, and with the ground truth.

    Statistics are (seed, analysis). What a run that failed did not reach counts as an error of
    `CEILING`, except where there is no truth either.

    Parameters
    ----------
    part : the predictions of one solver, with the analyses that are made with it
    solver : its name
    stress_scale : (component,), training standard deviation, Pa
    """

    part: xr.Dataset
    solver: str
    stress_scale: np.ndarray

    @cached_property
    def reached_share(self) -> np.ndarray:
        """Share of the output steps before the first failure."""
        return np.isfinite(_counted(self.part["embedded_reaction"])).mean(axis=-1)

    @property
    def reaction_error(self) -> np.ndarray:
        """Relative L2 error of the reaction."""
        return self._curve_error("reaction")

    @property
    def volumetric_strain_error(self) -> np.ndarray:
        """Relative L2 error of the global volumetric strain."""
        return self._curve_error("volumetric_strain")

    @property
    def point_stress_mse(self) -> np.ndarray:
        """Squared normalised error of the stress at the compared Gauss points."""
        predicted, true, known = self._pair("stress")  # (.., gauss_point, component, output)
        error = clipped(np.abs(predicted - true) / self.stress_scale[:, None]) ** 2
        return _mean(error.mean(axis=(-3, -2)), np.asarray(known.all(axis=(-3, -2))))

    @cached_property
    def error_points(self) -> np.ndarray:
        """Share of error points (seed, analysis, output); 0 where there is no truth."""
        predicted, true, known = self._pair("stress")
        labels = list(self.part["component"].values.astype(str))
        predicted, true = (np.moveaxis(values, -2, -1) for values in (predicted, true))
        broken = np.logical_not(np.isfinite(predicted).all(axis=-1))
        relative = relative_error(np.nan_to_num(predicted), true, labels, broken)
        there = known.all(axis=(-3, -2))
        return np.where(there, (relative > ERROR_POINT).mean(axis=-2), 0.0)

    @property
    def error_point_share(self) -> np.ndarray:
        """Mean of `error_points` over the output steps."""
        return self.error_points.mean(axis=-1)

    @property
    def error_point_growth(self) -> np.ndarray:
        """Least-squares slope of `error_points` against the share of the output steps."""
        shares = self.error_points
        steps = np.arange(1, shares.shape[-1] + 1) / shares.shape[-1]
        centred = steps - steps.mean()
        moment = (centred * (shares - shares.mean(axis=-1, keepdims=True))).sum(axis=-1)
        return moment / max((centred**2).sum(), np.finfo(float).tiny)

    @property
    def acceleration_ratio(self) -> np.ndarray:
        """Ratio of the largest accelerations; the largest that counts where a run did not end.

        Raises
        ------
        NotApplicable
            For the implicit solver, which has no accelerations.
        """
        if self.solver != EXPLICIT:
            raise NotApplicable("the implicit solver has no accelerations")
        predicted, true, known = self._pair("acceleration")
        largest = predicted.max(axis=-1, initial=0.0)
        reference = np.where(known, true, 0.0).max(axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(largest == reference, 1.0, largest / reference)
        return np.where(self._ended, _bounded(ratio), LARGEST_RATIO)

    @property
    def analysis_speed(self) -> np.ndarray:
        """CPU time with the ground truth over that with the model; NaN where a run ended early."""
        return self._speed("seconds")

    @property
    def cell_speed(self) -> np.ndarray:
        """The same of the time inside the cells alone."""
        return self._speed("cell_seconds")

    @property
    def _ended(self) -> np.ndarray:
        return self.reached_share == 1.0

    def _speed(self, variable: str) -> np.ndarray:
        true = self.part[f"embedded_truth_{variable}"].values.astype(np.float64)
        taken = self.part[f"embedded_{variable}"].values.astype(np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = _bounded(true / taken)
        return np.where(self._ended, ratio, np.nan)

    def _pair(self, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Predicted (seed, analysis, ...), true (analysis, ...), and where there is a truth."""
        predicted = _counted(self.part[f"embedded_{name}"])
        true = _counted(self.part[f"embedded_truth_{name}"])
        return predicted, np.nan_to_num(true), np.isfinite(true)

    def _curve_error(self, name: str) -> np.ndarray:
        predicted, true, known = self._pair(name)
        size = np.sqrt(_mean(true**2, known))[..., None]
        with np.errstate(divide="ignore", invalid="ignore"):
            error = np.abs(predicted - true)
            relative = np.where(error == 0.0, 0.0, error / size)
        return np.sqrt(_mean(clipped(relative) ** 2, known))


def _counted(variable: xr.DataArray) -> np.ndarray:
    """Quantised values of the output steps from 1 on; `output` is moved last."""
    outputs = variable.transpose(..., "output").values
    return quantise(outputs[..., 1:]).astype(np.float64)


def _bounded(ratio: np.ndarray) -> np.ndarray:
    return np.clip(ratio, 1.0 / LARGEST_RATIO, LARGEST_RATIO)


def _mean(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Mean over the output steps at which there is a truth."""
    weight = known / np.maximum(known.sum(axis=-1, keepdims=True), 1)
    return (weight * values).sum(axis=-1)


__all__ = ["CEILING", "LARGEST_RATIO", "AnalysisErrors"]
