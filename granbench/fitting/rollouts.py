r"""Predictions of many parameter vectors at once, and their derivatives.

Where stresses are held, the free strains x of a step solve r(x, state, theta) = 0, and by the
implicit function theorem dx = -(dr/dx)^-1 (dr/dstate dstate + dr/dtheta dtheta): Newton's
iterations of `granbench.element_test.run` are never differentiated, only their final step.

A *gradient* comes from back-propagation through the whole sequence. The *Jacobian* of the compared
quantities, with many rows and few columns, is carried forward from step to step (Eq 7.36):

    d state_n+1 = A d state_n + B d strain + P d theta

where one back-propagation through one step gives A, B and P together: every entry of the new state
is differentiated in its own copy of the points.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from granbench.cells.contract import Conditions
from granbench.element_test.run import run_test
from granbench.element_test.stress_control import IterationLimits
from granbench.fitting.cell_of_each_point import CellOfEachPoint
from granbench.fitting.parameter_space import ParameterSpace, with_parameters
from granbench.fitting.test_batch import TestBatch
from granbench.models import ClassicalCell

HELD_TOLERANCE = 3e-4
"""Relative tolerance of held stresses: finer than the control of any cell pressure, and coarser
than the error of models with error control, below which their stress is not a smooth function of
the strain."""

LIMITS = IterationLimits(iterations=10, halvings=3, smallest_share=0.25, failed_calls=2)
"""Reduced effort: with many parameters of a search the model cannot follow a test, and proving that
would take longer than all other tests."""


@dataclass(frozen=True)
class Prediction:
    """Predictions of parameter vectors for a batch; NaN from where the model failed.

    Parameters
    ----------
    strain, stress : (vector, test, step, component)
    """

    strain: Tensor
    stress: Tensor

    @classmethod
    def unknown(cls, vectors: int, batch: TestBatch) -> "Prediction":
        """The prediction NaN, of vectors that were not run."""
        nothing = torch.full((vectors, *batch.control.driven.shape), torch.nan).double()
        return cls(nothing, nothing)

    def quantities(self, batch: TestBatch) -> Tensor:
        """The compared quantities, (vector, test, step, quantity)."""
        return batch.quantity(self.stress, self.strain)

    def of(self, vectors: Tensor) -> "Prediction":
        """The prediction of the vectors at some places."""
        return Prediction(self.strain[vectors], self.stress[vectors])

    def replaced(self, vectors: Tensor, other: "Prediction") -> "Prediction":
        """A copy with another prediction of the vectors at some places."""
        return Prediction(
            self.strain.index_copy(0, vectors, other.strain),
            self.stress.index_copy(0, vectors, other.stress),
        )


def predict(space: ParameterSpace, vectors: Tensor, batch: TestBatch) -> Prediction:
    """Run all tests of a batch with all parameter vectors (vector, size), as one element test.

    Raises
    ------
    ModelError
        If the model cannot start with these parameters.
    """
    control, conditions = batch.repeated(len(vectors))
    cell = CellOfEachPoint(space.cell, space.per_point(vectors.detach(), batch.size))
    done = run_test(cell, control, conditions, tolerance=HELD_TOLERANCE, limits=LIMITS)
    shape = (len(vectors), batch.size, control.steps, -1)
    return Prediction(
        torch.from_numpy(done.strain).reshape(shape), torch.from_numpy(done.stress).reshape(shape)
    )


def sensitivity(
    space: ParameterSpace, vectors: Tensor, batch: TestBatch, prediction: Prediction
) -> Tensor:
    """Derivatives of the compared quantities, (vector, test, step, quantity, parameter).

    Parameters
    ----------
    vectors : (vector, size)
    batch : the tests
    prediction : of the same vectors, from `predict`
    """
    cell, stress = space.cell, space.cell.layout["stress"]
    held = torch.from_numpy(batch.control.held).repeat(len(vectors), 1, 1)
    along = torch.from_numpy(batch.control.free).repeat(len(vectors), 1, 1)
    _, conditions = batch.repeated(len(vectors) * cell.layout.size)
    free = space.per_point(vectors.detach(), batch.size)
    strain = prediction.strain.flatten(0, 1)
    state, of_parameters, _ = _differentiated(
        cell, free, {}, lambda model, _: model.initial_state(conditions)
    )
    change, moved = of_parameters, strain.new_zeros(*strain[:, 0].shape, space.size)
    stresses, strains = [change[:, stress]], [moved]
    for dstrain in (strain[:, 1:] - strain[:, :-1]).nan_to_num().unbind(dim=1):
        state, of_parameters, (of_state, of_strain) = _differentiated(
            cell,
            free,
            {"state": state, "dstrain": dstrain},
            lambda model, given: model.step(given["dstrain"], given["state"])[1],
        )
        change = of_state @ change + of_parameters
        if along.shape[2]:
            of_free = of_strain @ along
            x, _ = torch.linalg.solve_ex(held @ of_free[:, stress], held @ change[:, stress])
            change = change - of_free @ x
            moved = moved - along @ x
        stresses.append(change[:, stress])
        strains.append(moved)
    # (point, step, component, parameter), for `TestBatch.quantity`: components last.
    of_stress, of_strain = (torch.stack(parts, dim=1).mT for parts in (stresses, strains))
    # The numbers of the cell are the vectors times a scale.
    quantities = batch.quantity(of_stress, of_strain).mT * space.scale
    return quantities.unflatten(0, (len(vectors), batch.size))


def _differentiated(
    cell: ClassicalCell,
    free: Mapping[str, Tensor],
    given: Mapping[str, Tensor],
    action: Callable[[ClassicalCell, Mapping[str, Tensor]], Tensor],
) -> tuple[Tensor, Tensor, tuple[Tensor, ...]]:
    """A state and its derivatives by parameters and given tensors.

    Parameters
    ----------
    cell : the model
    free : unconstrained parameters (point,) by name
    given : (point, n) by name
    action : computes the state (copy * point, n_state) from a cell and the repeated given tensors

    Returns
    -------
    state : (point, n_state)
    of_parameters : (point, n_state, parameter)
    of_given : (point, n_state, n) each
    """
    copies = cell.layout.size
    leaves = {name: value.repeat(copies).requires_grad_() for name, value in free.items()}
    inputs = {name: value.repeat(copies, 1).requires_grad_() for name, value in given.items()}
    with torch.enable_grad():
        state = with_parameters(cell, leaves, lambda model: action(model, inputs))
        by_copy = state.unflatten(0, (copies, -1))
        own = torch.diagonal(by_copy, dim1=0, dim2=2).sum()
    variables = [*leaves.values(), *inputs.values()]
    if own.requires_grad:
        gradients = torch.autograd.grad(own, variables, materialize_grads=True)
    else:
        gradients = tuple(torch.zeros_like(variable) for variable in variables)
    by_name = [gradient.unflatten(0, (copies, -1)) for gradient in gradients]
    of_parameters = torch.stack(by_name[: len(leaves)], dim=-1).transpose(0, 1)
    of_given = tuple(gradient.transpose(0, 1) for gradient in by_name[len(leaves) :])
    return by_copy[0].detach(), of_parameters, of_given


def differentiable_quantities(space: ParameterSpace, vectors: Tensor, batch: TestBatch) -> Tensor:
    """The compared quantities, (vector, test, step, quantity), with gradients to the vectors.

    Raises
    ------
    ModelError
        If the model cannot start with these parameters.
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

    The values are those of the solution; one Newton step from a zero residual with a gradient gives
    the free strains the derivative of the implicit function.
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
