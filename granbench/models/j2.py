r"""`j2`: perfect von Mises plasticity, by radial return.

    elasticity   p = p_n + K d eps_v,   s_trial = s_n + 2 G de          (Eq 6.27)
    yield        f = q - sigma_Y <= 0                                   (Eq 6.26)
    return       s = s_trial min(1, sigma_Y / q_trial)                  (Eq 7.37)

In the plane (the thesis' chapter 6) p = tr/2, K and G are two-dimensional moduli and
q = sqrt(2 s:s), so that the strength without lateral stress is sigma_Y; with 3-D components
p = tr/3 and q = sqrt(3/2 s:s).
"""

from collections.abc import Mapping
from typing import ClassVar

import torch
from torch import Tensor

from granbench.models.arrays import Array, where
from granbench.models.classical import ClassicalCell
from granbench.models.components import outer
from granbench.models.parameters import Constants, Parameter
from granbench.models.return_mapping import elastic_constants, elastic_trial, exceeds


class J2(ClassicalCell):
    """Perfect von Mises plasticity; see the module for its equations."""

    name = "j2"
    title = "J2, perfectly plastic"
    dimension = 2
    numpy_updates = True
    parameter_table = (
        Parameter("bulk_modulus", "K", "Pa", "bulk modulus"),
        Parameter("shear_modulus", "G", "Pa", "shear modulus"),
        Parameter("yield_stress", "sigma_Y", "Pa", "yield stress"),
    )
    parameter_sets: ClassVar[Mapping[str, Mapping[str, float]]] = {
        # E = 2 MPa, nu = 0.2: K = E/(2(1 - nu)), G = E/(2(1 + nu)).
        "guan2023-sec6.6": {
            "bulk_modulus": 1.25e6,
            "shear_modulus": 2e6 / 2.4,
            "yield_stress": 1e5,
        },
    }

    def derived(self, c: Constants) -> dict[str, Tensor]:
        """See `ClassicalCell.derived`."""
        return elastic_constants(c.bulk_modulus, c.shear_modulus, self.rows.dimension)

    def update(self, dstrain: Array, state: Array, c: Constants) -> Array:
        """See `ClassicalCell.update`."""
        return self._return(c, dstrain, state)[0]

    def _return(self, c: Constants, dstrain: Array, state: Array) -> tuple[Array, ...]:
        """Stress after the return, s_trial, where it yields, and sigma_Y/q_trial there."""
        rows = self.rows
        trial = elastic_trial(rows, state, dstrain, c)
        p, s = rows.split(trial)
        q = rows.deviatoric_stress(s)
        yielding = exceeds(q, c.yield_stress, c.yield_stress)
        ratio = c.yield_stress / q
        after = where(yielding, rows.joined(p, s, ratio), trial)
        return after, s, yielding, ratio

    def update_and_tangent(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `ClassicalCell.update_and_tangent`.

        s = r s_trial with r = sigma_Y/q, so that dr = -r dq/q, where, as k = q^2/s:s is
        constant, dq = 2 G k (s_trial:de)/q.
        """
        c, rows = self.constants(), self.rows
        after, s, yielding, ratio = self._return(c, dstrain, state)
        ratio = torch.where(yielding, ratio, 1.0)
        drop = c.twice_shear * rows.square_factor * ratio**3 / c.yield_stress**2
        return after, (
            c.bulk * rows.spherical
            + c.twice_shear * ratio * rows.deviatoric
            - torch.where(yielding, drop, 0.0) * outer(s, rows.weight * s)
        )
