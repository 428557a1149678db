r"""One piece of a strain increment of CSUH: elastic up to the yield surface, plastic beyond it.

*Elastic.* K = (1 + e0)(p + p_s)/kappa and G/K constant give, along a straight strain increment,

    p + p_s = (p_n + p_s) exp(v),   v = (1 + e0) d eps_v/kappa,   ds = 2 (G/K) (dp/d eps_v) de,

exactly, and a straight line in stress space; so the yield surface, which is convex, is crossed at
most once on the way out. It is met where

    M^2 (p - p_x) + eta^2 (p + chi p_x) = 0,

which is f = 0 without its logarithms and poles; p_x is the pressure at which the surface meets the
p axis, p_x + p_s = (p_x0 + p_s) exp(H/c_p).

*Plastic.* Plastic strain d eps^p = L p dg/dsigma is coaxial with the stress. So the deviator stays
in the plane of the first deviator and the strain's, s = a s_n + b de, and the equations are
integrated in p, a, b and H alone, whatever the order of components. Consistency,

    (df/dp) dp + (df/ds):ds + (df/dM) dM - dH/c_p = 0,

takes M (Eq 7.35) as it is on the way. The flow has no part from the gradient of M; since plastic
strain scales s and leaves its Lode angle alone, dM comes from the elastic part of ds only.

*Drift.* While a point yields, f = 0 holds because H is read from it at the end; the integrated H
serves as a measure of the error.

*No pressure.* Below `FLOOR` grains no longer touch: a point that gets there by extension has the
isotropic stress `FLOOR` until it is compressed or sheared with dilation. With p_s > 0 a finite
expansion leads there, as K does not vanish with p; with p_s = 0 p decays exponentially.
"""

from typing import Any, NamedTuple

import torch
from torch import Tensor

from granbench.models.components import TensorRows, safe_root
from granbench.models.csuh_formulas import (
    characteristic_square,
    critical_ratio,
    failure_ratio,
    reference_void_ratio,
    surface_factor,
    yield_denominator,
    yield_numerator,
)
from granbench.models.lode import DeviatorPlane, deviator_plane
from granbench.models.substepping import Attempt, EmbeddedStep, runge_kutta, taken

FLOOR = 10.0
"""Pa; the least mean stress."""

NEAR_FLOOR = 4.0
"""A point that would fall through the floor from less than this many times it, stays there."""

PRESSURE_SCALE = 1e3
"""Pa; added to p where errors are made relative."""

ROOT_ITERATIONS = 40
ROOT_TOLERANCE = 1e-9
"""Of the share of an elastic line; the Newton step after the last squares it."""

ROUNDINGS = 256.0
"""A stress is on the yield surface within so many roundings."""


class Material(NamedTuple):
    """What the equations need of a material and of where its path began; () or (point,) each.

    Parameters
    ----------
    critical : M in triaxial compression
    spacing : chi
    dilatancy : m
    kappa : slope of swelling
    plastic : lambda - kappa
    intercept : of e_eta, see `granbench.models.csuh_formulas.intercept_in_pascal`
    p_s : Pa
    shear : 2 G/K
    volume : 1 + e0
    hardening_scale : c_p = (lambda - kappa)/(1 + e0)
    first_size : p_x0 + p_s, Pa
    steepest : eta^2/M^2 of the cone that yield surfaces lie in, 1/chi, a little less
    """

    critical: Tensor
    spacing: Tensor
    dilatancy: Tensor
    kappa: Tensor
    plastic: Tensor
    intercept: Tensor
    p_s: Tensor
    shear: Tensor
    volume: Tensor
    hardening_scale: Tensor
    first_size: Tensor
    steepest: Tensor


class _Line(NamedTuple):
    """The elastic line from a stress: p + alpha dp, s_n + alpha b de."""

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
    share : of the elastic line that is elastic
    floored : it ends at the floor, elastically
    lifted : what H gains where the stress is given outside of its surface
    """

    elastic: Tensor
    crossing: Tensor
    share: Tensor
    floored: Tensor
    lifted: Tensor


class _Bracket(NamedTuple):
    """What is known of the excess on an elastic line before its root is sought."""

    limit: Tensor
    start: Tensor
    slope: Tensor
    last: Tensor


class _Yielding(NamedTuple):
    """The plastic part of a piece; (point,) each.

    Parameters
    ----------
    plane : of s_n and de
    time : its share of the piece, so that de * time is its deviatoric strain
    volumetric : its volumetric strain
    void_ratio : at its beginning
    material : as of the piece
    """

    plane: DeviatorPlane
    time: Tensor
    volumetric: Tensor
    void_ratio: Tensor
    material: Material


class Increment:
    """Advances states by a piece of a strain increment, all points at once.

    A state is the stress rows, H, e and the rows behind them, which stay as they are.

    Parameters
    ----------
    rows : of stress and strain
    lode_dependent : whether M follows Eq 7.35; else it is that of triaxial compression
    state_dependent : whether M_f and M_c depend on xi; else both are M
    """

    def __init__(self, rows: TensorRows, *, lode_dependent: bool, state_dependent: bool) -> None:
        self.rows = rows
        self.lode_dependent = lode_dependent
        self.state_dependent = state_dependent

    def advance(self, dstrain: Tensor, state: Tensor, c: Material) -> Attempt:
        """See `granbench.models.substepping.substepped`."""
        rows, count = self.rows, self.rows.count
        stress, hardening, void_ratio = state[:count], state[count], state[count + 1]
        p, s = rows.split(stress)
        change = c.volume * rows.trace(dstrain)
        apart = self._apart(p, void_ratio, change, c)
        if apart is not None:
            dstrain = dstrain * (1.0 - apart)
        volumetric, de = rows.trace(dstrain), rows.deviator(dstrain)
        plane = deviator_plane(rows, s, de, lode=self.lode_dependent)
        v = c.volume / c.kappa * volumetric
        secant = (p + c.p_s) * _growth(v)
        line = _Line(p, secant * v, secant * (c.volume / c.kappa * c.shear), plane)
        with torch.no_grad():
            way = self._way(line, hardening, c)
        share = elastic_time = way.elastic.to(p.dtype)
        if way.crossing.any():
            at = way.crossing.nonzero().squeeze(-1)
            met = self._met(_taken_line(line, at), hardening[at], way.share[at], taken(c, at))
            share = share.index_copy(0, at, met)
            elastic_time = elastic_time.index_copy(0, at, _time(met, v[at]))
        plastic_time = 1.0 - elastic_time
        begin_p, scale = p + share * line.dp, torch.ones_like(p)
        begin_b = share * line.b
        if way.floored.any():
            begin_p = torch.where(way.floored, FLOOR, begin_p)
            begin_b = torch.where(way.floored, 0.0, begin_b)
            scale = torch.where(way.floored, 0.0, scale)
        begin = torch.stack([begin_p, scale, begin_b, hardening + way.lifted])
        begin_e = void_ratio - change + c.volume * volumetric * plastic_time
        end, error = begin, torch.zeros_like(p, requires_grad=False)
        if not way.elastic.all():
            yielding = _Yielding(plane, plastic_time, volumetric * plastic_time, begin_e, c)
            end, error = self._yield(begin, yielding)
        after = torch.cat(
            [
                stress + rows.normal * (end[0] - p) + (end[1] - 1.0) * s + end[2] * de,
                end[3:4],
                (void_ratio - change).unsqueeze(0),
                state[count + 2 :],
            ]
        )
        return Attempt(after, error)

    def _apart(self, p: Tensor, void_ratio: Tensor, change: Tensor, c: Material) -> Tensor | None:
        """Share of a piece that only brings grains together which no longer touched.

        At the floor, a void ratio beyond the loosest is that of grains apart.
        """
        at_floor = p <= FLOOR * (1.0 + 1e-6)
        if not at_floor.any():
            return None
        floor = torch.full_like(p, FLOOR)
        loosest = reference_void_ratio(
            floor, floor + c.p_s, c.intercept, c.kappa, c.plastic, c.p_s
        )
        beyond = at_floor & (void_ratio > loosest)
        closing = torch.where(beyond & (change > 0.0), change, 1.0)
        share = ((void_ratio - loosest) / closing).clamp(0.0, 1.0)
        share = torch.where(change > 0.0, share, 1.0)
        return torch.where(beyond, share, 0.0)

    def _critical_square(self, plane: DeviatorPlane, a: Any, b: Tensor, c: Material) -> Any:
        """q^2, M^2 and sin(3 theta) at s = a s_n + b de."""
        q2 = plane.square(a, b)
        if not self.lode_dependent:
            return q2, c.critical * c.critical, 1.0
        sin3 = plane.lode_sin3(a, b, q2)
        critical = critical_ratio(c.critical, sin3)
        return q2, critical * critical, sin3

    def _ratio(self, plane: DeviatorPlane, p: Tensor, a: Any, b: Tensor, c: Material) -> Any:
        """eta^2 within the cone of the surfaces, M^2, sin(3 theta) and q^2."""
        q2, critical2, sin3 = self._critical_square(plane, a, b, c)
        return torch.minimum(q2 / (p * p), critical2 * c.steepest), critical2, sin3, q2

    def _excess(
        self, line: _Line, share: Tensor, size: Tensor, c: Material
    ) -> tuple[Tensor, Tensor]:
        """p^2 - p_x p + q^2 (1 + chi p_x/p)/M^2 on the line, Pa^2, and its slope."""
        p, b = line.p + share * line.dp, share * line.b
        q2, critical2, sin3 = self._critical_square(line.plane, 1.0, b, c)
        q2_rate = line.plane.square_rate(1.0, b) * line.b
        weight = 1.0 + c.spacing * size / p
        part = q2 * weight / critical2
        part_rate = (q2_rate * weight - q2 * (weight - 1.0) * line.dp / p) / critical2
        if self.lode_dependent:
            q = safe_root(q2)
            sin3_rate = line.plane.cubic_rate(1.0, b) * line.b / q - 1.5 * sin3 * q2_rate
            part_rate = part_rate - 2.0 * weight / critical2 * sin3_rate / (7.0 - sin3)
        return p * (p - size) + part, (2.0 * p - size) * line.dp + part_rate

    def _way(self, line: _Line, hardening: Tensor, c: Material) -> _Way:
        tiny = ROUNDINGS * torch.finfo(line.p.dtype).eps
        size = self._size(hardening, c)
        eta2, critical2, _, _ = self._ratio(line.plane, line.p, 1.0, torch.zeros_like(line.b), c)
        through = line.p * surface_factor(eta2, critical2, c.spacing)
        inside = through < size * (1.0 - tiny)
        outside = through > size * (1.0 + tiny)
        grown = (through + c.p_s) / (size + c.p_s)
        lifted = torch.where(outside, c.hardening_scale * torch.log(grown), 0.0)
        size = torch.where(inside, size, through)
        falls = line.p + line.dp < FLOOR
        limit = torch.where(falls, ((FLOOR - line.p) / line.dp).clamp(0.0, 1.0), 1.0)
        last, _ = self._excess(line, limit, size, c)
        p_last = line.p + limit * line.dp
        elastic = last <= tiny * size * p_last  # false where it is not a number
        start, slope = self._excess(line, torch.zeros_like(limit), size, c)
        crossing = ~elastic & (inside | (slope < 0.0))
        share = torch.zeros_like(line.p)
        if crossing.any():
            at = crossing.nonzero().squeeze(-1)
            known = _Bracket(limit[at], start[at], slope[at], last[at])
            share[at] = self._root(_taken_line(line, at), size[at], taken(c, at), known)
        return _Way(elastic, crossing, share, elastic & falls, lifted)

    def _size(self, hardening: Tensor, c: Material) -> Tensor:
        """p_x, Pa."""
        return c.first_size * torch.exp(hardening / c.hardening_scale) - c.p_s

    def _root(self, line: _Line, size: Tensor, c: Material, known: "_Bracket") -> Tensor:
        """Share of the elastic line at which it leaves the surface, by safeguarded Newton."""
        low, high = torch.zeros_like(size), known.limit
        curvature = (known.last / high - known.slope) / high - known.start / (high * high)
        root = (known.slope**2 - 4.0 * curvature * known.start).clamp(min=0.0).sqrt()
        # The root of the parabola through what is known; exact where chi = 0 and M constant.
        share = torch.where(
            known.slope > 0.0,
            -2.0 * known.start / (known.slope + root),
            (root - known.slope) / (2.0 * curvature),
        )
        for _ in range(ROOT_ITERATIONS):
            share = torch.where((share > low) & (share < high), share, 0.5 * (low + high))
            excess, slope = self._excess(line, share, size, c)
            low, high = torch.where(excess < 0.0, share, low), torch.where(excess < 0.0, high, share)
            step = excess / slope
            share = share - step
            if (step.abs() < ROOT_TOLERANCE).all():
                break
        return share.clamp(low, high)

    def _met(self, line: _Line, hardening: Tensor, share: Tensor, c: Material) -> Tensor:
        """The share again, by one more Newton step, which carries the gradients."""
        excess, slope = self._excess(line, share, self._size(hardening, c), c)
        return share - excess / slope.detach()

    def _rate(self, y: _Yielding, time: float, state: Tensor) -> Tensor:
        """Rates of p, a, b and H, and the plastic multiplier L, in pseudo-time 0 ... 1."""
        c = y.material
        p, a, b = state[0].clamp(min=FLOOR), state[1], state[2]
        eta2, critical2, sin3, q2 = self._ratio(y.plane, p, a, b, c)
        bulk = (p + c.p_s) * (c.volume / c.kappa)
        twice_shear = bulk * c.shear
        failure4, characteristic2 = self._limits(y, time, p, eta2, critical2)
        stretched = critical2 * (1.0 + c.spacing)
        q2_rate = y.plane.square_rate(a, b)
        if self.lode_dependent:
            turning = 2.0 * y.plane.cubic_rate(a, b) / safe_root(q2)
            q2_rate = q2_rate + (3.0 * sin3 * q2_rate - turning) / (7.0 - sin3)
        numerator = yield_numerator(eta2, critical2, c.spacing)
        denominator = yield_denominator(p, eta2, critical2, c.spacing, c.p_s)
        p_trial, b_trial = bulk * y.volumetric, twice_shear * y.time
        loading = (numerator * p_trial + stretched / p * q2_rate * b_trial).relu()
        total, contraction = characteristic2 + eta2, characteristic2 - eta2
        hardening = failure4 - eta2 * eta2
        elastic_modulus = total * (
            numerator * bulk * contraction + 6.0 * twice_shear * stretched * eta2
        )
        modulus = elastic_modulus + denominator * hardening / c.hardening_scale
        flow = loading * total / modulus
        shrinking = -3.0 * flow * twice_shear / p
        return torch.stack(
            [
                p_trial - flow * bulk * contraction,
                shrinking * a,
                b_trial + shrinking * b,
                flow * hardening / total,
                flow,
            ]
        )

    def _limits(
        self, y: _Yielding, time: float, p: Tensor, eta2: Tensor, critical2: Tensor
    ) -> tuple[Tensor, Tensor]:
        """M_f^4 and M_c^2."""
        if not self.state_dependent:
            return critical2 * critical2, critical2
        c = y.material
        surface = surface_factor(eta2, critical2, c.spacing) * p + c.p_s
        loosest = reference_void_ratio(p, surface, c.intercept, c.kappa, c.plastic, c.p_s)
        looseness = y.void_ratio - time * c.volume * y.volumetric - loosest
        overconsolidation = torch.exp(looseness / c.plastic)
        failure2 = failure_ratio(critical2.sqrt(), overconsolidation) ** 2
        return failure2 * failure2, characteristic_square(critical2, c.dilatancy, looseness)

    def _yield(self, begin: Tensor, y: _Yielding) -> tuple[Tensor, Tensor]:
        """End state of p, a, b and H, and its error; `begin` where there is no plastic part."""
        c = y.material
        start = torch.cat([begin, torch.zeros_like(begin[:1])])
        step = runge_kutta(lambda time, state: self._rate(y, time, state), start)
        p, a, b, hardening, _ = step.end.unbind()
        with torch.no_grad():
            lowest = torch.stack([p, *(stage[0] for stage in step.stages)]).amin(dim=0)
            eta2, critical2, _, _ = self._ratio(y.plane, p.clamp(min=FLOOR), a, b, c)
            impossible = ~((lowest >= FLOOR) & (eta2 < critical2 * c.steepest)) & (y.time > 0.0)
            stays = impossible & (begin[0] <= NEAR_FLOOR * FLOOR)
            flow = torch.stack([rate[4] for rate in step.rates]).amin(dim=0)
            impossible = impossible | (flow < 0.0)  # a softening that no strain can follow
            yields = flow > 0.0
        if stays.any():
            p = torch.where(stays, FLOOR, p)
            a, b = torch.where(stays, 0.0, a), torch.where(stays, 0.0, b)
            hardening = torch.where(stays, begin[3], hardening)
        eta2, critical2, _, _ = self._ratio(y.plane, p.clamp(min=FLOOR), a, b, c)
        surface = surface_factor(eta2, critical2, c.spacing) * p.clamp(min=FLOOR) + c.p_s
        read = c.hardening_scale * torch.log(surface / c.first_size)
        error = self._error(step, p, read, y)
        error = torch.where(impossible, torch.inf, error)
        error = torch.where(stays | (y.time == 0.0), 0.0, error)
        # Where unloading sets in on the way, the surface may stay behind larger than the stress.
        hardening = torch.where(yields & ~stays, read, torch.maximum(hardening, read))
        hardening = torch.where(y.time > 0.0, hardening, begin[3])
        return torch.stack([p, a, b, hardening]), error

    @torch.no_grad()
    def _error(self, step: EmbeddedStep, p: Tensor, read: Tensor, y: _Yielding) -> Tensor:
        """Error of the stress relative to p, and of H relative to c_p."""
        of_p, of_a, of_b, of_hardening, _ = step.error.unbind()
        stress2 = of_p * of_p + y.plane.square(of_a, of_b)
        size = p + PRESSURE_SCALE
        drift = torch.maximum(of_hardening.abs(), (step.end[3] - read).abs())
        return (stress2 / (size * size) + (drift / y.material.hardening_scale) ** 2).sqrt()


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


def _taken_line(line: _Line, points: Tensor) -> _Line:
    return _Line(line.p[points], line.dp[points], line.b[points], line.plane.taken(points))
