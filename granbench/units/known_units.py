"""Units of stress, strain and other quantities, in their usual spellings."""

import re
from collections.abc import Mapping

LONGEST_UNIT, LONGEST_HEADER = 40, 400
"""Largest number of characters of a unit and of a header."""
GRAVITY = 9.80665
"""m/s2: converts a mass, as in kg/cm2, to the weight that is meant."""
POUND = 4.4482216152605
"""N: one pound-force."""
INCH = 0.0254

PASCALS: Mapping[str, float] = {
    "pa": 1.0, "hpa": 1e2, "kpa": 1e3, "mpa": 1e6, "gpa": 1e9,
    "n/m2": 1.0, "kn/m2": 1e3, "mn/m2": 1e6, "gn/m2": 1e9,
    "n/mm2": 1e6, "kn/mm2": 1e9, "n/cm2": 1e4, "kn/cm2": 1e7, "dan/cm2": 1e5, "dyn/cm2": 0.1,
    "bar": 1e5, "mbar": 1e2, "millibar": 1e2, "atm": 101325.0,
    "kg/m2": GRAVITY, "kgf/m2": GRAVITY, "kp/m2": GRAVITY,
    "kg/cm2": 1e4 * GRAVITY, "kgf/cm2": 1e4 * GRAVITY, "kp/cm2": 1e4 * GRAVITY,
    "kg/mm2": 1e6 * GRAVITY, "kgf/mm2": 1e6 * GRAVITY, "g/cm2": 10.0 * GRAVITY,
    "gf/cm2": 10.0 * GRAVITY,
    "t/m2": 1e3 * GRAVITY, "tf/m2": 1e3 * GRAVITY, "tonf/m2": 1e3 * GRAVITY,
    "psi": POUND / INCH**2, "lb/in2": POUND / INCH**2, "lbf/in2": POUND / INCH**2,
    "ksi": 1e3 * POUND / INCH**2, "kip/in2": 1e3 * POUND / INCH**2,
    "psf": POUND / (12 * INCH) ** 2, "lb/ft2": POUND / (12 * INCH) ** 2,
    "lbf/ft2": POUND / (12 * INCH) ** 2,
    "ksf": 1e3 * POUND / (12 * INCH) ** 2, "kip/ft2": 1e3 * POUND / (12 * INCH) ** 2,
    "tsf": 2e3 * POUND / (12 * INCH) ** 2, "ton/ft2": 2e3 * POUND / (12 * INCH) ** 2,
    "tonf/ft2": 2e3 * POUND / (12 * INCH) ** 2,
    "torr": 101325.0 / 760.0, "mmhg": 133.322387415, "mh2o": 1e3 * GRAVITY,
    "cmh2o": 10.0 * GRAVITY, "mmh2o": GRAVITY,
}  # fmt: skip
"""Pascals per unit of stress; tsf and ton/ft2 are US short tons, t/m2 tonnes."""

RATIOS: Mapping[str, float] = {
    "-": 1.0, "1": 1.0, "–": 1.0, "—": 1.0, "−": 1.0, "dimensionless": 1.0, "unitless": 1.0,
    "m/m": 1.0, "cm/cm": 1.0, "mm/mm": 1.0, "in/in": 1.0, "ft/ft": 1.0, "m3/m3": 1.0,
    "cm3/cm3": 1.0, "mm3/mm3": 1.0, "ml/ml": 1.0,
    "%": 1e-2, "percent": 1e-2, "percentage": 1e-2, "pct": 1e-2, "vol%": 1e-2, "vol.%": 1e-2,
    "‰": 1e-3, "permille": 1e-3, "mm/m": 1e-3, "millistrain": 1e-3, "mstrain": 1e-3, "mε": 1e-3,
    "με": 1e-6, "ue": 1e-6, "uε": 1e-6, "microstrain": 1e-6, "microstrains": 1e-6,
    "μstrain": 1e-6, "ustrain": 1e-6, "μm/m": 1e-6, "um/m": 1e-6, "μm/mm": 1e-3, "um/mm": 1e-3,
}  # fmt: skip

METRES: Mapping[str, float] = {
    "m": 1.0, "dm": 0.1, "cm": 1e-2, "mm": 1e-3, "μm": 1e-6, "um": 1e-6, "micron": 1e-6,
    "km": 1e3, "in": INCH, "inch": INCH, "inches": INCH, "ft": 12 * INCH, "feet": 12 * INCH,
}  # fmt: skip
SECONDS: Mapping[str, float] = {
    "s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "min": 60.0,
    "mins": 60.0, "minute": 60.0, "minutes": 60.0, "h": 3600.0, "hr": 3600.0, "hrs": 3600.0,
    "hour": 3600.0, "hours": 3600.0, "d": 86400.0, "day": 86400.0, "days": 86400.0,
}  # fmt: skip

OTHERS = frozenset(
    [
        "n",
        "kn",
        "mn",
        "kgf",
        "lbf",
        "kip",
        "g",
        "kg",
        "lb",
        "v",
        "mv",
        "ma",
        "hz",
        "degc",
        "°c",
        "degf",
        "°f",
        "deg",
        "°",
        "rad",
        "m2",
        "cm2",
        "mm2",
        "m3",
        "cm3",
        "mm3",
        "ml",
        "l",
        "cc",
        "in2",
        "in3",
        "g/cm3",
        "kg/m3",
        "kn/m3",
        "t/m3",
        "mg/m3",
        "m/s",
        "mm/s",
        "mm/min",
        "%/min",
        "%/h",
        "1/s",
        "kpa/min",
        "hh:mm",
        "hh:mm:ss",
        "yyyy-mm-dd",
        "dd/mm/yyyy",
        "mm/dd/yyyy",
    ]
)
"""Units of other quantities, for the recognition of a line of units."""

STRESS_UNITS = (
    "Pa, kPa, MPa, GPa, bar, mbar, atm, N/m2, kN/m2, MN/m2, N/mm2, kg/cm2, t/m2, psi, ksi, psf, "
    "ksf or tsf"
)
RATIO_UNITS = "%, ‰, -, mm/mm or microstrain"

_SPELLINGS = (
    ("â", ""),  # "mÂ²": UTF-8 that a program took for Latin-1
    ("²", "2"), ("³", "3"), ("⁻", "-"), ("ý", "2"),  # "mý": m² of a DOS program
    ("µ", "μ"), ("ϵ", "ε"), ("ɛ", "ε"), ("∕", "/"), ("⁄", "/"), ("^", ""), ("**", ""),
    ("·", "*"), ("•", "*"), ("⋅", "*"), ("\N{NO-BREAK SPACE}", " "),
)  # fmt: skip
_AREA = re.compile(r"(?:sq\.?|square)\s*(m|cm|mm|in|ft)\b\.?")
_BRACKETED = re.compile(r"[\[({]\s*(?P<unit>[^\[\](){}]*?)\s*[\])}]")
_SLASHED = re.compile(r"(?P<name>[^/]+?)\s*/\s*[\[(]?(?P<unit>[^\[\]()]+?)[\])]?")
_TRAILING = re.compile(
    r"(?P<name>.*[^\W\d_].*?)(?:\s*[,;:]\s*|[\s_]+)"
    r"(?P<unit>[kKMG]?[pP]a\.?|psi|psf|ksf|ksi|tsf|%|‰|percent|pct|[MmkK]?N/m{1,2}[2²]"
    r"|kgf?/cm[2²]|με|µε|microstrain)"
)
"""A unit without brackets at the end of a name, as in ``q kPa`` or ``q_kPa``; units of one or two
letters, and ``bar``, which may mean an average, belong to the name."""


def split_header(header: str) -> tuple[str, str | None]:
    """Name and unit of a column header, such as ``eps1 [%]``, ``q (kPa)``, ``q/kPa`` or ``q, kPa``.

    The unit is None if the header has none. Brackets without a known unit belong to the name; see
    `split_unknown_unit` for brackets that may hold another unit.
    """
    header = " ".join(header.split())
    if len(header) > LONGEST_HEADER:
        return header, None
    for found in _BRACKETED.finditer(header):
        if is_unit(found["unit"]) and header[: found.start()].strip(" /,"):
            return header[: found.start()].strip(" /,"), found["unit"]
    slashed = _SLASHED.fullmatch(header)
    if slashed and _plain(slashed["unit"]) in (*_NAMED_STRESSES, *_SLASHED_RATIOS, "mm", "min"):
        return slashed["name"], slashed["unit"]
    if trailing := _TRAILING.fullmatch(header):
        return trailing["name"].removesuffix(" in"), trailing["unit"]
    return header, None


def text_behind_unit(header: str) -> str:
    """The text after the unit in brackets that `split_header` finds, such as ``x10``."""
    header = " ".join(header.split())
    _, unit = split_header(header)
    for found in _BRACKETED.finditer(header):
        if found["unit"] == unit and header[: found.start()].strip(" /,"):
            return header[found.end() :].strip(" ,;:.")
    return ""


def split_unknown_unit(header: str) -> tuple[str, str] | None:
    """Name and unit of a header that ends in brackets, with any text between them."""
    found = re.fullmatch(
        r"(?P<name>.*?)\s*[\[(]\s*(?P<unit>[^\[\]()]*?[^\[\]()\s])\s*[\])]", header.strip()
    )
    return (found["name"], found["unit"]) if found else None


def known_units(is_stress: bool) -> str:
    """The known units of a stress, or of a ratio such as a strain, for an error text."""
    return STRESS_UNITS if is_stress else RATIO_UNITS


def unit_factor(unit: str) -> float | None:
    """Factor from a unit of stress or of a ratio to SI.

    None if the unit is unknown or belongs to another quantity, such as a length.
    """
    plain = _plain(unit)
    return PASCALS.get(plain, RATIOS.get(plain))


def length_factor(unit: str) -> float | None:
    """Metres per unit of length; None if the unit is not a known length."""
    return METRES.get(_plain(unit))


def time_factor(unit: str) -> float | None:
    """Seconds per unit of time; None if the unit is not a known time."""
    return SECONDS.get(_plain(unit))


def is_stress_unit(unit: str) -> bool:
    """Whether a known unit is one of stress rather than of a ratio."""
    return _plain(unit) in PASCALS


def is_unit(text: str) -> bool:
    """Whether a text is a unit of any quantity."""
    plain = _plain(text)
    return any(plain in known for known in (PASCALS, RATIOS, METRES, SECONDS, OTHERS))


def _plain(unit: str) -> str:
    """One spelling of a unit: ``kgf / cm^2``, ``kgf/cm²`` and ``kgf cm-2`` are `kgf/cm2`."""
    plain = unit.strip().lower()
    if len(plain) > LONGEST_UNIT:
        return plain
    for written, meant in _SPELLINGS:
        plain = plain.replace(written, meant)
    plain = re.sub(r"\b(?:foot|feet)\b", "ft", re.sub(r"\binch(es)?\b", "in", plain))
    plain = _AREA.sub(r"\g<1>2", re.sub(r"\s*(?:\bper\b|/)\s*(?=\S)", "/", plain))
    plain = re.sub(r"[\s*]+(mm|cm|m|in|ft)\s*-\s*2$", r"/\g<1>2", plain)
    plain = re.sub(r"^(lb|kip|tonne|ton)s(?=f?/)", r"\1", plain.replace(" ", ""))
    plain = re.sub(r"^ton(?:ne)?(?=f?/m2$)", "t", plain.replace("/qm", "/m2"))
    plain = re.sub(r"\b(in|ft)\.", r"\1", plain).replace("/cent", "percent")
    plain = plain.replace("/mille", "permille").replace("/mil", "permille")
    # A full stop ends a line of text, not a unit: "kPa."
    return plain if len(plain) == 1 else plain.rstrip(".")


_NAMED_STRESSES = frozenset(PASCALS)
_SLASHED_RATIOS = ("%", "percent", "‰")
