"""Remarks after the unit of a header, as in ``sigma1 [kPa] (total)``.

A remark may say which stress is meant, or have no influence; it may also say that the numbers are
ten times as large, or have the other sign. Only the first two are accepted.
"""

import re

from granbench.laboratory.headers import known_quantity
from granbench.units.known_units import is_unit, unit_factor

_SHORTENING = frozenset(
    [
        "compression",
        "compressive",
        "contraction",
        "contractive",
        "contractant",
        "compaction",
        "shortening",
        "settlement",
    ]
)
_LENGTHENING = frozenset(
    [
        "dilation",
        "dilatation",
        "dilatancy",
        "dilatant",
        "dilative",
        "expansion",
        "extension",
        "tension",
        "swelling",
    ]
)
_POSITIVE, _NEGATIVE = (
    frozenset(["positive", "pos", "+ve", "+"]),
    frozenset(["negative", "neg", "-ve", "-"]),
)
_FILLING = frozenset(["is", "are", "in", "for", "the", "as", "counted", "taken", "when", "if"])
_HARMLESS = frozenset(
    [
        "measured",
        "calculated",
        "computed",
        "calc",
        "corrected",
        "membrane",
        "correction",
        "and",
        "smoothed",
        "filtered",
        "local",
        "external",
        "lvdt",
        "area",
        "load",
        "cell",
        "transducer",
    ]
)


def quantity_with_remark(name: str, remark: str, unit: str) -> str | None:
    """The quantity of a header with text after its unit, or None if the text may change it.

    Parameters
    ----------
    name : of the column, in front of the unit
    remark : text after the unit
    unit : of the column
    """
    bare = remark.strip("()[]{} ")
    if not any(character.isalnum() for character in remark):
        # A lone sign may change the sign of the numbers; a mark such as * does not.
        return (
            None
            if set(remark) & set("+-\N{MINUS SIGN}\N{EN DASH}%\u2030")
            else (known_quantity(name))
        )
    if re.match(r"[^\W\d_]|[(\[{=]", remark) and (found := known_quantity(f"{name} {remark}")):
        return found
    named = known_quantity(name)
    if named is None:
        return None
    if is_unit(bare):
        same = unit_factor(bare) is not None and unit_factor(bare) == unit_factor(unit)
        return named if same else None
    if known_quantity(bare.strip("-:\N{EN DASH} ")) == named:
        return named
    return named if _is_harmless(bare) else None


def _is_harmless(remark: str) -> bool:
    """Whether a remark says that compression is positive, or only how something was measured."""
    words = set(re.split(r"[\s,;:=]+", remark.lower())) - {""}
    if words <= _HARMLESS:
        return True
    for direction, sign in ((_SHORTENING, _POSITIVE), (_LENGTHENING, _NEGATIVE)):
        if words & direction and words & sign and words <= direction | sign | _FILLING:
            return True
    return False
