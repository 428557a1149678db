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
from torch import Tensor

from granbench.models.components import TensorRows
from granbench.models.csuh_formulas import reference_void_ratio
from granbench.models.csuh_yielding import (
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

    p: Tensor
    dp: Tensor
    b: Tensor
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

    elastic: Tensor
    crossing: Tensor
    share: Tensor
    falls: Tensor
    lifted: Tensor | float


class _Ends(NamedTuple):
    """What is known of the excess on an elastic line before its root is sought."""

    limit: Tensor
    start: Tensor
    slope: Tensor
    last: Tensor


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

    def advance(self, dstrain: Tensor, state: Tensor, m: Material) -> Attempt:
        """See `granbench.models.substepping.substepped`."""
        rows, count = self.rows, self.rows.count
        stress, hardening, void_ratio = state[:count], state[count], state[count + 1]
        p, s = rows.split(stress)
        void_ratio_after = void_ratio - m.volume * rows.trace(dstrain)
        dstrain = self._touching(dstrain, p, void_ratio, void_ratio_after, m)
        volumetric, de = rows.trace(dstrain), rows.deviator(dstrain)
        v = m.stiffness * volumetric
        secant = (p + m.p_s) * _growth(v)
        plane = deviator_plane(rows, s, de, lode=self.flags.lode_dependent)
        elastic = _ElasticLine(p, secant * v, secant * (m.stiffness * m.shear), plane)
        with torch.no_grad():
            way = self._way(elastic, hardening, m)
        share = elastic_part = way.elastic.to(p.dtype)
        if way.crossing.any():
            at = way.crossing.nonzero().squeeze(-1)
            met = self._met(_taken(elastic, at), hardening[at], way.share[at], taken(m, at))
            share = share.index_copy(0, at, met)
            elastic_part = elastic_part.index_copy(0, at, _time(met, v[at]))
        begin = [p + share * elastic.dp, torch.ones_like(p), share * elastic.b]
        end = torch.stack([*begin, hardening + way.lifted])
        error = torch.zeros_like(p, requires_grad=False)
        if way.falls.any():
            end = floored(end, way.falls, m)
        if not way.elastic.all():
            rest = 1.0 - elastic_part
            density = (void_ratio_after + m.volume * (rest * volumetric) - m.intercept) / m.plastic
            compaction = -m.plasticity * rest * volumetric
            yielding = Yielding(self.flags, plane, rest, rest * volumetric, density, compaction, m)
            end, error = yielding.advanced(end)
        p_after, a, b, hardening = end.unbind()
        stress = torch.addcmul(stress, rows.normal, p_after - p)
        stress = torch.addcmul(torch.addcmul(stress, s, a - 1.0), de, b)
        constants = state[count + 2 :]
        after = torch.cat([stress, torch.stack([hardening, void_ratio_after]), constants])
        return Attempt(after, error)

    def _touching(
        self, dstrain: Tensor, p: Tensor, before: Tensor, after: Tensor, m: Material
    ) -> Tensor:
        """Strain without what only brings grains together that do not touch.

        At the floor, a void ratio beyond the loosest is that of grains apart.
        """
        apart = p <= AT_FLOOR
        if not apart.any():
            return dstrain
        floor = torch.full_like(p, FLOOR)
        kappa = m.swelling * m.plastic
        loosest = reference_void_ratio(floor, floor + m.p_s, m.intercept, kappa, m.plastic, m.p_s)
        apart = apart & (before > loosest)
        closing = apart & (after < loosest)
        kept = torch.where(
            closing, (loosest - after) / torch.where(closing, before - after, 1.0), 0.0
        )
        return torch.where(apart, kept, 1.0) * dstrain

    def _way(self, elastic: _ElasticLine, hardening: Tensor, m: Material) -> _Way:
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
        tiny = ROUNDINGS * torch.finfo(hardening.dtype).eps
        p, dp, b, plane = elastic
        cubic = plane.cubic_0 if self.flags.lode_dependent else None
        ratio = stress_ratio(p, plane.square_0, cubic, m)
        y = torch.minimum(ratio.y, m.steepest)
        through = (1.0 + y) / (1.0 - m.spacing * y) * p
        size = _size(hardening, m)
        inside = through < size * (1.0 - tiny)
        outside = through > size * (1.0 + tiny)
        lifted: Tensor | float = 0.0
        if outside.any():
            grown = torch.where(outside, (through + m.p_s) / (size + m.p_s), 1.0)
            lifted = torch.log(grown) / m.plasticity
        size = torch.where(inside, size, through)
        end, b_end = p + dp, b
        falls, limit = end < FLOOR, torch.ones_like(p)
        if falls.any():
            limit = torch.where(falls, ((FLOOR - p) / dp).clamp(0.0, 1.0), limit)
            end, b_end = torch.where(falls, p + limit * dp, end), limit * b
        square, cubic = plane.unscaled(b_end)
        last = _excess(end, size, square, self._ratio(end, square, cubic, m), m)
        whole = last <= tiny * size * end  # false where it is not a number
        crossing, share = ~whole, torch.zeros_like(p)
        if crossing.any():
            slope = self._slope(elastic, share, size, plane.square_0, ratio, m)
            crossing = crossing & (inside | (slope < 0.0))
        if crossing.any():
            at = crossing.nonzero().squeeze(-1)
            start = _excess(p, size, plane.square_0, ratio, m)
            ends = _Ends(limit[at], start[at], slope[at], last[at])
            share[at] = self._root(_taken(elastic, at), size[at], taken(m, at), ends)
        return _Way(whole, crossing, share, whole & falls, lifted)

    def _ratio(self, p: Tensor, square: Tensor, cubic: Tensor, m: Material) -> Ratio:
        return stress_ratio(p, square, cubic if self.flags.lode_dependent else None, m)

    def _on_line(
        self, elastic: _ElasticLine, share: Tensor, size: Tensor, m: Material
    ) -> tuple[Tensor, Tensor]:
        """The excess on an elastic line and its slope."""
        p, b = torch.addcmul(elastic.p, share, elastic.dp), share * elastic.b
        square, cubic = elastic.plane.unscaled(b)
        ratio = self._ratio(p, square, cubic, m)
        excess = _excess(p, size, square, ratio, m)
        return excess, self._slope(elastic, share, size, square, ratio, m)

    def _slope(
        self,
        elastic: _ElasticLine,
        share: Tensor,
        size: Tensor,
        square: Tensor,
        ratio: Ratio,
        m: Material,
    ) -> Tensor:
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
        one, plane = torch.ones_like(share), elastic.plane
        p, b = torch.addcmul(elastic.p, share, elastic.dp), share * elastic.b
        square_rate = plane.square_slope(one, b) * elastic.b
        stretched = m.spacing * size / p
        of_square = (1.0 + stretched) * square_rate
        if self.flags.lode_dependent:
            turning = plane.cubic_slope(one, b) * elastic.b / ratio.q
            turning = turning - 1.5 * (7.0 - ratio.seven) * square_rate
            of_square = of_square - 2.0 * (1.0 + stretched) * turning / ratio.seven
        of_square = of_square - stretched * square * elastic.dp / p
        return (2.0 * p - size) * elastic.dp + ratio.slope * ratio.slope * of_square

    def _root(self, elastic: _ElasticLine, size: Tensor, m: Material, ends: _Ends) -> Tensor:
        """Share of the elastic line at which it leaves the surface, by safeguarded Newton."""
        low, high = torch.zeros_like(size), ends.limit
        curvature = ((ends.last - ends.start) / high - ends.slope) / high
        root = (ends.slope**2 - 4.0 * curvature * ends.start).clamp(min=0.0).sqrt()
        # The root of the parabola through what is known; exact where chi = 0 and M is constant.
        share = torch.where(
            ends.slope > 0.0,
            -2.0 * ends.start / (ends.slope + root),
            (root - ends.slope) / (2.0 * curvature),
        )
        for _ in range(ROOT_ITERATIONS):
            share = torch.where((share >= low) & (share <= high), share, 0.5 * (low + high))
            excess, slope = self._on_line(elastic, share, size, m)
            within = excess < 0.0
            low, high = torch.where(within, share, low), torch.where(within, high, share)
            step = excess / slope
            share = share - step
            if (step.abs() < ROOT_TOLERANCE).all():
                break
        return torch.minimum(torch.maximum(share, low), high)

    def _met(self, elastic: _ElasticLine, hardening: Tensor, share: Tensor, m: Material) -> Tensor:
        """The share again, by one more Newton step, which carries the gradients."""
        excess, slope = self._on_line(elastic, share, _size(hardening, m), m)
        return share - excess / slope.detach()


def _excess(p: Tensor, size: Tensor, square: Tensor, ratio: Ratio, m: Material) -> Tensor:
    """p^2 - p_x p + q^2 (1 + chi p_x/p)/M^2, Pa^2: positive outside of the surface p_x = `size`."""
    reduced = ratio.slope * ratio.slope * square
    return torch.addcmul(p * (p - size), reduced, 1.0 + m.spacing * size / p)


def _size(hardening: Tensor, m: Material) -> Tensor:
    """Size p_x of the yield surface, Pa."""
    return m.first_size * torch.exp(hardening * m.plasticity) - m.p_s


def _growth(v: Tensor) -> Tensor:
    """(exp(v) - 1)/v."""
    small = v.abs() < torch.finfo(v.dtype).eps ** 0.5
    safe = torch.where(small, 1.0, v)
    return torch.where(small, 1.0 + 0.5 * v, torch.expm1(safe) / safe)


def _time(share: Tensor, v: Tensor) -> Tensor:
    """Share of the strain that brings a share of the elastic stress: ln(1 + share (e^v - 1))/v."""
    small = v.abs() < torch.finfo(v.dtype).eps ** 0.5
    safe = torch.where(small, 1.0, v)
    limit = share * (1.0 + 0.5 * v * (1.0 - share))
    return torch.where(small, limit, torch.log1p(share * torch.expm1(safe)) / safe)


def _taken(elastic: _ElasticLine, points: Tensor) -> _ElasticLine:
    p, dp, b, plane = elastic
    return _ElasticLine(p[points], dp[points], b[points], plane.taken(points))
