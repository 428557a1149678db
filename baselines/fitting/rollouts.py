r"""Predictions of many parameter vectors at a time, and their derivatives in both modes.

Where stresses are held, the free strains x of a step solve r(x, state, theta) = 0, and by the
implicit function theorem dx = -(dr/dx)^-1 (dr/dstate dstate + dr/dtheta dtheta): Newton's
iterations of `granbench.element_test` are never differentiated, only the step that they end with.

*Forward*, for the Jacobian of a few parameters: state sensitivities are carried from step to step
(Eq 7.36 turned round). One call of the cell with dual numbers gives d(stress, state)/d theta at
fixed x and d(stress, state)/dx together, for each direction is a copy of the points of its own.

*Reverse*, for a gradient: back-propagation through the whole sequence.
"""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.autograd import forward_ad

from granbench.baselines.fitting.observations import TestBatch
from granbench.baselines.fitting.parameter_space import ParameterSpace, with_parameters
from granbench.cell import Conditions
from granbench.element_test import run_test
from granbench.models import ClassicalCell


@dataclass(frozen=True)
class Prediction:
    """What parameter vectors predict for a batch; NaN from where the model could not follow.

    Parameters
    ----------
    strain, stress : (vector, test, step, component)
    """

    strain: Tensor
    stress: Tensor

    def quantities(self, batch: TestBatch) -> Tensor:
        """What is compared, (vector, test, step, quantity)."""
        return batch.quantity(self.stress, self.strain)


def predict(space: ParameterSpace, vectors: Tensor, batch: TestBatch) -> Prediction:
    """Run all tests of a batch with all parameter vectors (vector, size), as one element test.

    Raises
    ------
    ModelError
        If the model cannot start so.
    """
    control, conditions = batch.repeated(len(vectors))
    free = space.per_point(vectors.detach(), batch.size)
    done = with_parameters(space.cell, free, lambda cell: run_test(cell, control, conditions))
    shape = (len(vectors), batch.size, control.steps, -1)
    return Prediction(
        torch.from_numpy(done.strain).reshape(shape), torch.from_numpy(done.stress).reshape(shape)
    )


def sensitivity(
    space: ParameterSpace, vectors: Tensor, batch: TestBatch, prediction: Prediction
) -> Tensor:
    """Derivatives of what is compared, (vector, test, step, quantity, parameter).

    Parameters
    ----------
    vectors : (vector, size)
    batch : the tests
    prediction : that `predict` made of the same vectors
    """
    points = len(vectors) * batch.size
    held = torch.from_numpy(batch.control.held).repeat(len(vectors), 1, 1)
    along = torch.from_numpy(batch.control.free).repeat(len(vectors), 1, 1)
    slots = space.size + along.shape[2]
    _, conditions = batch.repeated(len(vectors) * slots)
    free = space.per_point(vectors.detach(), batch.size)
    strain = prediction.strain.flatten(0, 1)
    increments = (strain[:, 1:] - strain[:, :-1]).nan_to_num()
    # Copy by copy: first one for each parameter, then one for each free strain.
    dstrain_tangent = torch.zeros(slots, points, strain.shape[2], dtype=torch.float64)
    dstrain_tangent[space.size :] = along.permute(2, 0, 1)

    def run(cell: ClassicalCell) -> Tensor:
        state, carried = _parts(cell.initial_state(conditions), points)
        stress_change = carried[: space.size, :, cell.layout["stress"]]
        strain_change = torch.zeros_like(dstrain_tangent[: space.size])
        stresses, strains = [stress_change], [strain_change]
        for dstrain in increments.unbind(dim=1):
            incoming = carried.clone()
            incoming[space.size :] = 0.0
            _, after = cell.step(
                forward_ad.make_dual(dstrain.repeat(slots, 1), dstrain_tangent.flatten(0, 1)),
                forward_ad.make_dual(state.repeat(slots, 1), incoming.flatten(0, 1)),
            )
            state, local = _parts(after, points)
            carried, moved = _implicit(local, held, space.size, cell.layout["stress"])
            strain_change = strain_change + torch.einsum("pck,jpk->jpc", along, moved)
            stresses.append(carried[: space.size, :, cell.layout["stress"]])
            strains.append(strain_change)
        change = batch.quantity(torch.stack(stresses, 2), torch.stack(strains, 2))
        return change.unflatten(1, (len(vectors), batch.size)).permute(1, 2, 3, 4, 0)

    with forward_ad.dual_level():
        unit = torch.eye(slots, space.size, dtype=torch.float64).repeat_interleave(points, 0)
        dual = {
            name: forward_ad.make_dual(free[name].repeat(slots), unit[:, place].contiguous())
            for place, name in enumerate(space.names)
        }
        return with_parameters(space.cell, dual, run)


def _parts(dual: Tensor, points: int) -> tuple[Tensor, Tensor]:
    """Value (point, n) of the first copy, and the tangents (slot, point, n) of all."""
    value, tangent = forward_ad.unpack_dual(dual)
    if tangent is None:
        tangent = torch.zeros_like(value)
    return value[:points], tangent.unflatten(0, (-1, points))


def _implicit(local: Tensor, held: Tensor, parameters: int, stress: slice) -> tuple[Tensor, Tensor]:
    """Tangents after a step in which the free strains keep the held stresses.

    Parameters
    ----------
    local : (slot, point, n), tangents at fixed free strains, then those of the free strains
    held : (point, control, component)
    parameters : number of the first kind of slots
    stress : where the state holds the stress

    Returns
    -------
    carried : (slot, point, n)
    moved : (parameter, point, control), d x / d theta of the step
    """
    at_fixed, of_free = local[:parameters], local[parameters:]
    if not len(of_free):
        return local, local.new_zeros(parameters, local.shape[1], 0)
    by_parameter = torch.einsum("pkc,jpc->pkj", held, at_fixed[..., stress])
    by_strain = torch.einsum("pkc,xpc->pkx", held, of_free[..., stress])
    solved, _ = torch.linalg.solve_ex(by_strain, by_parameter)
    moved = -solved.permute(2, 0, 1)
    carried = local.clone()
    carried[:parameters] = at_fixed + torch.einsum("xpn,jpx->jpn", of_free, moved)
    return carried, moved


def differentiable_quantities(space: ParameterSpace, vectors: Tensor, batch: TestBatch) -> Tensor:
    """What is compared, (vector, test, step, quantity), with gradients to the vectors.

    Raises
    ------
    ModelError
        If the model cannot start so.
    """
    control, conditions = batch.repeated(len(vectors))
    free = space.per_point(vectors, batch.size)
    if control.held.shape[1] == 0:
        strain = torch.from_numpy(control.driven)
        stress = with_parameters(
            space.cell, free, lambda cell: cell.rollout(strain, conditions).stress
        )
    else:
        solved = predict(space, vectors, batch).strain.flatten(0, 1)
        held, along = torch.from_numpy(control.held), torch.from_numpy(control.free)
        stress, strain = with_parameters(
            space.cell, free, lambda cell: _implicit_rollout(cell, solved, held, along, conditions)
        )
    shape = (len(vectors), batch.size)
    return batch.quantity(stress, strain).unflatten(0, shape)


def _implicit_rollout(
    cell: ClassicalCell, solved: Tensor, held: Tensor, along: Tensor, conditions: Conditions
) -> tuple[Tensor, Tensor]:
    """Stress and strain (point, step, component) about a solution of mixed control.

    The values are those of the solution; the free strains get the derivative of the implicit
    function by one Newton step from a residual that is zero but has a gradient.
    """
    state = cell.initial_state(conditions)
    strain = torch.zeros_like(solved[:, 0])
    stresses, strains = [state[:, cell.layout["stress"]]], [strain]
    for dstrain in (solved[:, 1:] - solved[:, :-1]).unbind(dim=1):
        stress, _ = cell.step(dstrain, state)
        residual = torch.einsum("pkc,pc->pk", held, stress)
        _, _, tangent = cell.tangent(dstrain, state.detach())
        step, _ = torch.linalg.solve_ex(held @ tangent @ along, residual - residual.detach())
        dstrain = dstrain - torch.einsum("pck,pk->pc", along, step)
        stress, state = cell.step(dstrain, state)
        strain = strain + dstrain
        stresses.append(stress)
        strains.append(strain)
    return torch.stack(stresses, dim=1), torch.stack(strains, dim=1)
