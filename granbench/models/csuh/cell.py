r"""`csuh`: the critical-state unified hardening model for clay and sand, three-dimensional.

    elasticity  K = (1 + e0)(p + p_s)/kappa,  G = 3 (1 - 2 nu) K/(2 (1 + nu))
    yield       f = ln(A p + p_s) - ln(p_x0 + p_s) - H/c_p <= 0                       (Eq 7.31)
                A = 1 + (1 + chi) eta^2/(M^2 - chi eta^2),  c_p = (lambda - kappa)/(1 + e0)
    hardening   dH = (M_f^4 - eta^4)/(M_c^4 - eta^4) d eps_v^p                        (Eq 7.22)
    flow        d eps^p = L p dg/dsigma,  g = ln p + ln(1 + eta^2/M_c^2)              (Eq 7.32)
    state       xi = e_eta - e,  R = exp(-xi/(lambda - kappa)),  e = e0 - (1 + e0) eps_v
                e_eta = Z - lambda ln((p + p_s)/(1 + p_s))
                        - (lambda - kappa) ln((A p + p_s)/(p + p_s))                  (Eq 7.29)
                M_f = 6/(1 + sqrt(1 + 12 (3 - M) R/M^2)),  M_c = M exp(-m xi)         (Eq 7.28)
    Lode angle  M = 18 M_com/(18 + 3 (1 - sin 3 theta))                               (Eq 7.35)

with p and p_s in kPa, p_s = exp((N - Z)/lambda) - 1. The formulas are in
`granbench.models.csuh.formulas`, with dH in a form that is regular at eta = M_c; a piece of an
increment is in `granbench.models.csuh.increment` and its error control in
`granbench.models.substepping`.

A path starts on its yield surface with H = 0, so that p_x0 = A p0. The density is given
by e0: the conditions' `initial_void_ratio`, or the value that follows from an overconsolidation
ratio of the conditions or of the parameters,

    e0 = e_eta - (lambda - kappa) ln((OCR A p0 + p_s)/(A p0 + p_s)).

Plastic work L p (sigma:dg/dsigma) = L p is never negative. The elastic law is not derived from a
potential (G grows with p at a constant nu), so that a closed elastic cycle in stress may give or
take a little work, as in the published model.

References
----------
Yao, Liu, Luo, Tian & Zhang (2019), Computers and Geotechnics 110:326-343; Guan (2023), Sec 7.4.
"""

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar

import torch
from torch import Tensor

from granbench.cells.contract import Conditions
from granbench.errors import ModelError
from granbench.models.arrays import Array
from granbench.models.classical import ClassicalCell
from granbench.models.csuh.formulas import (
    inflection_pressure,
    intercept_in_pascal,
    low_pressure_intercept,
    reference_void_ratio,
)
from granbench.models.csuh.increment import Increment
from granbench.models.csuh.yielding import Flags, Material, stress_ratio
from granbench.models.lode import deviator_plane
from granbench.models.parameters import Constants, Parameter
from granbench.models.substepping import Substepping, substepped

CONSTANTS_OF_A_PATH = ("initial_yield_pressure", "reference_void_ratio")

LEAST_PLASTIC_SLOPE = 1e-3
"""Least (lambda - kappa)/lambda; a fit that goes below it stays there."""

LOOSEST_ROUNDING = 1e-6
"""e0 may be above the loosest by so much: records keep it in single precision."""

_FRICTION_8_DEGREES = 6.0 * math.sin(math.radians(8.0)) / (3.0 - math.sin(math.radians(8.0)))


class CSUH(ClassicalCell):
    """Critical-state unified hardening; see the module for its equations.

    Attributes
    ----------
    substepping : how finely increments are cut
    """

    name = "csuh"
    title = "CSUH: critical-state unified hardening"
    pressure_dependent = True
    numpy_updates = True
    internal_variables = ("hardening", "void_ratio", *CONSTANTS_OF_A_PATH)
    lode_dependent: ClassVar[bool] = True
    state_dependent: ClassVar[bool] = True
    parameter_table: ClassVar[tuple[Parameter, ...]] = (
        Parameter("critical_ratio", "M", "1", "critical q/p in triaxial compression", 0.0, 3.0),
        Parameter("compression_slope", "lambda", "1", "slope of compression, e against ln p"),
        Parameter("swelling_slope", "kappa", "1", "slope of swelling, e against ln p"),
        Parameter("poisson_ratio", "nu", "1", "Poisson's ratio", -1.0, 0.5),
        Parameter(
            "compression_intercept", "N", "1", "e of the line of high pressure at 1 kPa", -math.inf
        ),
        Parameter("low_pressure_intercept", "Z", "1", "loosest e at 1 kPa", -math.inf),
        Parameter(
            "critical_spacing", "chi", "1", "spacing of critical and loosest line", -1.0, 1.0
        ),
        Parameter("dilatancy", "m", "1", "dependence of dilatancy on state"),
        Parameter("overconsolidation_ratio", "OCR", "1", "density of a start without e0", 1.0),
    )
    parameter_sets: ClassVar[Mapping[str, Mapping[str, float]]] = {
        "guan2023-tab7.3-original": {
            "critical_ratio": 1.25,
            "compression_slope": 0.135,
            "swelling_slope": 0.04,
            "poisson_ratio": 0.2,
            "compression_intercept": 1.9,
            "low_pressure_intercept": 1.9,
            "critical_spacing": 0.0,
            "dilatancy": 1.8,
            "overconsolidation_ratio": 120.0,
        },
        "toyoura": {
            "critical_ratio": 1.25,
            "compression_slope": 0.135,
            "swelling_slope": 0.04,
            "poisson_ratio": 0.3,
            "compression_intercept": 1.973,
            "low_pressure_intercept": low_pressure_intercept(1.973, 0.934, 0.135),
            "critical_spacing": 0.4,
            "dilatancy": 1.8,
            # The source gives e0 instead; this is e0 = 0.833 at an isotropic 100 kPa.
            "overconsolidation_ratio": 40.52,
        },
        "guan2023-tab5.1": {
            "critical_ratio": _FRICTION_8_DEGREES,  # Eq 7.36
            "compression_slope": 0.214,
            "swelling_slope": 0.191,
            "poisson_ratio": 0.2,
            "compression_intercept": 1.931,
            "low_pressure_intercept": 0.2743,
            "critical_spacing": 0.0,
            "dilatancy": 1.8,
            "overconsolidation_ratio": 377.0,
        },
        "guan2023-tab7.3-optimised": {
            "critical_ratio": 0.63,
            "compression_slope": 0.342,
            "swelling_slope": 0.329,
            "poisson_ratio": 0.263,
            "compression_intercept": 2.708,
            "low_pressure_intercept": -0.769,
            "critical_spacing": 0.0,
            "dilatancy": 29.26,
            "overconsolidation_ratio": 787.8,
        },
    }
    substepping: Substepping = Substepping()

    def __init__(
        self,
        values: Mapping[str, float] | None = None,
        *,
        parameter_set: str | None = None,
        order: str = "plane",
        dtype: torch.dtype = torch.float64,
    ) -> None:
        super().__init__(values, parameter_set=parameter_set, order=order, dtype=dtype)
        slope, swelling = (self.reference[name] for name in ("compression_slope", "swelling_slope"))
        if swelling >= slope:
            raise ModelError(
                f"{self.name}: swelling_slope (kappa) is {swelling:g} but must lie below "
                f"compression_slope (lambda), {slope:g}; correct one of them"
            )
        self._increment = Increment(self.rows, Flags(self.lode_dependent, self.state_dependent))

    def derived(self, c: Constants) -> dict[str, Tensor]:
        """See `ClassicalCell.derived`."""
        slope = c.compression_slope
        plastic = torch.maximum(slope - c.swelling_slope, LEAST_PLASTIC_SLOPE * slope)
        p_s = inflection_pressure(c.compression_intercept, c.low_pressure_intercept, slope)
        nu, chi = c.poisson_ratio, c.critical_spacing
        return {
            "sixth": 1.0 / (6.0 * c.critical_ratio),
            "stretch": (1.0 + chi) / (6.0 * c.critical_ratio) ** 2,
            "triple": 1.0 + 3.0 * chi,
            "steepest": 0.999999 / chi.clamp(min=1e-9),
            "power": 2.0 * c.dilatancy * plastic,
            "plastic": plastic,
            "swelling": c.swelling_slope / plastic,
            "intercept": intercept_in_pascal(c.low_pressure_intercept, slope, p_s),
            "p_s": p_s,
            "shear": 3.0 * (1.0 - 2.0 * nu) / (1.0 + nu),
        }

    def initial_internals(self, stress: Tensor, conditions: Conditions) -> Sequence[Tensor]:
        """See `ClassicalCell.initial_internals`; conditions with all of them continue a record.

        Raises
        ------
        ModelError
            If e0 is beyond the loosest state at this stress or no void ratio, the
            overconsolidation ratio is below one, or the stress ratio is beyond every surface.
        """
        known = conditions.scalars
        if all(name in known for name in self.internal_variables):
            return super().initial_internals(stress, conditions)
        c = self.constants()
        p, through = self._through(stress, c)
        loosest = reference_void_ratio(
            p, through + c.p_s, c.intercept, c.swelling_slope, c.plastic, c.p_s
        )
        if "initial_void_ratio" in known:
            e0 = known["initial_void_ratio"].to(self.dtype).expand_as(p)
        else:
            ratio = self._overconsolidation(conditions, c)
            grown = (ratio * through + c.p_s) / (through + c.p_s)
            e0 = (loosest - c.plastic * torch.log(grown)).expand_as(p)
        self._refuse_void_ratio(e0, loosest, p)
        first = self._first_size(through, loosest - e0, c).expand_as(p)
        return [row.unsqueeze(0) for row in (torch.zeros_like(p), e0, first, e0)]

    def _through(self, stress: Tensor, c: Constants) -> tuple[Tensor, Tensor]:
        """P, and A p, the size of the yield surface through the stress, Pa."""
        p, s = self.rows.split(stress)
        plane = deviator_plane(self.rows, s, s, lode=self.lode_dependent)
        cubic = plane.cubic_0 if self.lode_dependent else None
        y = stress_ratio(p, plane.square_0, cubic, c).y
        if (bad := y >= c.steepest).any():
            point = int(bad.nonzero()[0])
            ratio = (plane.square_0[point].sqrt() / p[point]).item()
            raise ModelError(
                f"{self.name}: point {point} starts at q/p = {ratio:.3g}, which no yield surface "
                "of this material reaches; start from a lower q/p"
            )
        return p, (1.0 + y) / (1.0 - c.critical_spacing * y) * p

    def _overconsolidation(self, conditions: Conditions, c: Constants) -> Tensor:
        known = conditions.scalars
        if "overconsolidation_ratio" not in known:
            return c.overconsolidation_ratio
        ratio = known["overconsolidation_ratio"].to(self.dtype)
        if (bad := ~(ratio >= 1.0)).any():
            point = int(bad.nonzero()[0])
            raise ModelError(
                f"{self.name}: the overconsolidation ratio of point {point} is "
                f"{ratio[point].item():g}; give one of at least 1, the loosest state"
            )
        return ratio

    def _refuse_void_ratio(self, e0: Tensor, loosest: Tensor, p: Tensor) -> None:
        bad = ~((e0 <= loosest + LOOSEST_ROUNDING) & (e0 > -1.0))
        if bad.any():
            point = int(bad.nonzero()[0])
            raise ModelError(
                f"{self.name}: point {point} starts with a void ratio of {e0[point].item():.4f}, "
                f"but at p0 = {p[point].item():g} Pa the loosest state has "
                f"{loosest[point].item():.4f}; give a lower initial_void_ratio"
            )

    def _first_size(self, through: Tensor, density: Tensor, c: Constants) -> Tensor:
        """p_x0, Pa: the stress lies on the first yield surface, however dense the material."""
        return through

    def update(self, dstrain: Array, state: Array, c: Constants) -> Array:
        """See `ClassicalCell.update`."""
        material = self._material(state, c)
        return substepped(self._increment.advance, dstrain, state, material, self.substepping)

    def _material(self, state: Array, c: Constants) -> Material:
        """Constants of the material and of the paths whose states (n_state, point) are given."""
        volume = 1.0 + state[-1]
        return Material(
            sixth=c.sixth,
            spacing=c.critical_spacing,
            stretch=c.stretch,
            triple=c.triple,
            steepest=c.steepest,
            power=c.power,
            plastic=c.plastic,
            swelling=c.swelling,
            intercept=c.intercept,
            p_s=c.p_s,
            shear=c.shear,
            volume=volume,
            stiffness=volume / c.swelling_slope,
            plasticity=volume / c.plastic,
            first_size=state[-2] + c.p_s,
        )
