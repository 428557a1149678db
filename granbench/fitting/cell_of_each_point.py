"""A cell with other parameters at every point: many parameter vectors in one batch."""

from collections.abc import Callable, Mapping
from typing import Any

from torch import Tensor

from granbench.cells.contract import Conditions, History
from granbench.cells.wrapper import CellWrapper
from granbench.fitting.parameter_space import with_parameters
from granbench.models import ClassicalCell


class CellOfEachPoint(CellWrapper, same_model=True):
    """A classical cell with unconstrained parameters of each point.

    A batch may hold the points several times over, one copy of all of them after the other.

    Parameters
    ----------
    cell : left as it is
    free : unconstrained parameters (point,) by name
    """

    wrapped: ClassicalCell

    def __init__(self, cell: ClassicalCell, free: Mapping[str, Tensor]) -> None:
        super().__init__(cell)
        self._points = len(next(iter(free.values())))
        self._free = {1: dict(free)}

    def initial_state(self, conditions: Conditions) -> Tensor:
        """See `MaterialCell.initial_state`."""
        return self._with_free(len(conditions.stress), lambda cell: cell.initial_state(conditions))

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `MaterialCell.step`."""
        return self._with_free(len(dstrain), lambda cell: cell.step(dstrain, state))

    def tangent(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """See `MaterialCell.tangent`."""
        return self._with_free(len(dstrain), lambda cell: cell.tangent(dstrain, state))

    def condition(self, history: History) -> Tensor:
        """See `MaterialCell.condition`."""
        return self._with_free(len(history.strain), lambda cell: cell.condition(history))

    def condition_each(self, history: History) -> Tensor:
        """See `MaterialCell.condition_each`."""
        return self._with_free(len(history.strain), lambda cell: cell.condition_each(history))

    def _with_free(self, points: int, action: Callable[[ClassicalCell], Any]) -> Any:
        """What an action with the cell returns, with parameters for each of so many points."""
        copies = points // self._points
        if copies not in self._free:
            self._free[copies] = {name: v.repeat(copies) for name, v in self._free[1].items()}
        return with_parameters(self.wrapped, self._free[copies], action)
