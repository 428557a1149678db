"""The registered boundary-value problems by name.

A package registers a problem under the entry-point group `granbench.problems`, as
``name = "module:Class"`` with a subclass of `Problem`; this module holds no list of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from granbench.errors import ConfigurationError, alternatives
from granbench.fem.problems.problem import Problem

ENTRY_POINTS = "granbench.problems"


class _Registered(Mapping[str, type[Problem]]):
    """Problem classes by name, sorted; each is imported when it is first looked up."""

    def __getitem__(self, name: str) -> type[Problem]:
        points = _entry_points().get(name)
        if points is None:
            raise KeyError(name)
        return _loaded(points)

    def __contains__(self, name: object) -> bool:
        return name in _entry_points()

    def __iter__(self) -> Iterator[str]:
        return iter(sorted(_entry_points()))

    def __len__(self) -> int:
        return len(_entry_points())


PROBLEMS: Mapping[str, type[Problem]] = _Registered()
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
    if name not in PROBLEMS:
        raise ConfigurationError(f"unknown problem {name!r}: {alternatives(name, PROBLEMS)}")
    return PROBLEMS[name]


def _entry_points() -> dict[str, list[EntryPoint]]:
    """Entry points of the group by name."""
    found: dict[str, list[EntryPoint]] = {}
    for point in entry_points(group=ENTRY_POINTS):
        found.setdefault(point.name, []).append(point)
    return found


def _loaded(points: list[EntryPoint]) -> type[Problem]:
    """The class behind a name.

    Raises
    ------
    ConfigurationError
        If two packages use the name, or the entry point does not lead to a problem of this name.
    """
    first = points[0]
    values = sorted({point.value for point in points})
    if len(values) > 1:
        raise ConfigurationError(
            f"the problem {first.name!r} is registered more than once, as {' and '.join(values)}; "
            "uninstall one of the packages"
        )
    where = f"the entry point {first.name} = {first.value!r} of {_package(first)}"
    try:
        kind = first.load()
    except Exception as error:
        raise ConfigurationError(
            f"{where} cannot be loaded ({type(error).__name__}: {error}); repair or uninstall the "
            "package"
        ) from error
    if not (isinstance(kind, type) and issubclass(kind, Problem)):
        raise ConfigurationError(f"{where} must be a subclass of granbench.fem.Problem")
    if kind.name != first.name:
        raise ConfigurationError(
            f"{where} leads to a problem with the name {kind.name!r}; use the same name in both"
        )
    return kind


def _package(point: EntryPoint) -> str:
    return "an unknown package" if point.dist is None else point.dist.name
