"""State of a classical model at an isotropic start in plane strain."""

import torch
from torch import Tensor

from granbench.cells.contract import Conditions
from granbench.models.classical import ClassicalCell


def internals_at_start(cell: ClassicalCell, pressure: float) -> dict[str, float]:
    """Internal variables of a model at an isotropic stress, as step 0 of a dataset has them.

    Parameters
    ----------
    cell : the model
    pressure : mean stress, Pa, compression positive

    Returns
    -------
    Internal variables by name, and `initial_void_ratio` if the model has a void ratio
    """
    with torch.no_grad():
        state = cell.initial_state(Conditions(_isotropic(cell, pressure)))[0]
    known = {name: float(state[cell.layout[name]]) for name in cell.internals}
    if "void_ratio" in known:
        known["initial_void_ratio"] = known["void_ratio"]
    return known


def stiffest_normal_modulus(cell: ClassicalCell, pressure: float) -> float:
    """Largest normal component of the tangent at an isotropic stress, Pa (rho c_d^2, Eq 5.8).

    Parameters
    ----------
    cell : the model
    pressure : mean stress, Pa, compression positive
    """
    stress = _isotropic(cell, pressure)
    with torch.no_grad():
        state = cell.initial_state(Conditions(stress))
    _, _, tangent = cell.tangent(torch.zeros_like(stress), state)
    return float(tangent[0].diagonal()[:2].max())


def _isotropic(cell: ClassicalCell, pressure: float) -> Tensor:
    return torch.tensor([[pressure, pressure, 0.0]], dtype=cell.dtype)
