r"""Von Mises plasticity whose yield stress grows with the Frobenius norm of the plastic strain.

Common to `j2-hardening` and `ime`, which give the moduli and the law Y of the yield stress.

    elasticity   sigma_trial = sigma_n + K d eps_v I + 2 G de
    yield        f = q - Y(||eps^p||_F) <= 0
    flow         d eps^p = x n,   n = s_trial/|s_trial|,   x = ||d eps^p||_F >= 0
    return       s = s_trial Y/q_trial

``||eps^p||_F = sqrt(eps^p : eps^p)`` is the norm of the plastic strain *tensor*, as Eq 6.33 and
7.15 differentiate it, and not the length of the path that it took: on a reversal it falls, and
so does the yield stress. With k = q/|s| the implicit return leaves one equation in x,

    r(x) = q_trial - 2 G k x - Y(y(x)) = 0,   y = sqrt(eps^p:eps^p + 2 x eps^p:n + x^2),

    dr/dx = -2 G k - Y'(y) (eps^p:n + x)/y,

positive at x = 0 and negative at x = |s_trial|/2G, where it would take the whole deviator away.
"""

import abc
from typing import NamedTuple

import torch
from torch import Tensor

from granbench.models.arrays import Array, addcmul, cat, where, zeros_like
from granbench.models.classical import ClassicalCell
from granbench.models.components import outer, safe_root
from granbench.models.parameters import Constants
from granbench.models.return_mapping import consistent_root, elastic_trial, exceeds


class Return(NamedTuple):
    """A radial return.

    Parameters
    ----------
    after : state after it
    deviator : s_trial, (component, point), Pa
    plastic_strain : before it, (component, point)
    yielding : (point,), whether the point yields
    flow : x of the module, (point,)
    """

    after: Array
    deviator: Array
    plastic_strain: Array
    yielding: Array
    flow: Array


class HardeningCell(ClassicalCell):
    """Von Mises plasticity with hardening; see the module for its equations."""

    internal_tensors = ("plastic_strain",)
    numpy_updates = True

    @abc.abstractmethod
    def strength(self, c: Constants, norm: Array) -> tuple[Array, Array]:
        """Yield stress Y at a norm of the plastic strain (point,), and its slope Y', Pa."""

    def update(self, dstrain: Array, state: Array, c: Constants) -> Array:
        """See `ClassicalCell.update`."""
        return self._return(c, dstrain, state).after

    def _return(self, c: Constants, dstrain: Array, state: Array) -> Return:
        rows = self.rows
        stress, plastic_strain = state[: rows.count], state[rows.count :]
        trial = elastic_trial(rows, stress, dstrain, c)
        p, s = rows.split(trial)
        q = rows.deviatoric_stress(s)
        before = rows.contraction(plastic_strain, plastic_strain)
        norm = safe_root(before)
        strength, slope = self.strength(c, norm)
        yielding = exceeds(q, strength, strength)
        if not yielding.any():
            return Return(cat([trial, plastic_strain]), s, plastic_strain, yielding, zeros_like(q))

        k = rows.square_factor**0.5
        stiffness = k * c.twice_shear
        per_size = k / q  # 1/|s_trial|
        along = per_size * rows.contraction(plastic_strain, s)
        twice_along = 2.0 * along

        def residual(x: Array) -> tuple[Array, Array]:
            y = safe_root(addcmul(before, x, x + twice_along))
            strength, slope = self.strength(c, y)
            excess = addcmul(q - strength, x, stiffness, value=-1.0)
            return excess, -stiffness - slope * ((along + x) / y)

        first = (q - strength) / (stiffness + slope * (along / norm))
        elastic = q / stiffness
        x = consistent_root(residual, yielding, first, elastic, elastic)

        flowed = addcmul(plastic_strain, s, per_size * x)
        strength, _ = self.strength(c, safe_root(rows.contraction(flowed, flowed)))
        stress = where(yielding, rows.joined(p, s, strength / q), trial)
        return Return(cat([stress, flowed]), s, plastic_strain, yielding, x)

    def update_and_tangent(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `ClassicalCell.update_and_tangent`.

        sigma = p I + r s_trial with r = 1 - 2 G k x/q_trial. From the consistency equation

            h dx = dq_trial - (Y' x/y) db,   h = -dr/dx,   b = eps^p:n
            dq_trial = 2 G k n,   db = 2 G (dev eps^p - b n)/|s_trial|
        """
        c, rows = self.constants(), self.rows
        after, s, plastic_strain, yielding, x = self._return(c, dstrain, state)
        q, k = rows.deviatoric_stress(s), rows.square_factor**0.5
        stiffness = k * c.twice_shear
        direction = s * (k / q)
        along = rows.contraction(plastic_strain, direction)
        flowed = after[rows.count :]
        y = safe_root(rows.contraction(flowed, flowed))
        slope = self.strength(c, y)[1]
        dq = stiffness * rows.weight * direction
        db = (stiffness / q) * rows.weight * (rows.deviator(plastic_strain) - along * direction)
        dx = (dq - slope * x / y * db) / (stiffness + slope * (along + x) / y)
        dratio = torch.where(yielding, (x / q * dq - dx) * (stiffness / q), 0.0)
        return after, (
            c.bulk * rows.spherical
            + c.twice_shear * (1.0 - stiffness * x / q) * rows.deviatoric
            + outer(s, dratio)
        )
