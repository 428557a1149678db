"""Contact material of the grains, and the time steps for which it is stable."""

from __future__ import annotations

import math

from pydantic import BaseModel, ConfigDict, Field

RAYLEIGH_FRACTION = 0.2
"""Time step over the Rayleigh time; a five times smaller step gives the same stress paths."""

STIFFNESS_PENALTY = 0.01
"""beta of Eq 2.8; 0.01 reproduces every time step of Table 2.3 of the thesis."""


class ContactMaterial(BaseModel):
    """Hertz-Mindlin grains with rolling resistance (thesis Sec 2.1.2).

    Parameters
    ----------
    density : kg/m3
    young_modulus : Pa
    poisson_ratio : 1
    friction : 1, sliding friction coefficient while a specimen is sheared
    rolling_friction : 1
    restitution : 1
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    density: float = Field(2600.0, gt=0)
    young_modulus: float = Field(0.8e9, gt=0)
    poisson_ratio: float = Field(0.12, ge=0, lt=0.5)
    friction: float = Field(0.4, ge=0)
    rolling_friction: float = Field(0.05, ge=0)
    restitution: float = Field(0.5, gt=0, le=1)

    def rayleigh_time_step(self, smallest_radius: float) -> float:
        """Return the Rayleigh time of the smallest grain, s, from its radius, m."""
        shear_modulus = self.young_modulus / (2 * (1 + self.poisson_ratio))
        travel = math.pi * smallest_radius * math.sqrt(self.density / shear_modulus)
        return travel / (0.163 * self.poisson_ratio + 0.8766)

    def critical_time_step(self, smallest_radius: float) -> float:
        """Return the critical time step of Eq 2.8, s, from the smallest radius, m."""
        mass = self.density * 4 / 3 * math.pi * smallest_radius**3
        stiffness = self.young_modulus / (3 * (1 + 2 * self.poisson_ratio)) * STIFFNESS_PENALTY
        return 0.2 * math.pi * math.sqrt(mass / stiffness)

    def time_step(self, smallest_radius: float) -> float:
        """Return the time step of the simulations, s: the smaller of the two bounds.

        The Rayleigh bound decreases as d and that of Eq 2.8 as d^1.5, which governs for grains
        below 3.6 mm.

        Parameters
        ----------
        smallest_radius : m
        """
        return min(
            RAYLEIGH_FRACTION * self.rayleigh_time_step(smallest_radius),
            self.critical_time_step(smallest_radius),
        )
