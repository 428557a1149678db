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
    between,
    cat,
    expm1,
    full_like,
    log,
    log1p,
    minimum,
    ones_like,
    places,
    replaced,
    rounding_unit,
    stack,
    where,
    zeros_like,
)
from granbench.models.components import TensorRows
from granbench.models.csuh.elastic_line import ElasticLine, LineEnds, excess_of, surface_size
from granbench.models.csuh.formulas import reference_void_ratio
from granbench.models.csuh.yielding import (
    AT_FLOOR,
    FLOOR,
    Flags,
    Material,
    Yielding,
    floored,
    stress_ratio,
)
from granbench.models.lode import deviator_plane
from granbench.models.substepping import Attempt, taken

ROUNDINGS = 256.0
"""A stress is on the yield surface within so many roundings."""


class _PieceKind(NamedTuple):
    """How each point goes through a piece: all (point,), without gradients.

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
        elastic = ElasticLine(
            p, secant * v, secant * (m.stiffness * m.shear), plane, self.flags.lode_dependent
        )
        with torch.no_grad():
            kind = self._kind(elastic, hardening, m)
        one = ones_like(p)
        share = elastic_part = where(kind.elastic, one, 0.0)
        if kind.crossing.any():
            at = places(kind.crossing)
            met = elastic.taken(at).met(hardening[at], kind.share[at], taken(m, at))
            share = replaced(share, at, met)
            elastic_part = replaced(elastic_part, at, _strain_share(met, v[at]))
        begin = [p + share * elastic.dp, one, share * elastic.b]
        end = stack([*begin, hardening + kind.lifted])
        error = zeros_like(p)
        if kind.falls.any():
            end = floored(end, kind.falls, m)
        if not kind.elastic.all():
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

    def _kind(self, elastic: ElasticLine, hardening: Array, m: Material) -> _PieceKind:
        """How each point goes through a piece, from the excess at both ends of its elastic line.

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
        p, dp, b, plane, _ = elastic
        cubic = plane.cubic_0 if self.flags.lode_dependent else None
        ratio = stress_ratio(p, plane.square_0, cubic, m)
        y = minimum(ratio.y, m.steepest)
        through = (1.0 + y) / (1.0 - m.spacing * y) * p
        size = surface_size(hardening, m)
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
        last = excess_of(end, size, square, elastic.ratio(end, square, cubic, m), m)
        whole = last <= tiny * size * end  # false where it is not a number
        crossing, share = ~whole, zeros_like(p)
        if crossing.any():
            slope = elastic.slope(share, size, plane.square_0, ratio, m)
            crossing = crossing & (inside | (slope < 0.0))
        if crossing.any():
            at = places(crossing)
            start = excess_of(p, size, plane.square_0, ratio, m)
            ends = LineEnds(limit[at], start[at], slope[at], last[at])
            share[at] = elastic.taken(at).root(size[at], taken(m, at), ends)
        return _PieceKind(whole, crossing, share, whole & falls, lifted)


def _growth(v: Array) -> Array:
    """(exp(v) - 1)/v."""
    small = abs(v) < rounding_unit(v) ** 0.5
    safe = where(small, 1.0, v)
    return where(small, 1.0 + 0.5 * v, expm1(safe) / safe)


def _strain_share(share: Array, v: Array) -> Array:
    """Share of the strain that brings a share of the elastic stress: ln(1 + share (e^v - 1))/v."""
    small = abs(v) < rounding_unit(v) ** 0.5
    safe = where(small, 1.0, v)
    limit = share * (1.0 + 0.5 * v * (1.0 - share))
    return where(small, limit, log1p(share * expm1(safe)) / safe)
