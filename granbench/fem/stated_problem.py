"""Boundary-value problems from their statements in datasets and tasks."""

from typing import Any

from granbench.fem import Problem, find_problem
from granbench.fem.statement import ProblemStatement
from granbench.paths.confining_pressure import RandomConfinement


def build_problem(stated: ProblemStatement) -> Problem:
    """The problem with its choices made.

    Parameters
    ----------
    stated : the problem as a dataset states it

    Raises
    ------
    ConfigurationError
        If there is no such problem or choice.
    """
    choices: dict[str, Any] = dict(stated.choices)
    if not isinstance(choices["confinement"], float | int):
        choices["confinement"] = RandomConfinement(**choices["confinement"])
    return find_problem(stated.problem, **choices)
