"""Any torch module as a material cell."""

from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor

from granbench.cells.contract.conditions import Conditions
from granbench.cells.contract.material_cell import MaterialCell
from granbench.cells.contract.state_layout import StateLayout
from granbench.errors import ModelError
from granbench.tensors import COMPONENT_ORDERS


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
    """Copies of tensors, without a graph where gradients are switched off."""
    if not torch.is_grad_enabled():
        parts = [part.detach() if isinstance(part, Tensor) else part for part in parts]
    return [part.clone() if isinstance(part, Tensor) else part for part in parts]
