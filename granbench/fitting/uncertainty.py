"""How well the data determine the parameters: identifiability, intervals, correlations."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from granbench.fitting.least_squares import LeastSquares
from granbench.fitting.optimisation import FARTHEST, Effort, levenberg_marquardt
from granbench.fitting.test_batch import TestBatch

Floats = NDArray[np.float64]

COVERAGE = 0.95
NORMAL_QUANTILE = 1.959964
"""Quantile of the standard normal distribution at 97.5 %."""

FLAT_ERROR = 1e-4
FLAT_SHARE = 0.1
"""A direction is flat where a step of one, a factor e of a positive parameter, would change the
curves by less than 0.01 % of their range, or less than a tenth of the remaining error."""

INVOLVED = 0.3
"""Entry in a flat direction from which a parameter counts as not identifiable."""


@dataclass(frozen=True)
class Identifiability:
    """Identifiability of parameters by the singular values of the scaled Jacobian.

    Parameters
    ----------
    names : of the parameters
    effects : (direction,), root-mean-square change of the curves, in ranges, per unit step along
        each right singular vector, largest first
    directions : (direction, parameter), the right singular vectors, of the unconstrained numbers
    threshold : effect below which a direction is flat
    identifiable : whether each parameter is, by name
    """

    names: tuple[str, ...]
    effects: Floats
    directions: Floats
    threshold: float
    identifiable: dict[str, bool]

    @classmethod
    def of(
        cls, names: Sequence[str], jacobian: Tensor, tests: int, error: float
    ) -> "Identifiability":
        """Analyse a Jacobian (residual, parameter) of `tests` tests whose fit error is `error`."""
        # The squares of a test's residual weights sum to one, so this is a mean over tests.
        _, values, vectors = torch.linalg.svd(jacobian / tests**0.5, full_matrices=False)
        effects, directions = values.numpy(), vectors.numpy()
        threshold = max(FLAT_ERROR, FLAT_SHARE * error)
        flat = directions[effects < threshold]
        blurred = np.abs(flat).max(axis=0, initial=0.0) >= INVOLVED
        identifiable = {name: not bad for name, bad in zip(names, blurred.tolist(), strict=True)}
        return cls(tuple(names), effects, directions, threshold, identifiable)


@dataclass(frozen=True)
class Uncertainty:
    """Spread of the unconstrained parameters.

    Parameters
    ----------
    method : `laplace` or `bootstrap`
    low, high : (parameter,), ends of the 95 % intervals
    correlation : (parameter, parameter); NaN where the curvature is so small that it is unknown
    samples : (sample, parameter) of a bootstrap, else none
    """

    method: str
    low: Tensor
    high: Tensor
    correlation: Floats
    samples: Tensor | None = None


def laplace(
    vector: Tensor, residual: Tensor, jacobian: Tensor, batches: Sequence[TestBatch]
) -> Uncertainty:
    """Intervals from the curvature at the minimum: covariance = r^T r/(n - parameters) (J^T J)^-1.

    Errors of neighbouring points are correlated, because a model error extends over many points; so
    n counts independent points only, see `independent_points`.

    Parameters
    ----------
    vector : (parameter,), the minimum
    residual : (residual,)
    jacobian : (residual, parameter)
    batches : of the residuals
    """
    count = sum(independent_points(series) for series in _series(residual, batches))
    variance = float((residual**2).sum()) / max(count - len(vector), 1.0)
    squares, directions = torch.linalg.eigh(jacobian.T @ jacobian)
    # A direction without effect has no finite interval; rounding would give a wrong one.
    squares = squares.clamp(min=1e-15 * squares[-1].clamp(min=torch.finfo(squares.dtype).tiny))
    covariance = variance * (directions / squares) @ directions.T
    deviation = covariance.diagonal().sqrt()
    half = NORMAL_QUANTILE * deviation
    return Uncertainty(
        "laplace",
        (vector - half).clamp(min=-FARTHEST),
        (vector + half).clamp(max=FARTHEST),
        _normalised(covariance),
    )


def bootstrap(
    problem: LeastSquares, vector: Tensor, residual: Tensor, count: int, seed: int, effort: Effort
) -> Uncertainty:
    """Intervals from fits to resampled errors, all in one batch.

    Each sample is the prediction plus the errors of the fit in another order: moving blocks of the
    length of the correlation, drawn with replacement within each test and quantity.

    Parameters
    ----------
    problem : of the fit
    vector : (parameter,), its minimum
    residual : (residual,) there
    count : of samples
    seed : of the draws
    effort : of each fit, which starts from the minimum

    References
    ----------
    Kuensch (1989), Ann. Statist. 17(3): the moving-block bootstrap.
    """
    generator = np.random.default_rng(seed)
    drawn = torch.from_numpy(
        np.stack([_resampled(residual, problem.batches, generator) for _ in range(count)])
    )
    found = levenberg_marquardt(
        problem, vector.repeat(count, 1), effort, offset=drawn - residual
    ).vectors
    tail = (1.0 - COVERAGE) / 2.0
    low, high = torch.quantile(found, torch.tensor([tail, 1.0 - tail]).double(), dim=0)
    covariance = torch.cov(found.T).reshape(len(vector), len(vector))
    return Uncertainty("bootstrap", low, high, _normalised(covariance), found)


def _resampled(
    residual: Tensor, batches: Sequence[TestBatch], generator: np.random.Generator
) -> Floats:
    """The residuals with the errors of every series in moving blocks of another order."""
    parts, start = [], 0
    for batch in batches:
        shape = batch.weight.shape
        weight = batch.residual_weight.numpy()
        part = residual[start : start + batch.weight.numel()].reshape(shape).numpy()
        start += batch.weight.numel()
        mixed = np.zeros(shape)
        for test, quantity in np.ndindex(shape[0], shape[2]):
            known = np.flatnonzero(weight[test, :, quantity])
            if known.size:
                errors = part[test, known, quantity] / weight[test, known, quantity]
                blocks = _moving_blocks(errors - errors.mean(), generator)
                mixed[test, known, quantity] = weight[test, known, quantity] * blocks
        parts.append(mixed.ravel())
    return np.concatenate(parts)


def _moving_blocks(errors: Floats, generator: np.random.Generator) -> Floats:
    length = min(max(1, round(len(errors) / independent_points(errors))), max(1, len(errors) // 3))
    starts = generator.integers(0, len(errors) - length + 1, -(-len(errors) // length))
    return np.concatenate([errors[at : at + length] for at in starts])[: len(errors)]


def _series(residual: Tensor, batches: Sequence[TestBatch]) -> Iterator[Floats]:
    """The residuals of every test and quantity, (point,), at measured points."""
    start = 0
    for batch in batches:
        part = residual[start : start + batch.weight.numel()].reshape(batch.weight.shape)
        start += batch.weight.numel()
        for test, quantity in np.ndindex(part.shape[0], part.shape[2]):
            yield part[test, batch.weight[test, :, quantity] > 0.0, quantity].numpy()


def _normalised(covariance: Tensor) -> Floats:
    deviation = covariance.diagonal().clamp(min=0.0).sqrt()
    scale = torch.where(deviation > 0.0, deviation, 1.0)
    correlation = covariance / torch.outer(scale, scale)
    return torch.where(correlation.isfinite(), correlation, torch.nan).numpy()


def independent_points(series: Floats) -> float:
    """Equivalent number of independent points of a series (point,) of errors, at least one."""
    if len(series) < 3:
        return float(len(series))
    squares = float(np.dot(series, series))
    rho = float(np.dot(series[1:], series[:-1])) / squares if squares > 0.0 else 0.0
    rho = min(max(rho, 0.0), 1.0 - 1.0 / len(series))
    return len(series) * (1.0 - rho) / (1.0 + rho)
