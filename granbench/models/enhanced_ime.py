r"""`enhanced-ime`: IME with friction, dilation, volumetric hardening and a stiffness that changes.

    elasticity   d sigma = K d eps_v^e I + 2 G de^e at fixed nu,
                 E = E_0 (1 + eps_v^p)^n_E                                           (Eq 7.16)
    yield        f = C_p p + sigma_v - H - sigma_0                                   (Eq 7.17)
    hardening    H = A (eps_0 + eps_s^p)^B + C (eps_0p + <eps_v^p>)^D                (Eq 7.18)
    flow         dg/dp = C_d + C_p,   dg/dsigma_v = 1                                (Eq 7.19)

with sigma_v = sqrt(3/2 s:s), eps_s^p = sqrt(2/3 e^p:e^p), compression positive. Friction is a
negative C_p, and dissipation is never negative for C_d >= 0. What the source leaves open:

- Table 7.2 has C_p < 0, which is friction only with p positive in compression. Then plastic
  strain dilates by -(C_d + C_p) and a denser material (eps_v^p > 0) is stiffer for n_E > 0.
- Eq 7.18 takes a power of a negative number as soon as dilation passes eps_0p. Here only
  compaction hardens: <eps_v^p> is eps_v^p or, where that is negative, zero.
- Eq 7.12 states elasticity in total strain; with a stiffness that plastic strain changes, the
  stress would change without elastic strain. Here elasticity is a law of rates.
- Eq 7.17 has an apex at p = (H + sigma_0)/C_p, which the source does not treat. There the deviator
  is used up and the plastic strain goes along the axis, in the direction of C_p.

The return is implicit in one scalar, the plastic multiplier mu, for given moduli: with t the
smaller of mu and q_trial/3G, where the deviator is used up,

    r(mu) = C_p p + q - H - sigma_0 = 0,   q = q_trial - 3 G t,   p = p_trial - K d eps_v^p,
    d eps_v^p = (C_d + C_p) t + C_p (mu - t),   de^p = t 3/2 s_trial/q_trial.

It is made twice: with E of the state before, then with E at the middle of the eps_v^p that this
gave, so that the stiffness is followed to second order.
"""

import math
from collections.abc import Mapping
from typing import ClassVar

import torch
from torch import Tensor

from granbench.models.arrays import (
    Array,
    addcmul,
    at_least,
    cat,
    minimum,
    power,
    rounding_unit,
    where,
    zeros_like,
)
from granbench.models.classical import ClassicalCell
from granbench.models.components import safe_root
from granbench.models.parameters import Constants, Parameter
from granbench.models.return_mapping import (
    consistent_root,
    elastic_constants,
    elastic_trial,
    exceeds,
)

STEEPEST = 3.0
"""Slope beyond which no stress in triaxial compression, where q < 3 p, could yield."""

LEAST_SLOPE = 1e-9
"""Value of C_p below which the surface is a cylinder without an apex."""

KINK_ROUNDINGS = 4.0
"""A compaction of so many unit roundings is what the sum of three plastic strains leaves of none.
Where C_d = -C_p, eps_v^p stays at zero, where Eq 7.18 has a kink: the derivatives there are those
of dilation, not of whichever side the last bit fell on."""

TINY = 1e-30
"""Pa; it gives a cylinder, C_p = 0, no flow along the axis instead of 0/0."""


class EnhancedIME(ClassicalCell):
    """IME with friction and dilation; see the module for its equations."""

    name = "enhanced-ime"
    title = "Enhanced IME: friction, dilation, changing stiffness"
    numpy_updates = True
    parameter_table = (
        Parameter("young_modulus", "E_0", "Pa", "first Young's modulus"),
        Parameter("poisson_ratio", "nu", "1", "Poisson's ratio", -1.0, 0.5),
        Parameter("stiffness_exponent", "n_E", "1", "exponent of stiffness", -torch.inf),
        Parameter("yield_stress", "sigma_0", "Pa", "part of the yield stress that stays"),
        Parameter("pressure_slope", "C_p", "1", "minus the friction slope", -STEEPEST, STEEPEST),
        Parameter("flow_slope", "C_d", "1", "dg/dp beyond C_p", -STEEPEST, STEEPEST),
        Parameter("shear_hardening_modulus", "A", "Pa", "hardening at a shear strain of one"),
        Parameter("shear_hardening_exponent", "B", "1", "exponent of hardening", -torch.inf),
        Parameter("shear_hardening_strain", "eps_0", "1", "shear strain where hardening begins"),
        Parameter("volumetric_hardening_modulus", "C", "Pa", "hardening at a compaction of one"),
        Parameter("volumetric_hardening_exponent", "D", "1", "exponent of hardening"),
        Parameter(
            "volumetric_hardening_strain", "eps_0p", "1", "compaction where hardening begins"
        ),
    )
    internal_tensors = ("plastic_strain",)
    parameter_sets: ClassVar[Mapping[str, Mapping[str, float]]] = {
        "guan2023-tab7.2-original": {
            "young_modulus": 2e7,
            "poisson_ratio": 0.2,
            "stiffness_exponent": 0.1,
            "yield_stress": 1e4,
            "pressure_slope": -0.1,
            "flow_slope": 0.1,
            "shear_hardening_modulus": 3e5,
            "shear_hardening_exponent": 0.2,
            "shear_hardening_strain": 0.02,
            "volumetric_hardening_modulus": 3e5,
            "volumetric_hardening_exponent": 0.2,
            "volumetric_hardening_strain": 0.02,
        },
        "guan2023-tab7.2-optimised": {
            "young_modulus": 4.81e8,
            "poisson_ratio": 0.216,
            "stiffness_exponent": -3.54,
            "yield_stress": 5.17e-6,
            "pressure_slope": -0.512,
            "flow_slope": 0.155,
            "shear_hardening_modulus": 34.5,
            "shear_hardening_exponent": -2.23,
            "shear_hardening_strain": 2.79e-2,
            "volumetric_hardening_modulus": 8.35e-5,
            "volumetric_hardening_exponent": 0.424,
            "volumetric_hardening_strain": 8.83e-4,
        },
    }

    def derived(self, c: Constants) -> dict[str, Tensor]:
        """See `ClassicalCell.derived`; moduli per Pa of Young's modulus, and C_g = C_d + C_p."""
        return {
            "bulk_share": 1.0 / (3.0 - 6.0 * c.poisson_ratio),
            "shear_share": 1.0 / (2.0 + 2.0 * c.poisson_ratio),
            "potential_slope": c.flow_slope + c.pressure_slope,
        }

    def update(self, dstrain: Array, state: Array, c: Constants) -> Array:
        """See `ClassicalCell.update`."""
        rows = self.rows
        compaction = rows.trace(state[rows.count :])
        start = zeros_like(compaction)
        after, mu = self._return(c, self._elastic(c, compaction), dstrain, state, start)
        middle = 0.5 * (compaction + rows.trace(after[rows.count :]))
        after, _ = self._return(c, self._elastic(c, middle), dstrain, state, mu)
        return after

    def _elastic(self, c: Constants, compaction: Array) -> Constants:
        """Constants of Hooke's law (point,) at a plastic volumetric strain (point,), Eq 7.16."""
        young = c.young_modulus * power(1.0 + compaction, c.stiffness_exponent)
        moduli = elastic_constants(c.bulk_share * young, c.shear_share * young, 3)
        return Constants(**moduli)

    def _return(
        self,
        c: Constants,
        elastic: Constants,
        dstrain: Array,
        state: Array,
        start: Array,
    ) -> tuple[Array, Array]:
        """State after the return of a trial stress with given moduli, and mu, sought from `start`.

        Where the material has more than doubled its volume, Eq 7.16 has no stiffness: NaN.
        """
        rows = self.rows
        stress, plastic_strain = state[: rows.count], state[rows.count :]
        trial = elastic_trial(rows, stress, dstrain, elastic)
        p, s = rows.split(trial)
        q = rows.deviatoric_stress(s)
        direction = s * (1.5 / q)
        compaction, sheared = self._compaction_and_shear(plastic_strain)
        before = rows.contraction(sheared, sheared)
        along = rows.contraction(sheared, direction)
        stiffness = 1.5 * elastic.twice_shear
        used_up = q / stiffness

        def swept(mu: Array) -> tuple[Array, Array]:
            """t and d eps_v^p of the module."""
            t = minimum(mu, used_up)
            return t, c.potential_slope * t + c.pressure_slope * (mu - t)

        def residual(mu: Array) -> tuple[Array, Array]:
            t, volume = swept(mu)
            at_apex = mu >= used_up
            shear = safe_root((before + t * (2.0 * along + 1.5 * t)) / 1.5)
            strength, by_shear, by_volume = self._strength(c, shear, compaction + volume)
            excess = c.pressure_slope * (p - elastic.bulk * volume) + q - stiffness * t - strength
            volume_rate = where(at_apex, c.pressure_slope, c.potential_slope)
            shear_rate = (along + 1.5 * t) / (1.5 * shear)
            slope = (c.pressure_slope * elastic.bulk + by_volume) * volume_rate
            return excess, -slope - where(at_apex, 0.0, stiffness + by_shear * shear_rate)

        strength = self._strength(c, safe_root(before / 1.5), compaction)[0]
        limit = strength - c.pressure_slope * p
        yielding = exceeds(q, limit, q + strength)
        # Past the deviator, p alone brings r down to -H - sigma_0.
        left = at_least(c.pressure_slope * (p - elastic.bulk * c.potential_slope * used_up), 0.0)
        along_axis = left / (elastic.bulk * c.pressure_slope**2 + TINY)
        scale = (q + strength) / stiffness
        mu = consistent_root(residual, yielding, start, used_up + along_axis, scale)

        t, volume = swept(mu)
        flowed = addcmul(plastic_strain, direction, t)
        flowed = rows.shifted(flowed, volume / 3.0)
        # The strength of the rows as the next step will find them puts f at zero to rounding.
        compaction, sheared = self._compaction_and_shear(flowed)
        shear = safe_root(rows.contraction(sheared, sheared) / 1.5)
        strength = self._strength(c, shear, compaction)[0]
        slope = where(abs(c.pressure_slope) < LEAST_SLOPE, 1.0, c.pressure_slope)
        p = where(mu > used_up, strength / slope, p - elastic.bulk * volume)
        ratio = at_least(strength - c.pressure_slope * p, 0.0) / q
        stress = where(yielding, rows.joined(p, s, ratio), trial)
        stress = where(compaction > -1.0, stress, math.nan)
        return cat([stress, flowed]), mu

    def _compaction_and_shear(self, plastic_strain: Array) -> tuple[Array, Array]:
        """eps_v^p (point,) and e^p (component, point)."""
        third, sheared = self.rows.split(plastic_strain)
        return 3.0 * third, sheared

    def _strength(
        self, c: Constants, shear: Array, compaction: Array
    ) -> tuple[Array, Array, Array]:
        """H + sigma_0 and its derivatives by eps_s^p and eps_v^p, Pa (Eq 7.18)."""
        sheared = c.shear_hardening_strain + shear
        by_shear = c.shear_hardening_modulus * power(sheared, c.shear_hardening_exponent)
        compacts = compaction > KINK_ROUNDINGS * rounding_unit(compaction)
        compacted = c.volumetric_hardening_strain + where(compacts, compaction, 0.0)
        by_volume = c.volumetric_hardening_modulus * power(
            compacted, c.volumetric_hardening_exponent
        )
        return (
            c.yield_stress + by_shear + by_volume,
            c.shear_hardening_exponent * by_shear / sheared,
            where(compacts, c.volumetric_hardening_exponent * by_volume / compacted, 0.0),
        )
