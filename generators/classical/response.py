"""The response of a classical model along given strain paths."""

from dataclasses import dataclass

import torch
from torch import Tensor

from granbench.cells.contract import Conditions
from granbench.generators.rounding import recorded
from granbench.models.classical import ClassicalCell


@dataclass(frozen=True)
class Response:
    """The response of a model along strain paths.

    Parameters
    ----------
    stress : (path, step, component), Pa
    internals : (path, step), by name
    mean_stress : (path, step), Pa, including the out-of-plane stress if the model has one
    tangent : (path, step, component, component), Pa; None if it was not computed
    """

    stress: Tensor
    internals: dict[str, Tensor]
    mean_stress: Tensor
    tangent: Tensor | None


def isotropic_start(cell: ClassicalCell, mean_stress: float, count: int) -> Conditions:
    """Conditions at an isotropic stress, with the internal variables at the start of the model.

    They are rounded as in a dataset, so that a model which starts from the record repeats exactly
    the run that made the record.

    Parameters
    ----------
    cell : the model
    mean_stress : Pa, compression positive
    count : number of points
    """
    normal = cell.rows.normal[: cell.component_count].T
    stress = _rounded(cell, "stress", (mean_stress * normal).expand(count, -1))
    state = cell.initial_state(Conditions(stress))
    internals = {name: state[:, cell.layout[name]].squeeze(-1) for name in cell.internals}
    known = {name: _rounded(cell, name, values.detach()) for name, values in internals.items()}
    if "void_ratio" in known:
        known["initial_void_ratio"] = known["void_ratio"]
    return Conditions(stress, known | {"initial_mean_stress": cell.rows.mean(_rows(cell, state))})


def _rounded(cell: ClassicalCell, name: str, values: Tensor) -> Tensor:
    return torch.from_numpy(recorded(name, values)).to(cell.dtype)


def response(
    cell: ClassicalCell, strain: Tensor, start: Conditions, *, tangents: bool = False
) -> Response:
    """Run a model along strain paths.

    Parameters
    ----------
    cell : the model
    strain : (path, step, component), cumulative; step 0 is the reference
    start : conditions at step 0
    tangents : whether to compute the tangent of every step; at step 0, that of a zero increment
    """
    state = cell.initial_state(start).detach()
    states, moduli = [state], []
    increments = strain.diff(dim=1, prepend=strain[:, :1])
    if tangents:
        moduli.append(cell.tangent(increments[:, 0], state)[2])
    for increment in increments[:, 1:].unbind(dim=1):
        if tangents:
            _, state, modulus = cell.tangent(increment, state)
            moduli.append(modulus)
        else:
            with torch.no_grad():
                _, state = cell.step(increment, state)
        states.append(state)
    history = torch.stack(states, dim=1)
    return Response(
        stress=history[..., cell.layout["stress"]],
        internals={name: history[..., cell.layout[name]].squeeze(-1) for name in cell.internals},
        mean_stress=torch.stack([cell.rows.mean(_rows(cell, state)) for state in states], dim=1),
        tangent=torch.stack(moduli, dim=1) if moduli else None,
    )


def _rows(cell: ClassicalCell, state: Tensor) -> Tensor:
    """The stress in the rows of the model, with zz last in plane strain."""
    return state.T[: cell.rows.count].detach()
