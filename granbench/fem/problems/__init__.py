"""The boundary-value problems by name."""

from collections.abc import Mapping
from dataclasses import fields
from difflib import get_close_matches

from granbench.errors import ConfigurationError
from granbench.fem.problems.biaxial import Biaxial
from granbench.fem.problems.problem import Problem

PROBLEMS: Mapping[str, type[Problem]] = {problem.name: problem for problem in (Biaxial,)}


def find_problem(name: str, **choices: object) -> Problem:
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
        near = get_close_matches(name, PROBLEMS, n=1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise ConfigurationError(f"unknown problem {name!r}: {hint}there are {', '.join(PROBLEMS)}")
    kind = PROBLEMS[name]
    known = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    for choice in choices:
        if choice not in known:
            raise ConfigurationError(
                f"{name} leaves no choice of {choice!r}; there is {', '.join(known)}"
            )
    return kind(**choices)


__all__ = ["PROBLEMS", "Problem", "find_problem"]
