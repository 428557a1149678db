"""The registered boundary-value problems by name.

A package registers a problem under the entry-point group `granbench.problems`, as
``name = "module:Class"`` with a subclass of `Problem`; this module holds no list of them.
"""

from dataclasses import fields
from typing import Any

from granbench.errors import ConfigurationError
from granbench.fem.problems.problem import Problem
from granbench.registration import Registry

PROBLEMS: Registry[type[Problem]] = Registry(
    "granbench.problems",
    "problem",
    Problem,
    classes=True,
    names_agree=True,
    error=ConfigurationError,
)
"""Every registered problem."""


def find_problem(name: str, **choices: Any) -> Problem:
    """The problem `name`, with other choices than its default ones.

    Parameters
    ----------
    name : a key of `PROBLEMS`
    choices : fields of the problem

    Raises
    ------
    ConfigurationError
        If there is no such problem or choice, a choice is out of range, or the package that
        registers the problem is broken.
    """
    kind = problem_class(name)
    known = [field.name for field in fields(kind)]
    for choice in choices:
        if choice not in known:
            raise ConfigurationError(
                f"{name} has no choice {choice!r}; its choices are {', '.join(known)}"
            )
    return kind(**choices)


def problem_class(name: str) -> type[Problem]:
    """The class that is registered as `name`; raises as `find_problem`."""
    return PROBLEMS.find(name)
