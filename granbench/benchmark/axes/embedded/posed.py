"""From a boundary-value problem as a dataset states it to one that can be analysed."""

from typing import Any

import torch

from granbench.cells.contract import Conditions
from granbench.fem import Problem, find_problem
from granbench.fem.statement import ProblemStatement
from granbench.models.classical import ClassicalCell
from granbench.paths.confining_pressure import RandomConfinement


def posed(stated: ProblemStatement) -> Problem:
    """The problem with its choices made.

    Raises
    ------
    ConfigurationError
        If there is no such problem or choice.
    """
    choices: dict[str, Any] = dict(stated.choices)
    if not isinstance(choices["confinement"], float | int):
        choices["confinement"] = RandomConfinement(**choices["confinement"])
    return find_problem(stated.problem, **choices)


def start_of(truth: ClassicalCell, pressure: float) -> dict[str, float]:
    """What is known of every Gauss point at an isotropic start, as a dataset's step 0 has it.

    Parameters
    ----------
    truth : the ground truth, whose internal variables are known
    pressure : Pa

    Returns
    -------
    Internal variables by name, and `initial_void_ratio` where there is a void ratio
    """
    stress = torch.tensor([[pressure, pressure, 0.0]], dtype=truth.dtype)
    with torch.no_grad():
        state = truth.initial_state(Conditions(stress))[0]
    known = {name: float(state[truth.layout[name]]) for name in truth.internals}
    if "void_ratio" in known:
        known["initial_void_ratio"] = known["void_ratio"]
    return known


def stiffest_at(truth: ClassicalCell, pressure: float) -> float:
    """Stiffest normal component of the tangent at an isotropic start, Pa (rho c_d^2, Eq 5.8)."""
    stress = torch.tensor([[pressure, pressure, 0.0]], dtype=truth.dtype)
    with torch.no_grad():
        state = truth.initial_state(Conditions(stress))
    _, _, tangent = truth.tangent(torch.zeros_like(stress), state)
    return float(tangent[0].diagonal()[:2].max())
