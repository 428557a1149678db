r"""`drucker-prager`: perfect, cohesionless, non-associated; return to the cone or to its apex.

    elasticity   p = p_n + K (d eps_v - d eps_v^p),   s = s_n + 2 G (de - de^p)
    yield        f = q - M p <= 0                                                (Eq 6.28)
    flow         d eps^p = d lambda (k s/q - M_d I / dim),  k = q^2/s:s          (Eq 6.29)
    consistency  d lambda = f_trial / (2 k G + K M M_d)                          (Eq 6.31)
    cone         p = p_trial + K M_d d lambda,   s = s_trial M p / q_trial
    apex         sigma = 0 where the cone would give q < 0

In the plane (the thesis' chapter 6) k = 2, dim = 2, M = 2 sin(friction angle) and
M_d = 2 sin(dilation angle); with 3-D components k = 3/2, dim = 3 and M is the slope in triaxial
compression. For dissipation never to be negative, M_d must not exceed M.

Eq 6.31 follows one linear step; here it is exact, for f and the flow are linear on the cone. At
the apex the plastic strain is what takes the whole trial stress away: beyond the point where the
flow from the cone has used the deviator up, the rest is dilation.
"""

import math
from collections.abc import Mapping
from typing import ClassVar

import torch
from torch import Tensor

from granbench.models.arrays import Array, addcmul, at_least, where
from granbench.models.classical import ClassicalCell
from granbench.models.components import outer
from granbench.models.parameters import Constants, Parameter
from granbench.models.return_mapping import elastic_constants, elastic_trial, exceeds

STEEPEST = 3.0
"""Slope beyond which no stress in triaxial compression, where q < 3 p, could yield."""

NO_STRESS = 1e-9
"""Pa; a yield function below it is zero. It keeps the stress-free apex where it is."""


class DruckerPrager(ClassicalCell):
    """Drucker-Prager plasticity without hardening; see the module for its equations."""

    name = "drucker-prager"
    title = "Drucker-Prager, perfectly plastic"
    dimension = 2
    numpy_updates = True
    pressure_dependent = True
    holds_without_stress = True
    parameter_table = (
        Parameter("bulk_modulus", "K", "Pa", "bulk modulus"),
        Parameter("shear_modulus", "G", "Pa", "shear modulus"),
        Parameter("friction_slope", "M", "1", "slope of the yield surface", upper=STEEPEST),
        Parameter(
            "dilation_slope", "M_d", "1", "slope of the plastic potential", -STEEPEST, STEEPEST
        ),
    )
    parameter_sets: ClassVar[Mapping[str, Mapping[str, float]]] = {
        # E = 2 MPa, nu = 0.2 as for `j2`; friction 15 and dilation 8 degrees.
        "guan2023-sec6.6": {
            "bulk_modulus": 1.25e6,
            "shear_modulus": 2e6 / 2.4,
            "friction_slope": 2.0 * math.sin(math.radians(15.0)),
            "dilation_slope": 2.0 * math.sin(math.radians(8.0)),
        },
    }

    def derived(self, c: Constants) -> dict[str, Tensor]:
        """See `ClassicalCell.derived`; `dp_df` is K M_d / (2 k G + K M M_d), dp/df of the return.

        It is NaN where the flow would be so contractive that f grows with it.
        """
        elastic = elastic_constants(c.bulk_modulus, c.shear_modulus, self.rows.dimension)
        contraction = c.bulk_modulus * c.dilation_slope
        stiffness = (
            self.rows.square_factor * elastic["twice_shear"] + contraction * c.friction_slope
        )
        dp_df = contraction / torch.where(stiffness > 0.0, stiffness, torch.nan)
        return {**elastic, "dp_df": dp_df}

    def update(self, dstrain: Array, state: Array, c: Constants) -> Array:
        """See `ClassicalCell.update`."""
        return self._return(c, dstrain, state)[0]

    def _return(self, c: Constants, dstrain: Array, state: Array) -> tuple[Array, ...]:
        """Stress after the return, s_trial, where it yields, and p and q/q_trial there."""
        rows = self.rows
        trial = elastic_trial(rows, state, dstrain, c)
        p, s = rows.split(trial)
        q = rows.deviatoric_stress(s)
        yielding = exceeds(q, c.friction_slope * p + NO_STRESS, q)
        f = addcmul(q, c.friction_slope, p, value=-1.0)
        on_cone = addcmul(p, f, c.dp_df)
        returned = at_least(on_cone, 0.0)  # below is the apex, p = 0: zero to the last bit
        ratio = c.friction_slope * returned / q
        after = where(yielding, rows.joined(returned, s, ratio), trial)
        return after, s, yielding, returned, ratio

    def update_and_tangent(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `ClassicalCell.update_and_tangent`.

        sigma = p I + r s_trial with r = M p/q_trial, whose derivatives by the strain are

            dq_trial = 2 G k s_trial/q_trial,   dp_trial = K I
            dp = dp_trial + K M_d (dq_trial - M dp_trial)/(2 k G + K M M_d), or 0 at the apex
            dr = (M dp - r dq_trial)/q_trial
        """
        c, rows = self.constants(), self.rows
        after, s, yielding, returned, ratio = self._return(c, dstrain, state)
        q = rows.deviatoric_stress(s)
        dq = c.twice_shear * rows.square_factor / q * (rows.weight * s)
        dp_trial = c.bulk * rows.normal
        df = dq - c.friction_slope * dp_trial
        dp = torch.where(returned > 0.0, dp_trial + c.dp_df * df, 0.0)
        dratio = (c.friction_slope * dp - ratio * dq) / q
        elastic = c.bulk * rows.spherical + c.twice_shear * rows.deviatoric
        cone = (
            outer(rows.normal, dp) + outer(s, dratio) + c.twice_shear * ratio * rows.deviatoric
        )  # fmt: skip
        return after, torch.where(yielding, cone, elastic)
