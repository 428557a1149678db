"""Units of laboratory files: read from a header such as ``q [kPa]``, turned into SI."""

import re

PASCALS = {
    "pa": 1.0,
    "n/m2": 1.0,
    "kpa": 1e3,
    "kn/m2": 1e3,
    "mpa": 1e6,
    "n/mm2": 1e6,
    "mn/m2": 1e6,
    "gpa": 1e9,
    "bar": 1e5,
}
RATIOS = {"-": 1.0, "1": 1.0, "–": 1.0, "m/m": 1.0, "mm/mm": 1.0, "%": 1e-2, "percent": 1e-2}

STRESS_UNITS = "Pa, kPa, MPa, GPa, bar, N/m2, kN/m2, MN/m2 or N/mm2"
RATIO_UNITS = "% or -"

_BRACKETED = re.compile(r"[\[(]\s*(?P<unit>[^\[\]()]*?)\s*[\])]")
_SLASHED = re.compile(r"^(?P<name>[^/]+?)\s*/\s*(?P<unit>k?n/m2|[kmg]?pa|%|percent|bar)$", re.I)


def split_header(header: str) -> tuple[str, str | None]:
    """Name and unit of a column header, such as ``eps1 [%]``, ``q (kPa)`` or ``q/kPa``.

    The unit is None where the header has none. Brackets that hold no unit that is known belong to
    the name; see `split_strange_unit` for what may yet be meant as one.
    """
    header = header.strip()
    for found in _BRACKETED.finditer(header):
        if unit_factor(found["unit"]) is not None:
            return header[: found.start()].strip(), found["unit"]
    if slashed := _SLASHED.match(header):
        return slashed["name"], slashed["unit"]
    return header, None


def split_strange_unit(header: str) -> tuple[str, str] | None:
    """Name and unit of a header that ends in brackets of one word, whatever that word is."""
    found = re.fullmatch(r"(?P<name>.*?)\s*[\[(]\s*(?P<unit>[^\[\]()\s]+)\s*[\])]", header.strip())
    return (found["name"], found["unit"]) if found else None


def known_units(is_stress: bool) -> str:
    """The units of a stress, or of a ratio such as a strain, as a list for an error text."""
    return STRESS_UNITS if is_stress else RATIO_UNITS


def unit_factor(unit: str) -> float | None:
    """What a number in a unit is multiplied by to be SI, or None where the unit is unknown."""
    plain = _plain(unit)
    return PASCALS.get(plain, RATIOS.get(plain))


def is_stress_unit(unit: str) -> bool:
    """Whether a known unit is one of stress rather than of a ratio."""
    return _plain(unit) in PASCALS


def _plain(unit: str) -> str:
    return unit.strip().lower().replace("²", "2").replace("^", "").replace(" ", "")
