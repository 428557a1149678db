"""The boundary-value problems by name, and their choices from what a user writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

from granbench.errors import ConfigurationError, alternatives
from granbench.fem.load_path_file import read_load_path
from granbench.fem.problems.biaxial import Biaxial
from granbench.fem.problems.dog_bone import DogBone
from granbench.fem.problems.perforated_plate import PerforatedPlate
from granbench.fem.problems.problem import Problem
from granbench.fem.problems.retaining_wall import RetainingWall
from granbench.fem.problems.strip_footing import StripFooting
from granbench.paths.confining_pressure import RandomConfinement
from granbench.units.plausible import LARGEST_SEED
from granbench.units.quantity_text import pressure_from_text, strain_from_text

PROBLEMS: Mapping[str, type[Problem]] = {
    kind.name: kind for kind in (Biaxial, RetainingWall, StripFooting, DogBone, PerforatedPlate)
}

TRUTH = {"true": True, "yes": True, "false": False, "no": False}

RANDOM = "random"

DRIVE = ("cycles", "end_strain", "speed")
"""Choices that a load path takes the place of."""


def find_problem(name: str, **choices: Any) -> Problem:
    """The problem `name`, with other choices than its default ones.

    Parameters
    ----------
    name : a key of `PROBLEMS`
    choices : fields of the problem

    Raises
    ------
    ConfigurationError
        If there is no such problem or choice, or a choice is out of range.
    """
    if name not in PROBLEMS:
        raise ConfigurationError(f"unknown problem {name!r}: {alternatives(name, PROBLEMS)}")
    kind = PROBLEMS[name]
    known = [field.name for field in fields(kind)]
    for choice in choices:
        if choice not in known:
            raise ConfigurationError(
                f"{name} leaves no choice of {choice!r}; there is {', '.join(known)}"
            )
    return kind(**choices)


def chosen_from_text(name: str, texts: Sequence[str]) -> Problem:
    """The problem `name` with choices as a user writes them.

    Parameters
    ----------
    name : a key of `PROBLEMS`
    texts : NAME=VALUE each; a confinement may be ``random:V_C`` or ``random:V_C:SEED`` (Eq 4.21),
        a load path is the name of a file, see `read_load_path`

    Raises
    ------
    ConfigurationError
        As `find_problem`, or if a text is none of these or chooses again.
    """
    find_problem(name)  # an unknown problem is said before its choices
    defaults = {field.name: field.default for field in fields(PROBLEMS[name])}
    choices: dict[str, object] = {}
    for text in texts:
        choice, sign, value = text.partition("=")
        if not (sign and choice.isidentifier()):
            raise ConfigurationError(f"{text!r} is no choice; give NAME=VALUE, as cycles=cyclic")
        if choice in choices:
            raise ConfigurationError(f"{choice} is chosen twice; leave one of them out")
        choices[choice] = _parsed(choice, value, defaults[choice]) if choice in defaults else value
    if "load_path" in choices and (twice := [each for each in DRIVE if each in choices]):
        raise ConfigurationError(
            f"the load path says how the problem is driven; leave out {', '.join(twice)}"
        )
    return find_problem(name, **choices)


def _parsed(choice: str, text: str, default: object) -> object:
    """A value of the kind that the default has; those of confinement and load path are None."""
    if isinstance(default, str):
        return text
    if isinstance(default, bool):
        if text.lower() not in TRUTH:
            raise ConfigurationError(f"{choice}={text}: give one of {', '.join(TRUTH)}")
        return TRUTH[text.lower()]
    if choice == "load_path":
        return read_load_path(text)
    if choice == "confinement" and text.startswith(RANDOM):
        return _random_confinement(text)
    if choice == "confinement":
        return pressure_from_text("confinement=", text)
    if choice == "end_strain":
        return strain_from_text("end_strain=", text)
    return _number(choice, text)


def _random_confinement(text: str) -> RandomConfinement:
    refusal = ConfigurationError(
        f"confinement={text}: give a pressure in Pa, or {RANDOM}:V_C:SEED as {RANDOM}:3:1"
    )
    word, *numbers = text.split(":")
    if word != RANDOM or len(numbers) > 2:
        raise refusal
    seed = numbers[1] if len(numbers) == 2 else "0"
    if not (seed.isascii() and seed.isdigit() and len(seed) < 20 and int(seed) <= LARGEST_SEED):
        raise ConfigurationError(
            f"confinement={text}: the seed is a whole number from 0 to {LARGEST_SEED}"
        )
    try:
        curvature = float(numbers[0]) if numbers else 1.0
    except ValueError:
        raise refusal from None
    return RandomConfinement(curvature, int(seed))


def _number(choice: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ConfigurationError(f"{choice}={text}: give a number") from None
