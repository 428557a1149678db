"""A boundary-value problem with its choices as a user writes them: NAME=VALUE."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

from granbench.errors import ConfigurationError
from granbench.fem.load_path_file import read_load_path
from granbench.fem.problems.problem import Problem
from granbench.fem.problems.registry import find_problem, problem_class
from granbench.paths.confining_pressure import RandomConfinement
from granbench.units.plausible import LARGEST_SEED
from granbench.units.quantity_text import pressure_from_text, strain_from_text

YES_OR_NO = {"true": True, "yes": True, "false": False, "no": False}

RANDOM = "random"

DRIVE = ("cycles", "end_strain", "speed")
"""Choices that a load path replaces."""


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
        As `find_problem`, or if a text is not of this form or repeats a choice.
    """
    defaults = {field.name: field.default for field in fields(problem_class(name))}
    choices: dict[str, object] = {}
    for text in texts:
        choice, sign, value = text.partition("=")
        if not (sign and choice.isidentifier()):
            raise ConfigurationError(
                f"{text!r} is not a choice; write NAME=VALUE, such as cycles=cyclic"
            )
        if choice in choices:
            raise ConfigurationError(f"{choice} is given twice; give it once")
        choices[choice] = _parsed(choice, value, defaults[choice]) if choice in defaults else value
    if "load_path" in choices and (replaced := [each for each in DRIVE if each in choices]):
        raise ConfigurationError(
            f"load_path replaces {', '.join(replaced)}; give either the one or the other"
        )
    return find_problem(name, **choices)


def _parsed(choice: str, text: str, default: object) -> object:
    """A value of the kind that the default has; those of confinement and load path are None."""
    if isinstance(default, str):
        return text
    if isinstance(default, bool):
        if text.lower() not in YES_OR_NO:
            raise ConfigurationError(f"{choice}={text}: write {', '.join(YES_OR_NO)}")
        return YES_OR_NO[text.lower()]
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
