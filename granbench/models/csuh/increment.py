r"""One piece of a strain increment of CSUH: elastic up to the yield surface, plastic beyond it.

K = (1 + e0)(p + p_s)/kappa and a constant G/K give, along a straight strain increment,

    p + p_s = (p_n + p_s) exp(v),   v = (1 + e0) d eps_v/kappa,   ds = 2 (G/K) (dp/d eps_v) de,

exactly, and a straight line in stress space; so the yield surface, which is convex, is crossed at
most once on the way out. It is met where

    p^2 - p_x p + q^2 (1 + chi p_x/p)/M^2 = 0,

which is f = 0 without its logarithms and poles; p_x is the pressure at which the surface meets the
p axis, p_x + p_s = (p_x0 + p_s) exp(H/c_p).

*No pressure.* At `FLOOR` grains hardly touch: a point that gets there by extension has this
isotropic stress until it is compressed, or sheared with dilation, from a void ratio that the
material can have. With p_s > 0 a finite expansion leads there, as K does not vanish with p; with
p_s = 0 p decays exponentially.
"""

from typing import NamedTuple

import torch

from granbench.models.arrays import (
    Array,
    addcmul,
    at_least,
    between,
    cat,
    detached,
    exp,
    expm1,
    full_like,
    log,
    log1p,
    maximum,
    minimum,
    ones_like,
    places,
    replaced,
    rounding_unit,
    sqrt,
    stack,
    where,
    zeros_like,
)
from granbench.models.components import TensorRows
from granbench.models.csuh.formulas import reference_void_ratio
from granbench.models.csuh.yielding import (
    AT_FLOOR,
    FLOOR,
    Flags,
    Material,
    Ratio,
    Yielding,
    floored,
    stress_ratio,
)
from granbench.models.lode import DeviatorPlane, deviator_plane
from granbench.models.substepping import Attempt, taken

ROOT_ITERATIONS = 40
ROOT_TOLERANCE = 1e-9
"""Of the share of an elastic line; the Newton step after the last squares it."""

ROUNDINGS = 256.0
"""A stress is on the yield surface within so many roundings."""


class _ElasticLine(NamedTuple):
    """Elastic stresses p + x dp and s_n + x b de for the share x of a line."""

    p: Array
    dp: Array
    b: Array
    plane: DeviatorPlane


class _Way(NamedTuple):
    """How a piece goes: all (point,), without gradients.

    Parameters
    ----------
    elastic : the whole piece is elastic, or ends at the floor
    crossing : it begins elastic and ends plastic
    share : of the elastic line that is elastic, where it crosses
    falls : it ends at the floor, elastically
    lifted : what H gains where the stress is given outside of its surface
    """

    elastic: Array
    crossing: Array
    share: Array
    falls: Array
    lifted: Array | float


class _Ends(NamedTuple):
    """What is known of the excess on an elastic line before its root is sought."""

    limit: Array
    start: Array
    slope: Array
    last: Array


class Increment:
    """Advances states by a piece of a strain increment, all points at once.

    A state is the stress rows, H, e and the rows behind them, which stay as they are.

    Parameters
    ----------
    rows : of stress and strain
    flags : which model of the family it is
    """

    def __init__(self, rows: TensorRows, flags: Flags) -> None:
        self.rows = rows
        self.flags = flags

    def advance(self, dstrain: Array, state: Array, m: Material) -> Attempt:
        """See `granbench.models.substepping.substepped`."""
        rows, count = self.rows, self.rows.count
        stress, hardening, void_ratio = state[:count], state[count], state[count + 1]
        p, s = rows.split(stress)
        volumetric, de = rows.trace(dstrain), rows.deviator(dstrain)
        void_ratio_after = void_ratio - m.volume * volumetric
        touching = self._touching(p, void_ratio, void_ratio_after, m)
        if touching is not None:
            volumetric, de = touching * volumetric, touching * de
        v = m.stiffness * volumetric
        secant = (p + m.p_s) * _growth(v)
        plane = deviator_plane(rows, s, de, lode=self.flags.lode_dependent)
        elastic = _ElasticLine(p, secant * v, secant * (m.stiffness * m.shear), plane)
        with torch.no_grad():
            way = self._way(elastic, hardening, m)
        one = ones_like(p)
        share = elastic_part = where(way.elastic, one, 0.0)
        if way.crossing.any():
            at = places(way.crossing)
            met = self._met(_taken(elastic, at), hardening[at], way.share[at], taken(m, at))
            share = replaced(share, at, met)
            elastic_part = replaced(elastic_part, at, _time(met, v[at]))
        begin = [p + share * elastic.dp, one, share * elastic.b]
        end = stack([*begin, hardening + way.lifted])
        error = zeros_like(p)
        if way.falls.any():
            end = floored(end, way.falls, m)
        if not way.elastic.all():
            rest = 1.0 - elastic_part
            density = (void_ratio_after + m.volume * (rest * volumetric) - m.intercept) / m.plastic
            compaction = -m.plasticity * rest * volumetric
            yielding = Yielding(self.flags, plane, rest, rest * volumetric, density, compaction, m)
            end, error = yielding.advanced(end)
        p_after, a, b, hardening = end
        stress = rows.shifted(stress, p_after - p)
        stress = addcmul(addcmul(stress, s, a - 1.0), de, b)
        constants = state[count + 2 :]
        after = cat([stress, stack([hardening, void_ratio_after]), constants])
        return Attempt(after, error)

    def _touching(self, p: Array, before: Array, after: Array, m: Material) -> Array | None:
        """Share of the strain that does not only bring grains together; None where all of it is.

        At the floor, a void ratio beyond the loosest is that of grains apart.
        """
        apart = p <= AT_FLOOR
        if not apart.any():
            return None
        floor = full_like(p, FLOOR)
        kappa = m.swelling * m.plastic
        loosest = reference_void_ratio(floor, floor + m.p_s, m.intercept, kappa, m.plastic, m.p_s)
        apart = apart & (before > loosest)
        closing = apart & (after < loosest)
        kept = where(closing, (loosest - after) / where(closing, before - after, 1.0), 0.0)
        return where(apart, kept, 1.0)

    def _way(self, elastic: _ElasticLine, hardening: Array, m: Material) -> _Way:
        """How a piece goes, from the excess at both ends of its elastic line.

        The elastic region is convex and the line straight, so the signs at the ends decide:

        - where the line ends inside, all of it is elastic. One that would end below the floor is
          looked at where it meets the floor, and ends there;
        - where it begins inside and ends outside, it crosses once, at a root of the excess;
        - where it begins on the surface and ends outside, it is plastic from the start if the
          excess grows at first; if it falls, the piece unloads, and then crosses.

        A stress outside of its surface, as a true record may give it, lifts H so that the surface
        runs through it.

        Parameters
        ----------
        elastic : the elastic line of the whole piece
        hardening : H, (point,)
        m : the material
        """
        tiny = ROUNDINGS * rounding_unit(hardening)
        p, dp, b, plane = elastic
        cubic = plane.cubic_0 if self.flags.lode_dependent else None
        ratio = stress_ratio(p, plane.square_0, cubic, m)
        y = minimum(ratio.y, m.steepest)
        through = (1.0 + y) / (1.0 - m.spacing * y) * p
        size = _size(hardening, m)
        inside = through < size * (1.0 - tiny)
        outside = through > size * (1.0 + tiny)
        lifted: Array | float = 0.0
        if outside.any():
            grown = where(outside, (through + m.p_s) / (size + m.p_s), 1.0)
            lifted = log(grown) / m.plasticity
        size = where(inside, size, through)
        end, b_end = p + dp, b
        falls, limit = end < FLOOR, ones_like(p)
        if falls.any():
            limit = where(falls, between((FLOOR - p) / dp, 0.0, 1.0), limit)
            end, b_end = where(falls, p + limit * dp, end), limit * b
        square, cubic = plane.unscaled(b_end)
        last = _excess(end, size, square, self._ratio(end, square, cubic, m), m)
        whole = last <= tiny * size * end  # false where it is not a number
        crossing, share = ~whole, zeros_like(p)
        if crossing.any():
            slope = self._slope(elastic, share, size, plane.square_0, ratio, m)
            crossing = crossing & (inside | (slope < 0.0))
        if crossing.any():
            at = places(crossing)
            start = _excess(p, size, plane.square_0, ratio, m)
            ends = _Ends(limit[at], start[at], slope[at], last[at])
            share[at] = self._root(_taken(elastic, at), size[at], taken(m, at), ends)
        return _Way(whole, crossing, share, whole & falls, lifted)

    def _ratio(self, p: Array, square: Array, cubic: Array, m: Material) -> Ratio:
        return stress_ratio(p, square, cubic if self.flags.lode_dependent else None, m)

    def _on_line(
        self, elastic: _ElasticLine, share: Array, size: Array, m: Material
    ) -> tuple[Array, Array]:
        """The excess on an elastic line and its slope."""
        p, b = addcmul(elastic.p, share, elastic.dp), share * elastic.b
        square, cubic = elastic.plane.unscaled(b)
        ratio = self._ratio(p, square, cubic, m)
        excess = _excess(p, size, square, ratio, m)
        return excess, self._slope(elastic, share, size, square, ratio, m)

    def _slope(
        self,
        elastic: _ElasticLine,
        share: Array,
        size: Array,
        square: Array,
        ratio: Ratio,
        m: Material,
    ) -> Array:
        """Rate of the excess E along an elastic line, by the share of it.

        With ' for the rate, z = sin(3 theta) and 1/M proportional to 7 - z,

            E  = p^2 - p_x p + q^2 (1 + chi p_x/p)/M^2,
            E' = (2 p - p_x) p' + ((1 + chi p_x/p) w - q^2 chi p_x p'/p^2)/M^2,
            w  = (q^2)' - 2 q^2 z'/(7 - z),   q^2 z' = (q^3 z)'/q - 3/2 z (q^2)',

        where q^2 and q^3 z are polynomials of the share, and w = (q^2)' where M is constant.

        Parameters
        ----------
        elastic : the line
        share : where on it, (point,)
        size : p_x, Pa
        square, ratio : q^2 and the stress ratio there
        m : the material
        """
        one, plane = ones_like(share), elastic.plane
        p, b = addcmul(elastic.p, share, elastic.dp), share * elastic.b
        square_rate = plane.square_slope(one, b) * elastic.b
        stretched = m.spacing * size / p
        of_square = (1.0 + stretched) * square_rate
        if self.flags.lode_dependent:
            turning = plane.cubic_slope(one, b) * elastic.b / ratio.q
            turning = turning - 1.5 * (7.0 - ratio.seven) * square_rate
            of_square = of_square - 2.0 * (1.0 + stretched) * turning / ratio.seven
        of_square = of_square - stretched * square * elastic.dp / p
        return (2.0 * p - size) * elastic.dp + ratio.slope * ratio.slope * of_square

    def _root(self, elastic: _ElasticLine, size: Array, m: Material, ends: _Ends) -> Array:
        """Share of the elastic line at which it leaves the surface, by safeguarded Newton."""
        low, high = zeros_like(size), ends.limit
        curvature = ((ends.last - ends.start) / high - ends.slope) / high
        root = sqrt(at_least(ends.slope**2 - 4.0 * curvature * ends.start, 0.0))
        # The root of the parabola through what is known; exact where chi = 0 and M is constant.
        share = where(
            ends.slope > 0.0,
            -2.0 * ends.start / (ends.slope + root),
            (root - ends.slope) / (2.0 * curvature),
        )
        for _ in range(ROOT_ITERATIONS):
            share = where((share >= low) & (share <= high), share, 0.5 * (low + high))
            excess, slope = self._on_line(elastic, share, size, m)
            within = excess < 0.0
            low, high = where(within, share, low), where(within, high, share)
            step = excess / slope
            share = share - step
            if (abs(step) < ROOT_TOLERANCE).all():
                break
        return minimum(maximum(share, low), high)

    def _met(self, elastic: _ElasticLine, hardening: Array, share: Array, m: Material) -> Array:
        """The share again, by one more Newton step, which carries the gradients."""
        excess, slope = self._on_line(elastic, share, _size(hardening, m), m)
        return share - excess / detached(slope)


def _excess(p: Array, size: Array, square: Array, ratio: Ratio, m: Material) -> Array:
    """p^2 - p_x p + q^2 (1 + chi p_x/p)/M^2, Pa^2: positive outside of the surface p_x = `size`."""
    reduced = ratio.slope * ratio.slope * square
    return addcmul(p * (p - size), reduced, 1.0 + m.spacing * size / p)


def _size(hardening: Array, m: Material) -> Array:
    """Size p_x of the yield surface, Pa."""
    return m.first_size * exp(hardening * m.plasticity) - m.p_s


def _growth(v: Array) -> Array:
    """(exp(v) - 1)/v."""
    small = abs(v) < rounding_unit(v) ** 0.5
    safe = where(small, 1.0, v)
    return where(small, 1.0 + 0.5 * v, expm1(safe) / safe)


def _time(share: Array, v: Array) -> Array:
    """Share of the strain that brings a share of the elastic stress: ln(1 + share (e^v - 1))/v."""
    small = abs(v) < rounding_unit(v) ** 0.5
    safe = where(small, 1.0, v)
    limit = share * (1.0 + 0.5 * v * (1.0 - share))
    return where(small, limit, log1p(share * expm1(safe)) / safe)


def _taken(elastic: _ElasticLine, points: Array) -> _ElasticLine:
    p, dp, b, plane = elastic
    return _ElasticLine(p[points], dp[points], b[points], plane.taken(points))
