r"""`modified-cam-clay`: CSUH at chi = 0, p_s = 0 and M_f = M_c = M, which CSUH extends.

    yield      q^2 = M^2 p (p_c - p)
    flow       associated
    hardening  d ln p_c = (1 + e0)/(lambda - kappa) d eps_v^p
    state      e = N - lambda ln p_c + kappa ln(p_c/p),  p in kPa

N = Z makes p_s zero. M_f = M_c = M turns the hardening rule of CSUH into dH = d eps_v^p
(`state_dependent`), and the yield surface begins at the preconsolidation pressure p_x0 = p_c
that e0 or the overconsolidation ratio implies, instead of running through the first stress:
inside, the material is elastic. M does not depend on the Lode angle, as in Roscoe and Burland.

References
----------
Roscoe & Burland (1968), On the generalised stress-strain behaviour of wet clay.
"""

from collections.abc import Mapping
from typing import ClassVar

import torch
from torch import Tensor

from granbench.models.csuh import CSUH
from granbench.models.parameters import Constants

_SHARED = (
    "critical_ratio",
    "compression_slope",
    "swelling_slope",
    "poisson_ratio",
    "compression_intercept",
)


class ModifiedCamClay(CSUH):
    """Modified Cam-clay; without a given density, a point begins normally consolidated."""

    name = "modified-cam-clay"
    title = "Modified Cam-Clay"
    lode_dependent = False
    state_dependent = False
    parameter_table = tuple(
        parameter for parameter in CSUH.parameter_table if parameter.name in _SHARED
    )
    parameter_sets: ClassVar[Mapping[str, Mapping[str, float]]] = {
        "guan2023-tab7.3-original": {
            name: CSUH.parameter_sets["guan2023-tab7.3-original"][name] for name in _SHARED
        },
    }

    def derived(self, c: Constants) -> dict[str, Tensor]:
        """See `ClassicalCell.derived`; with the parameters of CSUH that this limit fixes."""
        c.low_pressure_intercept = c.compression_intercept
        c.critical_spacing = c.dilatancy = torch.zeros_like(c.critical_ratio)
        c.overconsolidation_ratio = torch.ones_like(c.critical_ratio)
        return super().derived(c)

    def _first_size(self, through: Tensor, density: Tensor, c: Constants) -> Tensor:
        """p_c, Pa, on whose surface the void ratio would be the loosest; `density` is e_eta - e."""
        return through * torch.exp(density.clamp(min=0.0) / c.plastic)
