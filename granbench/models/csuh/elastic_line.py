"""An elastic line of stresses of CSUH, and where it leaves the yield surface."""

from typing import NamedTuple

from granbench.models.arrays import (
    Array,
    addcmul,
    at_least,
    detached,
    exp,
    maximum,
    minimum,
    ones_like,
    sqrt,
    where,
    zeros_like,
)
from granbench.models.csuh.yielding import Material, Ratio, stress_ratio
from granbench.models.lode import DeviatorPlane

ROOT_ITERATIONS = 40
ROOT_TOLERANCE = 1e-9
"""Tolerance on the share of an elastic line; one more Newton step squares the error."""


class LineEnds(NamedTuple):
    """The excess at the ends of an elastic line, (point,) each, before its root is sought.

    Parameters
    ----------
    limit : share of the line at its far end
    start, slope : excess and its rate at the near end
    last : excess at the far end
    """

    limit: Array
    start: Array
    slope: Array
    last: Array


class ElasticLine(NamedTuple):
    """Elastic stresses p + x dp and s_n + x b de for the share x of a line.

    Parameters
    ----------
    p, dp : mean stress at the start and its change, (point,), Pa
    b : factor of the strain's deviator, (point,), Pa
    plane : of the deviators s_n and de
    lode_dependent : whether M depends on the Lode angle
    """

    p: Array
    dp: Array
    b: Array
    plane: DeviatorPlane
    lode_dependent: bool

    def taken(self, points: Array) -> "ElasticLine":
        """The lines of some of the points."""
        of_points = (self.p[points], self.dp[points], self.b[points])
        return ElasticLine(*of_points, self.plane.taken(points), self.lode_dependent)

    def ratio(self, p: Array, square: Array, cubic: Array, m: Material) -> Ratio:
        """Stress ratio at a mean stress and the invariants of the deviator there."""
        return stress_ratio(p, square, cubic if self.lode_dependent else None, m)

    def _on_line(self, share: Array, size: Array, m: Material) -> tuple[Array, Array]:
        """The excess on an elastic line and its slope."""
        p, b = addcmul(self.p, share, self.dp), share * self.b
        square, cubic = self.plane.unscaled(b)
        ratio = self.ratio(p, square, cubic, m)
        excess = excess_of(p, size, square, ratio, m)
        return excess, self.slope(share, size, square, ratio, m)

    def slope(
        self,
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
        share : where on it, (point,)
        size : p_x, Pa
        square, ratio : q^2 and the stress ratio there
        m : the material
        """
        one, plane = ones_like(share), self.plane
        p, b = addcmul(self.p, share, self.dp), share * self.b
        square_rate = plane.square_slope(one, b) * self.b
        stretched = m.spacing * size / p
        of_square = (1.0 + stretched) * square_rate
        if self.lode_dependent:
            turning = plane.cubic_slope(one, b) * self.b / ratio.q
            turning = turning - 1.5 * (7.0 - ratio.seven) * square_rate
            of_square = of_square - 2.0 * (1.0 + stretched) * turning / ratio.seven
        of_square = of_square - stretched * square * self.dp / p
        return (2.0 * p - size) * self.dp + ratio.slope * ratio.slope * of_square

    def root(self, size: Array, m: Material, ends: LineEnds) -> Array:
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
            excess, slope = self._on_line(share, size, m)
            within = excess < 0.0
            low, high = where(within, share, low), where(within, high, share)
            step = excess / slope
            share = share - step
            if (abs(step) < ROOT_TOLERANCE).all():
                break
        return minimum(maximum(share, low), high)

    def met(self, hardening: Array, share: Array, m: Material) -> Array:
        """The share of the root after one more Newton step, which carries the gradients."""
        excess, slope = self._on_line(share, surface_size(hardening, m), m)
        return share - excess / detached(slope)


def excess_of(p: Array, size: Array, square: Array, ratio: Ratio, m: Material) -> Array:
    """p^2 - p_x p + q^2 (1 + chi p_x/p)/M^2, Pa^2: positive outside of the surface p_x = `size`."""
    reduced = ratio.slope * ratio.slope * square
    return addcmul(p * (p - size), reduced, 1.0 + m.spacing * size / p)


def surface_size(hardening: Array, m: Material) -> Array:
    """Size p_x of the yield surface, Pa."""
    return m.first_size * exp(hardening * m.plasticity) - m.p_s
