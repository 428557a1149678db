"""The material cell: the one interface of classical models, networks and particle specimens.

A cell is batched over points and driven by strain increments (Eq 6.7: I = M(d_eps, I0)).
Everything else - rollout, single-step prediction, finite elements - is derived from
`initial_state`, `step` and `condition`, here and once.
"""

import abc
from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import torch
from torch import Tensor

from granbench.cells.contract.conditions import Conditions, History
from granbench.cells.contract.state_layout import StateLayout
from granbench.cells.finite_differences import step_and_tangent
from granbench.errors import GranbenchError
from granbench.tensors import COMPONENT_ORDERS

FLOATING_FAILURES = (ArithmeticError, torch.linalg.LinAlgError)
"""What a cell may raise for a point that it cannot follow, in place of a NaN stress."""


@dataclass(frozen=True)
class Rollout:
    """What a cell predicts along whole paths; step 0 is the given start.

    Parameters
    ----------
    stress : (path, step, component), Pa, compression positive
    internals : (path, step) under their dataset names
    """

    stress: Tensor
    internals: Mapping[str, Tensor]


class MaterialCell(abc.ABC):
    """A constitutive model, batched over points.

    Attributes
    ----------
    name : what the leaderboard calls it
    order : component order of strain and stress, a key of `COMPONENT_ORDERS`
    dtype : floating type of state and stress
    layout : named slices of the state; it always has a slice `stress`
    internals : names of one-wide slices that predict the dataset variable of the same name
    reads_records : whether it looks its stresses up in records instead of computing them from the
        increment, as the oracle does; it then has no stress for any other strain
    cheap_tangent : whether `tangent` costs little more than a step; if not, Newton's method under
        held stresses takes differences instead, see `granbench.cells.difference_tangent`
    pressure_dependent : whether the model is defined under compression only, as a frictional one
    """

    name: str
    order: str = "principal"
    dtype: torch.dtype = torch.float64
    layout: StateLayout
    internals: tuple[str, ...] = ()
    reads_records: bool = False
    cheap_tangent: bool = True
    pressure_dependent: bool = False

    @property
    def component_count(self) -> int:
        """Number of strain and stress components."""
        return len(COMPONENT_ORDERS[self.order])

    @property
    def has_own_tangent(self) -> bool:
        """Whether the model computes its tangent itself, instead of torch from its `step`."""
        return type(self).tangent is not MaterialCell.tangent

    @abc.abstractmethod
    def initial_state(self, conditions: Conditions) -> Tensor:
        """State (point, n_state) where a path begins."""

    @abc.abstractmethod
    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """One strain increment.

        Parameters
        ----------
        dstrain : (point, component), compression positive
        state : (point, n_state), left unchanged

        Returns
        -------
        stress : (point, component), Pa
        state : (point, n_state), after the increment
        """

    def tangent(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """One strain increment with its tangent.

        =======================================  =================  =============================
        cell                                     `has_own_tangent`  where its tangent comes from
        =======================================  =================  =============================
        overrides `tangent`                      True               its own method
        does not, and torch can follow `step`    False              `differentiated`
        does not, and torch cannot               False              differences of steps
        `CellWrapper` that overrides `step`      False              as the two rows above
        any other `CellWrapper`                  as wrapped         the wrapped cell
        =======================================  =================  =============================

        Newton's method uses it where `cheap_tangent` is True, and else differences of steps
        (`granbench.cells.difference_tangent`). Before a model is scored, driven or put into an
        analysis, `granbench.cells.check` sets `cheap_tangent` to False where torch cannot follow
        the step, or the tangent is far from the change of stress.

        Parameters
        ----------
        dstrain, state : as in `step`

        Returns
        -------
        stress, state : as of `step`, without gradients
        tangent : (point, component, component), Pa; d stress_i / d strain_j, where moving a
            shear strain moves both of its entries in the tensor
        """
        found = self.differentiated(dstrain, state)
        return found or step_and_tangent(self.step, dstrain.detach(), state.detach())

    @final
    def differentiated(
        self, dstrain: Tensor, state: Tensor
    ) -> tuple[Tensor, Tensor, Tensor] | None:
        """What `tangent` returns, by automatic differentiation.

        None where torch cannot follow the step from strain to stress: it is made without gradients
        (`torch.no_grad`, `detach`), outside of torch (NumPy), or in place.
        """
        try:
            with torch.enable_grad():
                variable = dstrain.detach().requires_grad_()
                stress, after = self.step(variable, state.detach())
                rows = [
                    torch.autograd.grad(
                        component.sum(), variable, retain_graph=True, allow_unused=True
                    )[0]
                    for component in stress.unbind(dim=-1)
                    if component.requires_grad
                ]
        except (GranbenchError, *FLOATING_FAILURES):
            raise
        except Exception:  # a mistake in `step` itself is raised again without gradients
            return None
        found = [row for row in rows if row is not None]
        if len(found) < stress.shape[-1]:
            return None
        return stress.detach(), after.detach(), torch.stack(found, dim=1)

    def condition(self, history: History) -> Tensor:
        """State (point, n_state) that a true record implies at its last step.

        The cell runs along the true strain, and at every step the true stress and internals
        replace its own. For a cell whose state is explicit (stress and internals) that is the
        last true state; a recurrent cell keeps the hidden state of the run.
        """
        state = self.initial_state(history.conditions)
        for step in range(1, history.strain.shape[1]):
            increment = history.strain[:, step] - history.strain[:, step - 1]
            _, state = self.step(increment.to(self.dtype), state)
            state = self._with_truth(state, history, step)
        return state

    def condition_each(self, history: History) -> Tensor:
        """`condition` of the record up to every step, (point, step, n_state).

        Equal to stacking ``condition(history.until(n))``, at the cost of one run.
        """
        state = self.initial_state(history.conditions)
        states = [state]
        for step in range(1, history.strain.shape[1]):
            increment = history.strain[:, step] - history.strain[:, step - 1]
            _, state = self.step(increment.to(self.dtype), state)
            state = self._with_truth(state, history, step)
            states.append(state)
        return torch.stack(states, dim=1)

    def _with_truth(self, state: Tensor, history: History, step: int) -> Tensor:
        state = state.clone()
        state[:, self.layout["stress"]] = history.stress[:, step].to(self.dtype)
        for name in self.internals:
            if name in history.internals:
                state[:, self.layout[name]] = history.internals[name][:, step, None].to(self.dtype)
        return state

    @final
    def rollout(self, strain: Tensor, conditions: Conditions) -> Rollout:
        """Free run along whole paths: the cell's own outputs are fed back.

        Parameters
        ----------
        strain : (path, step, component), cumulative; step 0 is the reference
        conditions : what is known at step 0

        Returns
        -------
        Rollout with stress (path, step, component); its step 0 is the given stress
        """
        state = self.initial_state(conditions)
        stresses = [conditions.stress.to(self.dtype)]
        states = [state]
        increments = (strain[:, 1:] - strain[:, :-1]).to(self.dtype)
        for dstrain in increments.unbind(dim=1):
            stress, state = self.step(dstrain, state)
            stresses.append(stress)
            states.append(state)
        internals = {
            name: torch.stack([s[:, self.layout[name]].squeeze(-1) for s in states], dim=1)
            for name in self.internals
        }
        return Rollout(torch.stack(stresses, dim=1), internals)

    def parameters_count(self) -> int:
        """Number of trainable or fitted parameters."""
        return 0


CONTRACT_ATTRIBUTES = tuple(MaterialCell.__annotations__)
"""Names of the attributes of `MaterialCell`, which every cell has and `CellWrapper` forwards."""
