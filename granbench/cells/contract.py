"""The material cell: the one contract that classical models, networks and DEM specimens share.

A cell is batched over points and driven by strain increments (Eq 6.7: I = M(d_eps, I0)).
Everything else - rollout, single-step prediction, finite elements - is derived from
`initial_state`, `step` and `condition`, here and once.
"""

import abc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, final

import torch
from torch import Tensor

from granbench.cells.step_differences import step_and_differences
from granbench.errors import GranbenchError, ModelError
from granbench.tensors import COMPONENT_ORDERS

FLOATING_FAILURES = (ArithmeticError, torch.linalg.LinAlgError)
"""What a cell may raise for a point that it cannot follow, in place of a NaN stress."""


@dataclass(frozen=True)
class Conditions:
    """What is known of each point when a path, or a window of it, begins.

    Parameters
    ----------
    stress : (point, component), Pa, compression positive
    scalars : per-point quantities (point,) under their dataset names, such as
        `initial_void_ratio`, `grading_index`, `initial_mean_stress`
    accumulated_strain : (point, component), the chi of Eq 2.2 at this start, dimensionless;
        zero where a path begins
    """

    stress: Tensor
    scalars: Mapping[str, Tensor] = field(default_factory=dict)
    accumulated_strain: Tensor | None = None

    def require(self, name: str) -> Tensor:
        """The scalar `name`, (point,).

        Raises
        ------
        ModelError
            If the path does not carry it.
        """
        if name not in self.scalars:
            raise ModelError(
                f"the model needs {name!r} at a path's start, but the conditions give only "
                f"{', '.join(sorted(self.scalars)) or 'the stress'}; use a dataset that has it"
            )
        return self.scalars[name]

    def past_strain(self) -> Tensor:
        """Accumulated absolute strain at this start, (point, component)."""
        if self.accumulated_strain is None:
            return torch.zeros_like(self.stress)
        return self.accumulated_strain


@dataclass(frozen=True)
class History:
    """A true record, from its start up to its last known step.

    Parameters
    ----------
    strain, stress : (point, step, component), compression positive
    internals : (point, step) under their dataset names, such as `void_ratio`
    conditions : what was known at step 0
    """

    strain: Tensor
    stress: Tensor
    internals: Mapping[str, Tensor]
    conditions: Conditions

    def until(self, step: int) -> "History":
        """The record up to and including `step`."""
        return History(
            self.strain[:, : step + 1],
            self.stress[:, : step + 1],
            {name: series[:, : step + 1] for name, series in self.internals.items()},
            self.conditions,
        )


@dataclass(frozen=True)
class StateLayout:
    """Named slices of a state tensor (point, n_state)."""

    slices: Mapping[str, slice]
    size: int

    @classmethod
    def of(cls, **widths: int) -> "StateLayout":
        """Layout with the given names and widths, in that order."""
        slices, start = {}, 0
        for name, width in widths.items():
            slices[name] = slice(start, start + width)
            start += width
        return cls(slices, start)

    def __getitem__(self, name: str) -> slice:
        return self.slices[name]

    def __contains__(self, name: str) -> bool:
        return name in self.slices

    def pack(self, **parts: Tensor) -> Tensor:
        """One state from its named parts, (point, n_state), stored component-major.

        Component-major storage keeps each component contiguous over the points, which is
        several times faster at many points; the shape a caller sees stays (point, n_state).
        """
        missing = set(self.slices) ^ set(parts)
        if missing:
            raise ModelError(f"state parts {sorted(missing)} do not fit the layout")
        rows = [part.T if part.ndim == 2 else part.unsqueeze(0) for part in parts.values()]
        order = {name: row for name, row in zip(parts, rows, strict=True)}
        return torch.cat([order[name] for name in self.slices]).T


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
    reads_records : whether it reads its answers from records instead of computing them from the
        increment, as the oracle does; then it has none where the strain is not the recorded one
    cheap_tangent : whether `tangent` costs little more than a step; if not, Newton's method under
        held stresses takes differences instead, see `granbench.cells.difference_tangent`
    """

    name: str
    order: str = "principal"
    dtype: torch.dtype = torch.float64
    layout: StateLayout
    internals: tuple[str, ...] = ()
    reads_records: bool = False
    cheap_tangent: bool = True

    @property
    def component_count(self) -> int:
        """Number of strain and stress components."""
        return len(COMPONENT_ORDERS[self.order])

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

        Unless overridden it comes from automatic differentiation or, where `differentiated` finds
        no derivative, from differences of steps.

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
        return found or step_and_differences(self.step, dstrain.detach(), state.detach())

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
        except Exception:  # a mistake in the step itself shows again where it is made without
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


class ModuleCell(MaterialCell):
    """Any ``torch.nn.Module`` as a material cell.

    The module maps (dstrain, state) to (stress, state), as `MaterialCell.step` does, or, when
    it keeps no state but the stress, (dstrain, stress) to stress::

        class Secant(torch.nn.Module):
            def forward(self, dstrain, stress):
                return stress + 30e6 * dstrain

        cell = ModuleCell(Secant(), name="secant")

    Parameters
    ----------
    module : the network
    name : what the leaderboard calls it
    order : component order of strain and stress
    layout : named slices of the state; only the stress by default
    start : maps `Conditions` to the first state; by default every slice but `stress` is taken
        from the conditions' scalar of that name (or `initial_` and the name), or zero
    internals : see `MaterialCell`
    dtype : floating type of the module
    """

    def __init__(
        self,
        module: torch.nn.Module,
        *,
        name: str,
        order: str = "principal",
        layout: StateLayout | None = None,
        start: Callable[[Conditions], Tensor] | None = None,
        internals: tuple[str, ...] = (),
        dtype: torch.dtype = torch.float32,
    ) -> None:
        self.module = module.to(dtype)
        self.name = name
        self.order = order
        self.dtype = dtype
        self.layout = layout or StateLayout.of(stress=len(COMPONENT_ORDERS[order]))
        self.internals = internals
        self._start = start

    def initial_state(self, conditions: Conditions) -> Tensor:
        """See `MaterialCell.initial_state`."""
        if self._start is not None:
            return self._start(conditions).to(self.dtype)
        parts = {}
        for name, part in self.layout.slices.items():
            width = part.stop - part.start
            if name == "stress":
                parts[name] = conditions.stress
            elif (start := self._known_at_start(name, conditions)) is not None:
                parts[name] = start.unsqueeze(-1).expand(-1, width)
            else:
                parts[name] = conditions.stress.new_zeros(len(conditions.stress), width)
        return self.layout.pack(**{name: part.to(self.dtype) for name, part in parts.items()})

    @staticmethod
    def _known_at_start(name: str, conditions: Conditions) -> Tensor | None:
        scalars = conditions.scalars
        return scalars.get(name, scalars.get(f"initial_{name}"))

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `MaterialCell.step`.

        The module gets copies and what it returns is copied, so that it may work in place.
        """
        result = self.module(dstrain.clone(), state.clone())
        if isinstance(result, tuple | list):
            stress, after = _copies(result)
            return stress, after
        if self.layout.size != self.component_count:
            raise ModelError(
                f"the module of {self.name!r} returns only a stress but its layout has "
                f"{self.layout.size} state entries; return (stress, state) instead"
            )
        (stress,) = _copies([result])
        return stress, stress

    def parameters_count(self) -> int:
        """Number of trainable parameters of the module."""
        return sum(parameter.numel() for parameter in self.module.parameters())


def _copies(parts: Sequence[Any]) -> list[Any]:
    """Copies of tensors, without a graph of gradients where none is asked for."""
    if not torch.is_grad_enabled():
        parts = [part.detach() if isinstance(part, Tensor) else part for part in parts]
    return [part.clone() if isinstance(part, Tensor) else part for part in parts]
