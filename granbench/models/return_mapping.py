"""Common parts of return mappings: elastic trial, yield check, consistency equation.

Units and signs are those of the models: Pa, compression positive, rows (component, point).
"""

import math
from collections.abc import Callable

import torch

from granbench.models.arrays import (
    Array,
    addcmul,
    at_least,
    minimum,
    rounding_unit,
    where,
    zeros_like,
)
from granbench.models.components import TensorRows
from granbench.models.parameters import Constants

ROUNDINGS = 512.0
"""Unit roundings by which f may exceed zero before a point yields. A stress that was put on the
surface is off by a few of them, times its p/q: within, a zero increment changes no bit."""

PLAIN_ITERATIONS = 6
SAFE_ITERATIONS = 100
"""Bisection alone needs some 50 to reach the rounding of the bracket."""

LAST_STEP = 1e-6
"""Newton step, relative to the scale of x, after which none follows: the next would be of the
size of its square."""

Residual = Callable[[Array], tuple[Array, Array]]
"""Value and slope of a residual at x (point,)."""


def elastic_constants(bulk: Array, shear: Array, dimension: int) -> dict[str, Array]:
    """Constants of Hooke's law, Pa: `bulk`, `twice_shear` and Lame's `lame`."""
    twice_shear = 2.0 * shear
    return {"bulk": bulk, "twice_shear": twice_shear, "lame": bulk - twice_shear / dimension}


def elastic_trial(rows: TensorRows, stress: Array, dstrain: Array, c: Constants) -> Array:
    """Stress (component, point) if the strain increment were elastic; exact where it is zero.

    Parameters
    ----------
    stress, dstrain : (component, point)
    c : has the `elastic_constants`
    """
    trial = addcmul(stress, dstrain, c.twice_shear)
    return rows.shifted(trial, c.lame * rows.trace(dstrain))


def exceeds(value: Array, limit: Array, scale: Array) -> Array:
    """Whether `value` (point,) exceeds `limit` by more than the rounding of `scale`."""
    return value > limit + (ROUNDINGS * rounding_unit(value)) * scale


def consistent_root(
    residual: Residual, sought: Array, start: Array, upper: Array, scale: Array
) -> Array:
    """Root x in [0, upper] of a consistency equation, point by point.

    Newton's method without gradients; where it does not arrive in a few iterations, Newton's
    method safeguarded by bisection. Where gradients are wanted, one more evaluation gives the
    root its derivative -(dr/dtheta)/(dr/dx) by the implicit function theorem.

    Parameters
    ----------
    residual : r and dr/dx at x; where the root is sought, r > 0 at 0 and r <= 0 at `upper`
    sought : (point,), whether a root is sought; elsewhere x is zero
    start : (point,), first x; it may lie outside
    upper : (point,)
    scale : (point,), above zero, against which a step is small

    Returns
    -------
    (point,), NaN where no root was found
    """
    if not torch.is_grad_enabled():
        return where(sought, _newton(residual, sought, start, upper, scale), 0.0)
    with torch.no_grad():
        x = _newton(residual, sought, start.detach(), upper.detach(), scale.detach())
    r, slope = residual(x)
    x = x - (r - r.detach()) / slope.detach()  # the value of x, to the last bit
    return where(sought, x, 0.0)


def _newton(residual: Residual, sought: Array, start: Array, upper: Array, scale: Array) -> Array:
    x = minimum(at_least(start, 0.0), upper)
    for _ in range(PLAIN_ITERATIONS):
        r, slope = residual(x)
        closer = minimum(at_least(x - r / slope, 0.0), upper)
        change = abs((closer - x) / scale).max()
        x = closer
        # Where nothing is sought r < 0: x stays zero.
        if change <= LAST_STEP:
            return x
    return _safeguarded(residual, sought, upper, scale)


def _safeguarded(residual: Residual, sought: Array, upper: Array, scale: Array) -> Array:
    x = low = zeros_like(upper)
    high = upper
    for _ in range(SAFE_ITERATIONS):
        r, slope = residual(x)
        low, high = where(r > 0.0, x, low), where(r > 0.0, high, x)
        newton = x - r / slope
        inside = (newton >= low) & (newton <= high)
        closer = where(inside, newton, 0.5 * (low + high))
        unsolved = sought & (abs(closer - x) > LAST_STEP * scale)
        x = where(sought, closer, 0.0)
        if not unsolved.any():
            return x
    return where(unsolved, math.nan, x)
