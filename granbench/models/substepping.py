r"""Error-controlled integration of rate equations, batched, each point with its own steps.

A model gives one function that integrates a piece of the increment and estimates its error. All
points first try the whole increment; those that miss the tolerance are gathered and
go on in pieces of their own size,

    s <- s min(4, max(0.1, 0.9 (tolerance / error)^(1/3))),

until each has come to the end of its pseudo-time 0 ... 1. Sizes are chosen without gradients; with
gradients, exactly the accepted pieces are then done again, so that what was rejected (and may
be NaN) never touches them.

References
----------
Sloan, S. W., Abbo, A. J. & Sheng, D. (2001), Refined explicit integration of elastoplastic models
with automatic error control, Engineering Computations 18:121-194. The pair of orders 2 and 3 is
Fehlberg's RK2(3) (Hairer, Norsett & Wanner 1993, Sec II.4), whose third-order part is
Shu & Osher's.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import torch

from granbench.cells.work_budget import spend
from granbench.models.arrays import (
    Array,
    between,
    full_like,
    gradients_wanted,
    isfinite,
    isnan,
    places,
    replaced,
    where,
    zeros_like,
)

Constants = TypeVar("Constants", bound=tuple[Array, ...])

SAFETY = 0.9
LEAST_FACTOR = 0.1
LARGEST_FACTOR = 4.0
"""Bounds of the ratio of one piece to the one before."""


class Attempt(NamedTuple):
    """A piece of an increment, tried.

    Parameters
    ----------
    state : (n_state, point), after the piece
    error : (point,), without gradient, relative; not finite where the piece is impossible
    """

    state: Array
    error: Array


@dataclass(frozen=True)
class Substepping:
    """Settings of substepping.

    Parameters
    ----------
    tolerance : of the error of one piece
    most : attempts that a point may need in one increment; beyond them its state becomes NaN
    smallest : piece that is never gone below, as a share of the increment
    """

    tolerance: float = 3e-4
    most: int = 2000
    smallest: float = 1e-10


@dataclass(frozen=True)
class _Piece:
    """An accepted piece of some points: their places among those that are cut, and its size."""

    points: Array
    size: Array


Advance = Callable[[Array, Array, Constants], Attempt]


def substepped(
    advance: Advance[Constants],
    dstrain: Array,
    state: Array,
    constants: Constants,
    settings: Substepping,
) -> Array:
    """State after a strain increment, each point in as many pieces as its error asks for.

    Parameters
    ----------
    advance : tries a piece: (strain, state, constants) -> `Attempt`
    dstrain : (component, point)
    state : (n_state, point)
    constants : a named tuple of tensors () or (point,)
    settings : tolerance and limits

    Returns
    -------
    (n_state, point), differentiable; NaN where a point could not be followed
    """
    wanted = gradients_wanted(dstrain, state, *constants)
    with torch.no_grad():
        whole = advance(dstrain, state, constants)
        rejected = ~(whole.error <= settings.tolerance)
        if rejected.any():
            cut = places(rejected)
            of_cut = (dstrain[:, cut], state[:, cut], taken(constants, cut))
            end, pieces = _cut(advance, *of_cut, whole.error[cut], settings)
        elif not wanted:
            return whole.state
    if not wanted:
        return replaced(whole.state, cut, end)
    if not rejected.any():
        return advance(dstrain, state, constants).state
    kept = places(~rejected)
    of_kept = (dstrain[:, kept], state[:, kept], taken(constants, kept))
    of_cut = (dstrain[:, cut], state[:, cut], taken(constants, cut))
    again = _again(advance, *of_cut, pieces)
    again = where(isnan(end), end, again)
    both = torch.cat([advance(*of_kept).state, again], dim=1)
    return both[:, torch.argsort(torch.cat([kept, cut]))]


def taken(constants: Constants, points: Array) -> Constants:
    """The constants of some points; those that all points share stay as they are."""
    return type(constants)(*(value[points] if value.ndim else value for value in constants))


def _cut(
    advance: Advance[Constants],
    dstrain: Array,
    state: Array,
    constants: Constants,
    error: Array,
    settings: Substepping,
) -> tuple[Array, list[_Piece]]:
    """End states of points whose whole increment was rejected, and their accepted pieces."""
    end = full_like(state, math.nan)
    pieces: list[_Piece] = []
    points = isfinite(dstrain).all(0) & isfinite(state).all(0)
    points = places(points)
    dstrain, state = dstrain[:, points], state[:, points]
    constants, error = taken(constants, points), error[points]
    time = zeros_like(error)
    size = _factor(error, settings)
    for _ in range(settings.most):
        if not len(points):
            break
        spend()
        left = 1.0 - time
        last = size >= left
        size = where(last, left, size)
        attempt = advance(dstrain * size, state, constants)
        accepted = attempt.error <= settings.tolerance
        pieces.append(_Piece(points[accepted], size[accepted]))
        state = where(accepted, attempt.state, state)
        time = where(accepted, time + size, time)
        size = size * _factor(attempt.error, settings)
        finished = accepted & last
        going = ~finished & (size > settings.smallest)
        if not going.all():
            end[:, points[finished]] = state[:, finished]
            still = places(going)
            dstrain, state, points = dstrain[:, still], state[:, still], points[still]
            constants, time, size = taken(constants, still), time[still], size[still]
    return end, pieces


def _factor(error: Array, settings: Substepping) -> Array:
    """Size of the next piece relative to one of that error; the least for an impossible one."""
    factor = SAFETY * (settings.tolerance / error) ** (1.0 / 3.0)
    return between(where(isnan(factor), 0.0, factor), LEAST_FACTOR, LARGEST_FACTOR)


def _again(
    advance: Advance[Constants],
    dstrain: Array,
    state: Array,
    constants: Constants,
    pieces: list[_Piece],
) -> Array:
    """The accepted pieces once more, with gradients."""
    for piece in pieces:
        if len(piece.points) == state.shape[1]:
            state = advance(dstrain * piece.size, state, constants).state
        elif len(piece.points):
            chosen = piece.points
            strain = dstrain[:, chosen] * piece.size
            after = advance(strain, state[:, chosen], taken(constants, chosen)).state
            state = replaced(state, chosen, after)
    return state


class EmbeddedStep(NamedTuple):
    """A Runge-Kutta step with its error.

    Parameters
    ----------
    end : (variable, point), of order 3
    error : (variable, point), its difference from the result of order 2
    stages : the three states at which rates were taken
    rates : the three rates
    """

    end: Array
    error: Array
    stages: tuple[Array, Array, Array]
    rates: tuple[Array, Array, Array]


def runge_kutta(rate: Callable[[float, Array], Array], start: Array) -> EmbeddedStep:
    """One step of the Runge-Kutta pair of orders 2 and 3 over pseudo-time 0 ... 1.

    Parameters
    ----------
    rate : (pseudo-time, state) -> its rate, (variable, point)
    start : (variable, point)
    """
    first = rate(0.0, start)
    full = start + first
    second = rate(1.0, full)
    both = first + second
    middle = start + 0.25 * both
    third = rate(0.5, middle)
    end = start + (both + 4.0 * third) / 6.0
    error = (2.0 * third - both) / 3.0
    return EmbeddedStep(end, error, (start, full, middle), (first, second, third))
