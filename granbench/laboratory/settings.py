"""What a user can say about a laboratory file that the file itself does not say."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from granbench.errors import ConfigurationError
from granbench.laboratory.laboratory_test import KINDS
from granbench.laboratory.quantities import QUANTITIES, stress_of
from granbench.units.known_units import is_stress_unit, known_units, unit_factor
from granbench.units.plausible import LARGEST_STRESS, VOID_RATIOS

STRAIN_MEASURES = ("engineering", "logarithmic")
STRESSES = ("effective", "total")

EARTH_PRESSURE_COEFFICIENT = 0.5
"""K0 of a first loading: 1 - sin(30 degrees)."""


@dataclass(frozen=True)
class ImportSettings:
    """How a file is to be read.

    Parameters
    ----------
    columns : header of the column that holds a quantity, by the quantity's name
    units : unit of a quantity by its name, or of all that are a `stress` or a `strain`
    ignore : headers of columns that are left out
    kind : what was controlled, a name in `granbench.laboratory.laboratory_test.KINDS`; recognised
        from the numbers by default
    stresses : `effective` or `total`, of the columns whose header says neither
    monotonic : whether the axial strain must not fall
    tension_positive : whether the file counts tension positive
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
        If a quantity, a unit, a kind or a measure is unknown, or a number makes no sense.
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
        """Raise ConfigurationError for what no file can be read with."""
        for name in self.columns:
            if name not in QUANTITIES:
                raise ConfigurationError(
                    f"--column {name}: there is no quantity {name!r} to find a column for; use "
                    f"{', '.join(QUANTITIES)}"
                )
        for name, unit in self.units.items():
            if name not in (*QUANTITIES, "stress", "strain"):
                raise ConfigurationError(
                    f"--unit {name}: there is no quantity {name!r} to give a unit; use stress, "
                    f"strain or one of {', '.join(QUANTITIES)}"
                )
            stress = name == "stress" or (name in QUANTITIES and QUANTITIES[name].is_stress)
            if unit_factor(unit) is None or is_stress_unit(unit) != stress:
                raise ConfigurationError(
                    f"--unit {name}={unit}: {unit!r} is no unit of {name}; use one of "
                    f"{known_units(stress)}"
                )
        self._check_choices()
        self._check_numbers()

    def _check_choices(self) -> None:
        if self.kind is not None and self.kind not in KINDS:
            raise ConfigurationError(
                f"--kind {self.kind}: the kind of test {self.kind!r} is unknown; use "
                f"{', '.join(KINDS)}"
            )
        if self.stresses is not None and self.stresses not in STRESSES:
            raise ConfigurationError(
                f"--stresses {self.stresses}: stresses are {' or '.join(STRESSES)}; use one of them"
            )
        if self.strain_measure not in STRAIN_MEASURES:
            raise ConfigurationError(
                f"--strain-measure {self.strain_measure}: the strain measure "
                f"{self.strain_measure!r} is unknown; use {' or '.join(STRAIN_MEASURES)}"
            )

    def _check_numbers(self) -> None:
        least, greatest = VOID_RATIOS
        e0 = self.initial_void_ratio
        if e0 is not None and not least <= e0 <= greatest:
            raise ConfigurationError(
                f"--e0 {e0:g} is no void ratio of a soil; give the volume of the voids over that "
                f"of the grains, from {least:g} to {greatest:g} (0.8, not 80 %)"
            )
        for option, pressure in (
            ("--lateral-stress", self.lateral_stress),
            ("--cell-pressure", self.cell_pressure),
        ):
            if pressure is not None and not 0.0 < pressure <= LARGEST_STRESS:
                raise ConfigurationError(
                    f"{option} {pressure:g} is no pressure in a cell; give it in Pa, compression "
                    "positive (1e5 is 100 kPa)"
                )
        back = self.back_pressure
        if back is not None and not 0.0 <= back <= LARGEST_STRESS:
            raise ConfigurationError(
                f"--back-pressure {back:g} is no back pressure; give it in Pa, 0 or more (1e5 is "
                "100 kPa)"
            )
        for option, pressure in (
            ("--lateral-stress", self.lateral_stress),
            ("--cell-pressure", self.cell_pressure),
            ("--back-pressure", back),
        ):
            if pressure is not None and 0.0 < pressure < 2e3:
                raise ConfigurationError(
                    f"{option} {pressure:g} is below 2 kPa, which is suspicious; give it in Pa "
                    f"({1e3 * pressure:g} if it is in kPa)"
                )
        if not 0.0 < self.k0 <= 3.0:
            raise ConfigurationError(
                f"--k0 {self.k0:g} is no ratio of the lateral to the axial stress; give a number "
                "such as 0.5, at most 3"
            )

    def unit_of(self, quantity: str) -> str | None:
        """Unit that the user gives a quantity, or None."""
        group = "stress" if QUANTITIES[quantity].is_stress else "strain"
        for name in (quantity, stress_of(quantity)):
            if name in self.units:
                return self.units[name]
        unitless = quantity in ("void_ratio", "stress_ratio")
        return None if unitless else self.units.get(group)
