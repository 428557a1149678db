"""Invariants of deviators in the plane of two given ones, s = a s_0 + b d.

Along a straight strain increment the deviatoric stress of an isotropic, coaxial model stays in the
plane of the first deviator s_0 and of the strain's deviator d. Its invariants are then polynomials
of a and b with coefficients that are computed once, in every component order alike.
"""

from typing import NamedTuple

import torch
from torch import Tensor

from granbench.models.components import TensorRows, safe_root


class DeviatorPlane(NamedTuple):
    """Coefficients (point,) of the invariants of s = a s_0 + b d.

    Parameters
    ----------
    square_0, square_1, square_2 : of q^2 = 3/2 s:s in a^2, a b and b^2
    cubic_0, ... cubic_3 : of 27/2 det(s) in a^3, a^2 b, a b^2 and b^3; empty where the Lode angle
        was not asked for
    """

    square_0: Tensor
    square_1: Tensor
    square_2: Tensor
    cubic_0: Tensor
    cubic_1: Tensor
    cubic_2: Tensor
    cubic_3: Tensor

    def square(self, a: Tensor | float, b: Tensor) -> Tensor:
        """q^2."""
        return a * (a * self.square_0 + b * self.square_1) + b * b * self.square_2

    def square_rate(self, a: Tensor | float, b: Tensor) -> Tensor:
        """d(q^2)/db, which is 3 s:d."""
        return a * self.square_1 + 2.0 * b * self.square_2

    def cubic(self, a: Tensor | float, b: Tensor) -> Tensor:
        """27/2 det(s), which is q^3 sin(3 theta)."""
        first = a * a * (a * self.cubic_0 + b * self.cubic_1)
        return first + b * b * (a * self.cubic_2 + b * self.cubic_3)

    def cubic_rate(self, a: Tensor | float, b: Tensor) -> Tensor:
        """d(27/2 det(s))/db."""
        return a * (a * self.cubic_1 + 2.0 * b * self.cubic_2) + 3.0 * b * b * self.cubic_3

    def lode_sin3(self, a: Tensor | float, b: Tensor, square: Tensor) -> Tensor:
        """sin(3 theta) where q^2 is `square`: +1 in triaxial compression, and at q = 0."""
        isotropic = square <= torch.finfo(square.dtype).tiny ** 0.5
        q = safe_root(square)
        return torch.where(isotropic, 1.0, self.cubic(a, b) / (q * q * q))

    def taken(self, points: Tensor) -> "DeviatorPlane":
        """The same of some points."""
        return DeviatorPlane(*(value[points] for value in self))


def deviator_plane(rows: TensorRows, start: Tensor, direction: Tensor, *, lode: bool) -> DeviatorPlane:
    """The plane of two deviators (component, point).

    Parameters
    ----------
    rows : their component order, of a three-dimensional model
    start, direction : s_0 and d
    lode : whether third invariants are wanted
    """
    squares = (
        1.5 * rows.contraction(start, start),
        3.0 * rows.contraction(start, direction),
        1.5 * rows.contraction(direction, direction),
    )
    if not lode:
        return DeviatorPlane(*squares, *[start.new_empty(start.shape[1])] * 4)
    of_start, of_direction = _cofactor(rows, start), _cofactor(rows, direction)
    return DeviatorPlane(
        *squares,
        4.5 * rows.contraction(of_start, start),
        13.5 * rows.contraction(of_start, direction),
        13.5 * rows.contraction(of_direction, start),
        4.5 * rows.contraction(of_direction, direction),
    )


def _cofactor(rows: TensorRows, tensor: Tensor) -> Tensor:
    """Derivative of det with respect to a symmetric tensor, (component, point)."""
    if rows.count == 3:
        x, y, z = tensor.unbind()
        return torch.stack([y * z, z * x, x * y])
    if rows.count == 4:
        x, y, xy, z = tensor.unbind()
        return torch.stack([y * z, x * z, -xy * z, x * y - xy * xy])
    x, y, z, yz, xz, xy = tensor.unbind()
    return torch.stack(
        [
            y * z - yz * yz,
            x * z - xz * xz,
            x * y - xy * xy,
            xz * xy - x * yz,
            yz * xy - y * xz,
            yz * xz - z * xy,
        ]
    )
