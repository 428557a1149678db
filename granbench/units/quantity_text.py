"""Pressures and strains as a user writes them: ``1e5``, ``100kPa``, ``14.5 psi``, ``0.2``, ``20%``.

A number without a unit is SI. A number that is only plausible in another unit is refused with a
question; a number with its unit is taken as written.
"""

import math
import re

from granbench.errors import ConfigurationError
from granbench.units.known_units import is_stress_unit, known_units, unit_factor
from granbench.units.plausible import LARGEST_STRAIN, LARGEST_STRESS, SMALLEST_BARE_PRESSURE

_WRITTEN = re.compile(
    r"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)\s*(?P<unit>(?:[^\W\d_]|[%‰]).*?)?\s*",
    re.IGNORECASE,
)
_NOT_FINITE = re.compile(r"\s*[+-]?(?:nan|inf|infinity)\s*", re.IGNORECASE)


def pressure_from_text(name: str, text: str) -> float:
    """A pressure in Pa.

    Parameters
    ----------
    name : of the quantity, with the separator before its value, such as ``confinement=``
    text : a number of Pa, or a number with a unit

    Raises
    ------
    ConfigurationError
        If it is not a pressure, or a number without a unit that is probably not in Pa.
    """
    number, unit = _parts(name, text, is_stress=True)
    if unit is None and 0.0 < abs(number) < SMALLEST_BARE_PRESSURE:
        raise ConfigurationError(
            f"{name}{number:g}: is this {number:g} kPa, or {number:g} Pa? A number without a unit "
            f"is in Pa; write {name}{number:g}kPa or {name}{number:g}Pa"
        )
    if abs(number) > LARGEST_STRESS:
        raise ConfigurationError(
            f"{name}{number:g} is beyond {LARGEST_STRESS / 1e9:g} GPa, more than any soil carries; "
            "give it in Pa (1e5 is 100 kPa), or with its unit, as 100kPa"
        )
    return number


def strain_from_text(name: str, text: str) -> float:
    """A strain as a ratio.

    Parameters
    ----------
    name : of the quantity, with the separator before its value
    text : a ratio, or a number with a unit such as %

    Raises
    ------
    ConfigurationError
        If it is not a strain, or must be in per cent.
    """
    number, _ = _parts(name, text, is_stress=False)
    if abs(number) >= LARGEST_STRAIN:
        raise ConfigurationError(
            f"{name}{number:g}: is this {number:g} %? A strain has no unit: write 0.2 for 20 %, or "
            f"{name}20%; it must stay below {LARGEST_STRAIN:g}"
        )
    return number


def _parts(name: str, text: str, *, is_stress: bool) -> tuple[float, str | None]:
    """The number in SI, and the unit, if there is one."""
    if _NOT_FINITE.fullmatch(text):
        raise ConfigurationError(f"{name}{text.strip()} is not a finite number; give one")
    written = _WRITTEN.fullmatch(text)
    if written is None:
        example = "1e5 or 100kPa" if is_stress else "0.2 or 20%"
        raise ConfigurationError(f"{name}{text!r} is not a number; give one such as {example}")
    unit = written["unit"]
    factor = 1.0
    if unit is not None:
        found = unit_factor(unit)
        if found is None or is_stress_unit(unit) != is_stress:
            raise ConfigurationError(
                f"{name}{text.strip()}: {unit!r} is not a unit of "
                f"{'stress' if is_stress else 'strain'}; use {known_units(is_stress)}"
            )
        factor = found
    number = float(written["number"]) * factor
    if not math.isfinite(number):
        raise ConfigurationError(f"{name}{text.strip()} is too large; give a finite number")
    return number, unit
