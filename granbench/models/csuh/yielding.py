r"""The plastic part of an increment of CSUH.

Plastic strain d eps^p = L p dg/dsigma is coaxial with the stress. So along a straight strain
increment s = a s_n + b de, and the equations are integrated in p, a, b and H alone, in whatever
order the components are. With y = eta^2/M^2, C = M_c^2/M^2 and F = (M_f/M)^4, the gradients,

    df/dp = n/D,   df/dq = 2 (1 + chi) eta/(M^2 D),   n = 1 - (1 + 3 chi) y - chi y^2,
    D = (1 - chi y)((1 + y) p + (1 - chi y) p_s),
    p dg/dp = (C - y)/(C + y),   p dg/dq = 2 eta/(M^2 (C + y)),

give, with the hardening dH = L (F - y^2)/(C + y)^2 and L from consistency,

    (df/dp) dp + (df/ds):ds + (df/dM) dM - dH/c_p = 0,

    phi = L/(C + y) = l (C + y)/h,
    l = n K d eps_v + (1 + chi)/(p M^2) ((7 + 2 z) dq^2/db - 2 d(q^3 z)/db/q)/(7 - z) 2 G,
    h = (C + y)(n K (C - y) + 12 G (1 + chi) y/M^2) + D (F - y^2)/c_p,
    dp = K (d eps_v - phi (C - y)),   da = -6 G phi a/(p M^2),   db = 2 G - 6 G phi b/(p M^2).

M = 6 M_com/(7 - z) with z = sin(3 theta) (Eq 7.35) is taken as it is on the way, with its rate: the
flow has no part from the gradient of M, and as plastic strain scales s, it leaves z alone, so that
dM comes from the elastic part of ds only.

While a point yields f = 0 holds to the last bit, because H is read from it at the end; the
integrated H serves as a measure of the error.
"""

import math
from functools import reduce
from typing import NamedTuple

import torch

from granbench.models.arrays import (
    Array,
    addcmul,
    at_least,
    cat,
    exp,
    log,
    maximum,
    minimum,
    sqrt,
    stack,
    where,
    zeros_like,
)
from granbench.models.lode import DeviatorPlane, lode_sin3
from granbench.models.parameters import Constants
from granbench.models.substepping import EmbeddedStep, runge_kutta

FLOOR = 10.0
"""Pa; the least mean stress."""

AT_FLOOR = FLOOR * (1.0 + 1e-6)
"""Pa; what is not above it is at the floor, within rounding."""

NEAR_FLOOR = 4.0
NEAR_FLOOR_ERROR = 3e-4
"""A point that falls from less than so many times the floor, in a piece that goes through it or
is less exact than this, ends there: p_s keeps the stiffness up, so that to follow so small a p
would take pieces of a millionth of a strain."""

PRESSURE_SCALE = 1e3
"""Pa; added to p where errors are made relative."""


class Material(NamedTuple):
    """Constants of the material and of the start of each path; () or (point,) each.

    Parameters
    ----------
    sixth : 1/(6 M_com), so that 1/M = sixth (7 - sin(3 theta))
    spacing : chi
    triple : 1 + 3 chi
    stretch : (1 + chi)/(6 M_com)^2
    steepest : greatest y of the cone that yield surfaces lie in, 1/chi, a little less
    power : 2 m (lambda - kappa), the power of R in M_c^2/M^2
    plastic : lambda - kappa
    swelling : kappa/(lambda - kappa)
    intercept : of e_eta, see `granbench.models.csuh.formulas.intercept_in_pascal`
    p_s : Pa
    shear : 2 G/K
    volume : 1 + e0
    stiffness : (1 + e0)/kappa
    plasticity : 1/c_p = (1 + e0)/(lambda - kappa)
    first_size : p_x0 + p_s, Pa
    """

    sixth: Array
    spacing: Array
    triple: Array
    stretch: Array
    steepest: Array
    power: Array
    plastic: Array
    swelling: Array
    intercept: Array
    p_s: Array
    shear: Array
    volume: Array
    stiffness: Array
    plasticity: Array
    first_size: Array


class Flags(NamedTuple):
    """Variant of the model family.

    Parameters
    ----------
    lode_dependent : whether M follows Eq 7.35; else it is that of triaxial compression
    state_dependent : whether M_f and M_c depend on xi; else both are M
    """

    lode_dependent: bool
    state_dependent: bool


class Ratio(NamedTuple):
    """A stress ratio and its parts, (point,).

    Parameters
    ----------
    y : eta^2/M^2
    slope : 1/M
    seven : 7 - sin(3 theta); 6 where M ignores the Lode angle
    q : Pa, never zero; 1 where M ignores the Lode angle
    """

    y: Array
    slope: Array
    seven: Array | float
    q: Array | float


def stress_ratio(p: Array, square: Array, cubic: Array | None, m: Material | Constants) -> Ratio:
    """The ratio at q^2 = `square`; `cubic` is None where M ignores the Lode angle."""
    seven: Array | float = 6.0
    q: Array | float = 1.0
    if cubic is not None:
        sin3, q = lode_sin3(square, cubic)
        seven = 7.0 - sin3
    slope = m.sixth * seven
    relative = slope / p
    return Ratio(relative * relative * square, slope, seven, q)


class Yielding(NamedTuple):
    """A piece of a strain increment on the yield surface; (point,) each.

    Parameters
    ----------
    flags : of the model
    plane : of s_n and de
    share : of de that is plastic; zero where there is nothing to do
    volumetric : volumetric strain
    density : (e - intercept)/(lambda - kappa) at the beginning
    compaction : its change, negative under compression
    material : as of the piece
    """

    flags: Flags
    plane: DeviatorPlane
    share: Array
    volumetric: Array
    density: Array
    compaction: Array
    material: Material

    def ratio(self, p: Array, a: Array, b: Array) -> Ratio:
        """The stress ratio at a state."""
        cubic = self.plane.cubic(a, b) if self.flags.lode_dependent else None
        return stress_ratio(p, self.plane.square(a, b), cubic, self.material)

    def rate(self, time: float, state: Array) -> Array:
        """Rates (5, point) of p, a, b, H, and phi, in pseudo-time 0 ... 1; see the module."""
        m = self.material
        p, a, b, *_ = state
        y, slope, seven, q = self.ratio(p, a, b)
        cone, whole = 1.0 - m.spacing * y, p + m.p_s
        inner = addcmul(addcmul(p, y, p), cone, m.p_s)
        failure4, characteristic2 = self._limits(time, whole, inner / cone, slope)
        bulk = whole * m.stiffness
        shear = bulk * m.shear
        p_elastic, s_elastic = bulk * self.volumetric, shear * self.share
        numerator = 1.0 - y * addcmul(m.triple, m.spacing, y)
        turning = self._turning(a, b, seven, q)
        loading = at_least(addcmul(numerator * p_elastic, turning, s_elastic / p), 0.0)
        total, contraction = characteristic2 + y, bulk * (characteristic2 - y)
        hardening = failure4 - y * y
        stretch = m.stretch * seven * seven * y
        elastic = addcmul(numerator * contraction, stretch, shear, value=6.0)
        modulus = addcmul(total * elastic, cone * inner * m.plasticity, hardening)
        flow = loading * total / modulus
        shrinking = -3.0 * flow * shear * (slope * slope) / p
        return stack(
            [
                addcmul(p_elastic, flow, contraction, value=-1.0),
                shrinking * a,
                addcmul(s_elastic, shrinking, b),
                flow * hardening / total,
                flow,
            ]
        )

    def _turning(self, a: Array, b: Array, seven: Array | float, q: Array | float) -> Array:
        """(1 + chi)/M^2 ((7 + 2 z) dq^2/db - 2 d(q^3 z)/db/q)/(7 - z)."""
        stretch, slope = self.material.stretch, self.plane.square_slope(a, b)
        if not self.flags.lode_dependent:
            return stretch * 36.0 * slope
        straight = (21.0 - 2.0 * seven) * slope
        return stretch * seven * (straight - 2.0 * self.plane.cubic_slope(a, b) / q)

    def _limits(
        self, time: float, whole: Array, surface: Array, slope: Array
    ) -> tuple[Array | float, Array | float]:
        """(M_f/M)^4 and (M_c/M)^2, of p + p_s, A p + p_s and 1/M."""
        if not self.flags.state_dependent:
            return 1.0, 1.0
        # ln R = (e - e_eta)/(lambda - kappa), with e_eta sorted by its logarithms.
        density = self.density + time * self.compaction if time else self.density
        m = self.material
        log_r = addcmul(density + log(surface), m.swelling, log(whole))
        six = 6.0 * slope
        ratio = six / (1.0 + sqrt(1.0 + (six - 2.0) * six * exp(log_r)))
        square = ratio * ratio
        return square * square, exp(m.power * log_r)

    def advanced(self, begin: Array) -> tuple[Array, Array]:
        """States (4, point) of p, a, b and H at the end, and the error (point,) of that.

        Parameters
        ----------
        begin : (4, point)
        """
        m = self.material
        step = runge_kutta(self.rate, cat([begin, zeros_like(begin[:1])]))
        p, a, b, hardening, _ = step.end
        y = self.ratio(p, a, b).y
        cone = 1.0 - m.spacing * y
        surface = addcmul(m.p_s, (1.0 + y) / cone, p)
        read = log(surface / m.first_size) / m.plasticity
        with torch.no_grad():
            active = self.share > 0.0
            lowest = reduce(minimum, (stage[0] for stage in step.stages), p)
            flow = reduce(minimum, (rate[4] for rate in step.rates))
            # A softening that no strain can follow has a negative flow.
            possible = (lowest >= 0.999999 * FLOOR) & (cone > 0.0) & (flow >= 0.0)
            error = where(possible, self._error(step, read), math.inf)
            # One whose p rises at first is cut instead: the long piece misjudges it.
            falls = (begin[0] <= NEAR_FLOOR * FLOOR) & (step.rates[0][0] <= 0.0)
            ends = active & falls & (error > NEAR_FLOOR_ERROR)
            error = where(active, error, 0.0)
        if ends.any():
            # Once more without them, so that what they ran into touches no gradient.
            return self._ended(begin, ends)
        # Where unloading sets in on the way, the surface may stay behind, larger than the stress.
        hardening = where(flow > 0.0, read, maximum(hardening, read))
        hardening = where(active, hardening, begin[3])
        return stack([p, a, b, hardening]), error

    def _ended(self, begin: Array, ends: Array) -> tuple[Array, Array]:
        """`advanced` where some points end at the floor."""
        share = where(ends, 0.0, self.share)
        volumetric = where(ends, 0.0, self.volumetric)
        others = self._replace(share=share, volumetric=volumetric)
        return others.advanced(floored(begin, ends, self.material))

    def _error(self, step: EmbeddedStep, read: Array) -> Array:
        """Error of the stress relative to p, and of H relative to c_p."""
        p, _, _, hardening, _ = step.end
        of_p, of_a, of_b, of_hardening, _ = step.error
        of_s = self.plane.square(of_a, of_b)
        drift = maximum(abs(of_hardening), abs(hardening - read))
        relative = drift * self.material.plasticity
        size = p + PRESSURE_SCALE
        return sqrt((of_p * of_p + of_s) / (size * size) + relative * relative)


def floored(state: Array, ends: Array, m: Material) -> Array:
    """States (4, point) of which some end at the floor, with a surface that holds it."""
    least = log((FLOOR + m.p_s) / m.first_size) / m.plasticity
    p = where(ends, FLOOR, state[0])
    a, b = where(ends, 0.0, state[1]), where(ends, 0.0, state[2])
    hardening = where(ends, maximum(state[3], least), state[3])
    return stack([p, a, b, hardening])
