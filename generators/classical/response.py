"""What a classical model answers along given strain paths, kept whole."""

from dataclasses import dataclass

import torch
from torch import Tensor

from granbench.cells.contract import Conditions
from granbench.generators.rounding import recorded
from granbench.models.classical import ClassicalCell


@dataclass(frozen=True)
class Response:
    """Records of a model along strain paths.

    Parameters
    ----------
    stress : (path, step, component), Pa
    internals : (path, step), by name
    mean_stress : (path, step), Pa, with the stress out of the plane where the model has one
    tangent : (path, step, component, component), Pa; None where it was not asked for
    """

    stress: Tensor
    internals: dict[str, Tensor]
    mean_stress: Tensor
    tangent: Tensor | None


def isotropic_start(cell: ClassicalCell, mean_stress: float, count: int) -> Conditions:
    """Conditions at an isotropic stress, with the internal variables that the model starts from.

    They are given as a dataset keeps them, so that a model which is started from the record
    makes the very run that made it.

    Parameters
    ----------
    cell : the model
    mean_stress : Pa
    count : number of points
    """
    normal = cell.rows.normal[: cell.component_count].T
    stress = _kept(cell, "stress", (mean_stress * normal).expand(count, -1))
    state = cell.initial_state(Conditions(stress))
    internals = {name: state[:, cell.layout[name]].squeeze(-1) for name in cell.internals}
    known = {name: _kept(cell, name, values.detach()) for name, values in internals.items()}
    if "void_ratio" in known:
        known["initial_void_ratio"] = known["void_ratio"]
    return Conditions(stress, known | {"initial_mean_stress": cell.rows.mean(_rows(cell, state))})


def _kept(cell: ClassicalCell, name: str, values: Tensor) -> Tensor:
    return torch.from_numpy(recorded(name, values)).to(cell.dtype)


def response(
    cell: ClassicalCell, strain: Tensor, start: Conditions, *, tangents: bool = False
) -> Response:
    """Run a model along strain paths.

    Parameters
    ----------
    cell : the model
    strain : (path, step, component), cumulative; step 0 is the reference
    start : what is known at step 0
    tangents : whether the tangent of every step is wanted; that of step 0 is of a zero increment
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
    """The stress as the model's rows, with zz last in plane strain."""
    return state.T[: cell.rows.count].detach()
