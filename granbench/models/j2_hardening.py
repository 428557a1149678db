r"""`j2-hardening`: von Mises plasticity in the plane with a power law of the plastic strain.

    yield        f = q - sigma_Y,   sigma_Y = A (||eps^p||_F + eps_0)^B      (Eq 6.26, 6.32)

The rest, with the consistency equation, is in `granbench.models.hardening`. As for `j2`, the
thesis' model is one of the plane, with two-dimensional moduli, p = tr/2 and q = sqrt(2 s:s), and
with 3-D components p = tr/3 and q = sqrt(3/2 s:s). The first yield stress is A eps_0^B.
"""

from collections.abc import Mapping
from typing import ClassVar

from torch import Tensor

from granbench.models.arrays import Array, power
from granbench.models.hardening import HardeningCell
from granbench.models.parameters import Constants, Parameter
from granbench.models.return_mapping import elastic_constants


class J2Hardening(HardeningCell):
    """Von Mises plasticity with power-law hardening; see the module for its equations."""

    name = "j2-hardening"
    title = "J2 with power-law hardening"
    dimension = 2
    parameter_table = (
        Parameter("bulk_modulus", "K", "Pa", "bulk modulus"),
        Parameter("shear_modulus", "G", "Pa", "shear modulus"),
        Parameter("hardening_modulus", "A", "Pa", "yield stress at a strain of one"),
        Parameter("hardening_exponent", "B", "1", "exponent of hardening"),
        Parameter("hardening_strain", "eps_0", "1", "strain at which hardening begins"),
    )
    parameter_sets: ClassVar[Mapping[str, Mapping[str, float]]] = {
        # E = 2 MPa and nu = 0.2 as for `j2`; A = 0.2 E, and A eps_0^B = 1e5 Pa gives eps_0.
        "guan2023-sec6.6": {
            "bulk_modulus": 1.25e6,
            "shear_modulus": 2e6 / 2.4,
            "hardening_modulus": 4e5,
            "hardening_exponent": 0.5,
            "hardening_strain": 0.0625,
        },
    }

    def derived(self, c: Constants) -> dict[str, Tensor]:
        """See `ClassicalCell.derived`."""
        return elastic_constants(c.bulk_modulus, c.shear_modulus, self.rows.dimension)

    def strength(self, c: Constants, norm: Array) -> tuple[Array, Array]:
        """See `HardeningCell.strength`."""
        hardened = norm + c.hardening_strain
        strength = c.hardening_modulus * power(hardened, c.hardening_exponent)
        return strength, c.hardening_exponent * strength / hardened
