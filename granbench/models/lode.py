"""Invariants of the deviators a s_0 + b d in a plane, in every component order.

Along a straight strain increment the deviatoric stress of an isotropic, coaxial model stays in the
plane of the first deviator s_0 and of the strain's deviator d. Its invariants are polynomials of a
and b with coefficients that are computed once.
"""

from typing import NamedTuple

from granbench.models.arrays import Array, addcmul, at_least, stack, zeros_like
from granbench.models.components import TensorRows, safe_root
from granbench.tensors import cofactor_rows

ISOTROPIC = 1e-3
"""Pa; a lesser q is the rounding of an isotropic stress and has no Lode angle."""


class DeviatorPlane(NamedTuple):
    """Coefficients (point,) of the invariants of a s_0 + b d.

    Parameters
    ----------
    square_0, square_1, square_2 : of q^2 = 3/2 s:s in a^2, a b and b^2
    cubic_0, ... cubic_3 : of q^3 sin(3 theta) = 27/2 det(s) in a^3, a^2 b, a b^2 and b^3; zero
        where the Lode angle is not needed
    """

    square_0: Array
    square_1: Array
    square_2: Array
    cubic_0: Array
    cubic_1: Array
    cubic_2: Array
    cubic_3: Array

    def square(self, a: Array, b: Array) -> Array:
        """q^2."""
        first = a * addcmul(a * self.square_0, b, self.square_1)
        return addcmul(first, b * b, self.square_2)

    def square_slope(self, a: Array, b: Array) -> Array:
        """d(q^2)/db, which is 3 s:d."""
        return addcmul(a * self.square_1, b, self.square_2, value=2.0)

    def cubic(self, a: Array, b: Array) -> Array:
        """q^3 sin(3 theta)."""
        first = a * a * addcmul(a * self.cubic_0, b, self.cubic_1)
        return addcmul(first, b * b, addcmul(a * self.cubic_2, b, self.cubic_3))

    def cubic_slope(self, a: Array, b: Array) -> Array:
        """d(q^3 sin(3 theta))/db."""
        first = a * addcmul(a * self.cubic_1, b, self.cubic_2, value=2.0)
        return addcmul(first, b * b, self.cubic_3, value=3.0)

    def unscaled(self, b: Array) -> tuple[Array, Array]:
        """`square` and `cubic` at a = 1."""
        square = addcmul(self.square_1, b, self.square_2)
        cubic = addcmul(self.cubic_2, b, self.cubic_3)
        cubic = addcmul(self.cubic_1, b, cubic)
        return addcmul(self.square_0, b, square), addcmul(self.cubic_0, b, cubic)

    def taken(self, points: Array) -> "DeviatorPlane":
        """Coefficients of some of the points."""
        return DeviatorPlane(*(value[points] for value in self))


def lode_sin3(square: Array, cubic: Array) -> tuple[Array, Array]:
    """Sin(3 theta) from q^2 and q^3 sin(3 theta), and q, never zero.

    +1 in triaxial compression and, by convention, at an isotropic stress.
    """
    q = safe_root(square)
    return (cubic + ISOTROPIC**3) / at_least(square * q, ISOTROPIC**3), q


def deviator_plane(
    rows: TensorRows, start: Array, direction: Array, *, lode: bool
) -> DeviatorPlane:
    """The plane of two deviators.

    Parameters
    ----------
    rows : their component order, of a three-dimensional model
    start, direction : s_0 and d, (component, point)
    lode : whether third invariants are wanted
    """
    squares = (
        rows.deviatoric_square(start),
        3.0 * rows.contraction(start, direction),
        rows.deviatoric_square(direction),
    )
    if not lode:
        return DeviatorPlane(*squares, *[zeros_like(squares[0])] * 4)
    of_start, of_direction = (stack(cofactor_rows(part)) for part in (start, direction))
    return DeviatorPlane(
        *squares,
        4.5 * rows.contraction(of_start, start),
        13.5 * rows.contraction(of_start, direction),
        13.5 * rows.contraction(of_direction, start),
        4.5 * rows.contraction(of_direction, direction),
    )
