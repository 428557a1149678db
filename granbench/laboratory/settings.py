"""What a user can say about a laboratory file that the file itself does not say."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from granbench.errors import ConfigurationError
from granbench.laboratory.laboratory_test import KINDS
from granbench.laboratory.quantities import QUANTITIES
from granbench.plausible import LARGEST_STRESS, VOID_RATIOS
from granbench.units import is_stress_unit, known_units, unit_factor

STRAIN_MEASURES = ("engineering", "logarithmic")


@dataclass(frozen=True)
class ImportSettings:
    """How a file is to be read.

    Parameters
    ----------
    columns : header of the column that holds a quantity, by the quantity's name
    units : unit of a quantity by its name, or of all that are a `stress` or a `strain`
    kind : what was controlled, a name in `granbench.laboratory.laboratory_test.KINDS`; told
        from the numbers by default
    monotonic : whether the axial strain must not fall
    tension_positive : whether the file counts tension positive
    strain_measure : of the file; laboratories divide by the first height, which is `engineering`
    initial_void_ratio : e0 where the file has no void ratio
    lateral_stress : constant lateral stress, Pa, where the file has none

    Raises
    ------
    ConfigurationError
        If a quantity, a unit, a kind or a measure is unknown, or a number makes no sense.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    kind: str | None = None
    monotonic: bool = False
    tension_positive: bool = False
    strain_measure: str = "engineering"
    initial_void_ratio: float | None = None
    lateral_stress: float | None = None

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
        if self.kind is not None and self.kind not in KINDS:
            raise ConfigurationError(
                f"--kind {self.kind}: the kind of test {self.kind!r} is unknown; use "
                f"{', '.join(KINDS)}"
            )
        if self.strain_measure not in STRAIN_MEASURES:
            raise ConfigurationError(
                f"--strain-measure {self.strain_measure}: the strain measure "
                f"{self.strain_measure!r} is unknown; use {' or '.join(STRAIN_MEASURES)}"
            )
        least, greatest = VOID_RATIOS
        e0, lateral = self.initial_void_ratio, self.lateral_stress
        if e0 is not None and not least <= e0 <= greatest:
            raise ConfigurationError(
                f"--e0 {e0:g} is no void ratio of a soil; give the volume of the voids over that "
                f"of the grains, from {least:g} to {greatest:g} (0.8, not 80 %)"
            )
        if lateral is not None and not 0.0 < lateral <= LARGEST_STRESS:
            raise ConfigurationError(
                f"--lateral-stress {lateral:g} is no cell pressure; give it in Pa, compression "
                "positive (1e5 is 100 kPa)"
            )

    def unit_of(self, quantity: str) -> str | None:
        """Unit that the user gives a quantity, or None."""
        group = "stress" if QUANTITIES[quantity].is_stress else "strain"
        if quantity in self.units:
            return self.units[quantity]
        return None if quantity == "void_ratio" else self.units.get(group)
