"""Which quantity the header of a column names."""

import re
import unicodedata
from collections.abc import Mapping

from granbench.laboratory.quantities import (
    BASE_STRESSES,
    BOOKKEEPING,
    QUANTITIES,
    STATES,
    stress_of,
)

_DEFINITION = re.compile(r"=.*$")


_SYMBOL = r"(?:sigma|sig|s)_?"


_AXIAL = rf"{_SYMBOL}(?:11|1|axial|ax|aa|a|zz|z|v)"


_MIDDLE = rf"{_SYMBOL}(?:22|2)"


_LATERAL = rf"{_SYMBOL}(?:33|3|radial|rad|rr|r|h)"


_E_AXIAL, _E_MIDDLE, _E_LATERAL = (
    rf"(?:epsilon|eps|e)_?{label}" for label in ("(?:11|1|a|ax)", "(?:22|2)", "(?:33|3|r|rad)")
)


_THREE_P = rf"\({_AXIAL}\+(?:2\*?{_LATERAL}|{_MIDDLE}\+{_LATERAL})\)"


_CHANGE = r"(?:d|delta)"


_DEFINITIONS: Mapping[str, re.Pattern[str]] = {
    name: re.compile(pattern)
    for name, pattern in {
        "axial_strain": rf"{_CHANGE}_?(h|l|z)/\1_?(?:0|i|o)|\(?(h|l)_?0-\2\)?/\2_?0",
        "volumetric_strain": rf"{_CHANGE}_?v/v_?(?:0|i|o)|\(v_?0-v\)/v_?0"
        rf"|{_E_AXIAL}\+(?:2\*?{_E_LATERAL}|{_E_MIDDLE}\+{_E_LATERAL})",
        "deviatoric_strain": rf"(?:2/3\*?\({_E_AXIAL}-{_E_LATERAL}\)"
        rf"|2\*?\({_E_AXIAL}-{_E_LATERAL}\)/3)",
        "deviatoric_stress": rf"\(?{_AXIAL}-{_LATERAL}\)?",
        "mean_stress": rf"{_THREE_P}/3|1/3\*?{_THREE_P}",
        "stress_ratio": "q/p",
        "void_ratio": r"v_?v/v_?s",
        "excess_pore_pressure": r"uw?-(?:u_?0|bp|u_?b)",
    }.items()
}
"""Usual definition of each quantity, in the form that `_means_the_same` compares."""


_TWO_STRESSES = re.compile(r"(?:sigma|sig|s)[1a](?:sigma|sig|s)[3r]")


_DIFFERENCE = re.compile("[-_\N{MINUS SIGN}\N{EN DASH}\N{HYPHEN}]")


_PRIMES = re.compile("['\u2019\u2032\u00b4`\u2018\u201b]")


_BRACKETS = re.compile(r"[(\[{][^)\]}]*[)\]}]")


_LETTERS = {
    "σ": "sigma", "ς": "sigma", "ε": "eps", "δ": "delta", "∆": "delta", "η": "eta", "γ": "gamma",
    "τ": "tau", "φ": "phi", "ν": "nu", "/": "over", "ß": "ss", "√": "sqrt", "+": "plus",
    "*": "times", "×": "times", "·": "times", "⋅": "times",
}  # fmt: skip


def plain_header(name: str) -> str:
    """A header's name as `Quantity.headers` has it: ``sigrad'`` and ``Sig_rad`` are `sigrad`.

    Greek letters are spelt out, accents and everything but letters and digits are left out.
    """
    text = unicodedata.normalize("NFKD", name).lower()
    return re.sub(r"[^a-z0-9]", "", "".join(_LETTERS.get(letter, letter) for letter in text))


def known_quantity(name: str) -> str | None:
    """The quantity that a header without its unit names, or None.

    A stress that the header calls effective (by a word or a prime) or total has that word in front
    of its name. A header may name the quantity twice, as in ``Axial strain, eps1``, or define it,
    as in ``q = s1 - s3``. With another definition, as in ``q = (s1 - s3)/2``, or a minus sign in
    front, it is a different quantity.
    """
    if name.lstrip("([{ ").startswith(("-", "\N{MINUS SIGN}", "\N{EN DASH}")):
        return None
    name, sign, definition = name.partition("=")
    if sign:
        found = known_quantity(name)
        return found if found and _means_the_same(found, definition) else None
    if found := _named(name):
        return found
    first, _, last = name.strip().rpartition(" ")
    for parts in (re.split(r"[,;:()\[\]]", name), (first, last)):
        named = [_named(part) for part in parts if plain_header(part)]
        if len(named) < 2 or None in named:
            continue
        quantities = {quantity for quantity in named if quantity is not None}
        # It is enough if one part says that the stress is effective.
        stated = {q for q in quantities if q != stress_of(q)} or quantities
        if len(stated) == 1 and len({stress_of(q) for q in quantities}) == 1:
            return stated.pop()
    return None


def _means_the_same(quantity: str, definition: str) -> bool:
    """Whether a definition is the usual one of a quantity, or only repeats its name."""
    if known_quantity(definition) == quantity:
        return True
    text = unicodedata.normalize("NFKD", definition).lower()
    text = "".join(_LETTERS.get(c, c) if c not in "/+*" else c for c in text)
    text = re.sub(r"[\s\[\]]|\u0301|\u0300", "", text.replace("\N{MINUS SIGN}", "-"))
    bare = _PRIMES.sub("", text)
    plain = stress_of(quantity)
    if bare != text and quantity == plain and plain in BASE_STRESSES:
        return False  # effective on one side only
    if quantity.startswith("effective_") and bare == text:
        symbols = {"axial_stress": _AXIAL, "radial_stress": _LATERAL, "mean_stress": "p"}
        pattern = symbols.get(plain)
        if pattern and re.fullmatch(rf"{pattern}-uw?", text):
            return True
    usual = _DEFINITIONS.get(plain)
    return usual is not None and usual.fullmatch(bare) is not None


def _named(name: str) -> str | None:
    """The quantity of a header, or part of a header, that names it once."""
    plain = plain_header(name)
    if _TWO_STRESSES.search(plain) and not _DIFFERENCE.search(name):
        return None
    primed = bool(_PRIMES.search(name))
    if found := _by_header(plain):
        return _with_state(found, "effective" if primed else None)
    # Longest first: `eff` is a part of `effective`.
    for word in sorted(STATES, key=len, reverse=True):
        if word not in plain:
            continue
        if found := _by_header(plain.replace(word, "", 1)):
            return _with_state(found, STATES[word], primed=primed)
    return None


def _by_header(plain: str) -> str | None:
    return next((name for name, about in QUANTITIES.items() if plain in about.headers), None)


def _with_state(quantity: str, state: str | None, *, primed: bool = False) -> str | None:
    """The effective or total quantity that a header names; None if there is no such quantity."""
    if state is None or quantity == "deviatoric_stress":
        return quantity
    if state == "total" and primed:
        return None
    if quantity == "cell_pressure":
        return "effective_radial_stress" if state == "effective" else quantity
    if quantity in BASE_STRESSES:
        return f"{state}_{quantity}"
    # `Total pore pressure` is the absolute one; a prime on a strain has no meaning.
    if (quantity == "pore_pressure" and state == "total") or not QUANTITIES[quantity].is_stress:
        return quantity
    return None


def is_bookkeeping(name: str) -> bool:
    """Whether a header, without brackets and number, is one of `BOOKKEEPING`."""
    return (
        plain_header(_BRACKETS.sub("", _DEFINITION.sub("", name))).rstrip("0123456789")
        in BOOKKEEPING
    )
