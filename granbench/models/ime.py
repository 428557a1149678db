r"""`ime`: isotropic elasticity, von Mises yield, exponential hardening; three-dimensional.

    elasticity   sigma = K eps_v I + 2 G e,  K = E/(3(1 - 2 nu)),  G = E/(2(1 + nu))    (Eq 7.12)
    yield        f = sigma_v - sigma_0 - A (eps_0 + ||eps^p||_F)^n,
                 sigma_v = sqrt(3/2 s:s)                                         (Eq 5.10, 7.12)

The rest, with the consistency equation, is in `granbench.models.hardening`. In the `plane` order
the strain zz is zero and its stress is carried on. Section 5.2.1 and Table 7.1 of the thesis
differ in sigma_0 only; both are parameter sets.
"""

from collections.abc import Mapping
from typing import ClassVar

from torch import Tensor

from granbench.models.arrays import Array, power
from granbench.models.hardening import HardeningCell
from granbench.models.parameters import Constants, Parameter
from granbench.models.return_mapping import elastic_constants

_SECTION_5_2_1 = {
    "young_modulus": 20e6,
    "poisson_ratio": 0.2,
    "yield_stress": 1e3,
    "hardening_modulus": 0.3e6,
    "hardening_strain": 0.02,
    "hardening_exponent": 0.2,
}


class IME(HardeningCell):
    """Von Mises plasticity with exponential hardening; see the module for its equations."""

    name = "ime"
    title = "IME: von Mises with exponential hardening"
    parameter_table = (
        Parameter("young_modulus", "E", "Pa", "Young's modulus"),
        Parameter("poisson_ratio", "nu", "1", "Poisson's ratio", -1.0, 0.5),
        Parameter("yield_stress", "sigma_0", "Pa", "part of the yield stress that stays"),
        Parameter("hardening_modulus", "A", "Pa", "hardening at a strain of one"),
        Parameter("hardening_strain", "eps_0", "1", "strain at which hardening begins"),
        Parameter("hardening_exponent", "n", "1", "exponent of hardening"),
    )
    parameter_sets: ClassVar[Mapping[str, Mapping[str, float]]] = {
        "guan2023-sec5.2.1": _SECTION_5_2_1,
        "guan2023-tab7.1": {**_SECTION_5_2_1, "yield_stress": 0.1e6},
    }

    def derived(self, c: Constants) -> dict[str, Tensor]:
        """See `ClassicalCell.derived`."""
        bulk = c.young_modulus / (3.0 - 6.0 * c.poisson_ratio)
        shear = c.young_modulus / (2.0 + 2.0 * c.poisson_ratio)
        return elastic_constants(bulk, shear, self.rows.dimension)

    def strength(self, c: Constants, norm: Array) -> tuple[Array, Array]:
        """See `HardeningCell.strength`."""
        hardened = norm + c.hardening_strain
        hardening = c.hardening_modulus * power(hardened, c.hardening_exponent)
        return c.yield_stress + hardening, c.hardening_exponent * hardening / hardened
