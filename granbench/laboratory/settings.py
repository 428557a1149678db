"""Settings of the import: what a laboratory file does not say itself."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from granbench.errors import ConfigurationError, Setting
from granbench.laboratory.laboratory_test import KINDS
from granbench.laboratory.quantities import QUANTITIES, stress_of
from granbench.units.known_units import is_stress_unit, known_units, unit_factor
from granbench.units.plausible import LARGEST_STRESS, VOID_RATIOS

STRAIN_MEASURES = ("engineering", "logarithmic")
STRESS_STATES = ("effective", "total")

EARTH_PRESSURE_COEFFICIENT = 0.5
"""K0 in first loading: 1 - sin(30 degrees)."""


@dataclass(frozen=True)
class ImportSettings:
    """Settings for reading a laboratory file.

    Parameters
    ----------
    columns : header of the column that holds a quantity, by the quantity's name
    units : unit of a quantity by its name, or of all stresses as `stress`, all strains as `strain`
    ignore : headers of columns that are left out
    kind : of test, a name in `granbench.laboratory.laboratory_test.KINDS`; recognised from the
        numbers by default
    stresses : `effective` or `total`, for columns whose header says neither
    monotonic : whether a falling axial strain is an error
    tension_positive : whether tension is positive in the file
    strain_measure : of the file; laboratories divide by the first height, which is `engineering`
    initial_void_ratio : e0 where the file has no void ratio
    lateral_stress : constant effective lateral stress, Pa, where the file has none
    cell_pressure : constant total lateral stress, Pa, where the file has none
    back_pressure : pore pressure at the start, Pa, where the file does not give it
    k0 : lateral over axial effective stress at the start of an oedometer test whose lateral
        stress was not measured

    Raises
    ------
    ConfigurationError
        Naming the setting, if a quantity, a unit, a kind or a measure is unknown, or a number is
        out of range.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    ignore: tuple[str, ...] = ()
    kind: str | None = None
    stresses: str | None = None
    monotonic: bool = False
    tension_positive: bool = False
    strain_measure: str = "engineering"
    initial_void_ratio: float | None = None
    lateral_stress: float | None = None
    cell_pressure: float | None = None
    back_pressure: float | None = None
    k0: float = EARTH_PRESSURE_COEFFICIENT

    def __post_init__(self) -> None:
        """Raise ConfigurationError for settings that are unknown or out of range."""
        for name in self.columns:
            if name not in QUANTITIES:
                raise ConfigurationError(
                    Setting("columns", {name: self.columns[name]}),
                    f": there is no quantity {name!r}; use {', '.join(QUANTITIES)}",
                )
        for name, unit in self.units.items():
            if name not in (*QUANTITIES, "stress", "strain"):
                raise ConfigurationError(
                    Setting("units", {name: unit}),
                    f": there is no quantity {name!r}; use stress, strain or one of "
                    f"{', '.join(QUANTITIES)}",
                )
            stress = name == "stress" or (name in QUANTITIES and QUANTITIES[name].is_stress)
            if unit_factor(unit) is None or is_stress_unit(unit) != stress:
                raise ConfigurationError(
                    Setting("units", {name: unit}),
                    f": {unit!r} is not a unit of {name}; use one of {known_units(stress)}",
                )
        self._check_choices()
        self._check_numbers()

    def _check_choices(self) -> None:
        if self.kind is not None and self.kind not in KINDS:
            raise ConfigurationError(
                Setting("kind", self.kind), f" is unknown; use {', '.join(KINDS)}"
            )
        if self.stresses is not None and self.stresses not in STRESS_STATES:
            raise ConfigurationError(
                Setting("stresses", self.stresses), f" is unknown; use {' or '.join(STRESS_STATES)}"
            )
        if self.strain_measure not in STRAIN_MEASURES:
            raise ConfigurationError(
                Setting("strain_measure", self.strain_measure),
                f" is unknown; use {' or '.join(STRAIN_MEASURES)}",
            )

    def _check_numbers(self) -> None:
        least, greatest = VOID_RATIOS
        e0 = self.initial_void_ratio
        if e0 is not None and not least <= e0 <= greatest:
            raise ConfigurationError(
                Setting("initial_void_ratio", e0),
                f" must be the volume of the voids over that of the grains, from {least:g} to "
                f"{greatest:g} (0.8, not 80 %)",
            )
        for name in ("lateral_stress", "cell_pressure"):
            pressure = getattr(self, name)
            if pressure is not None and not 0.0 < pressure <= LARGEST_STRESS:
                raise ConfigurationError(
                    Setting(name, pressure),
                    f" must be positive and at most {LARGEST_STRESS:g} Pa, compression positive "
                    "(1e5 is 100 kPa)",
                )
        back = self.back_pressure
        if back is not None and not 0.0 <= back <= LARGEST_STRESS:
            raise ConfigurationError(
                Setting("back_pressure", back),
                f" must lie between 0 and {LARGEST_STRESS:g} Pa (1e5 is 100 kPa)",
            )
        for name in ("lateral_stress", "cell_pressure", "back_pressure"):
            pressure = getattr(self, name)
            if pressure is not None and 0.0 < pressure < 2e3:
                raise ConfigurationError(
                    Setting(name, pressure),
                    " is below 2 kPa, which is suspicious; give it in Pa "
                    f"({1e3 * pressure:g} if it is in kPa)",
                )
        if not 0.0 < self.k0 <= 3.0:
            raise ConfigurationError(
                Setting("k0", self.k0),
                " must be a ratio of the lateral to the axial stress above 0 and up to 3, such as "
                "0.5",
            )

    def unit_of(self, quantity: str) -> str | None:
        """The given unit of a quantity, or None."""
        group = "stress" if QUANTITIES[quantity].is_stress else "strain"
        for name in (quantity, stress_of(quantity)):
            if name in self.units:
                return self.units[name]
        unitless = quantity in ("void_ratio", "stress_ratio")
        return None if unitless else self.units.get(group)
