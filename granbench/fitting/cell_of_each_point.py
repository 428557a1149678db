"""A cell with other parameters at every point: many parameter vectors in one batch."""

from collections.abc import Mapping

from torch import Tensor

from granbench.cells.contract import Conditions, MaterialCell
from granbench.fitting.parameter_space import with_parameters
from granbench.models import ClassicalCell


class CellOfEachPoint(MaterialCell):
    """A classical cell with unconstrained parameters of each point.

    A batch may hold the points several times over, one copy of all of them after the other.

    Parameters
    ----------
    cell : left as it was
    free : unconstrained parameters (point,) by name
    """

    def __init__(self, cell: ClassicalCell, free: Mapping[str, Tensor]) -> None:
        self.name, self.order, self.dtype = cell.name, cell.order, cell.dtype
        self.layout, self.internals = cell.layout, cell.internals
        self.cheap_tangent = cell.cheap_tangent
        self._cell = cell
        self._points = len(next(iter(free.values())))
        self._free = {1: dict(free)}

    def _of(self, batch: int) -> Mapping[str, Tensor]:
        """The parameters of a batch of so many points."""
        copies = batch // self._points
        if copies not in self._free:
            self._free[copies] = {name: v.repeat(copies) for name, v in self._free[1].items()}
        return self._free[copies]

    def initial_state(self, conditions: Conditions) -> Tensor:
        """See `MaterialCell.initial_state`."""
        free = self._of(len(conditions.stress))
        return with_parameters(self._cell, free, lambda cell: cell.initial_state(conditions))

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `MaterialCell.step`."""
        free = self._of(len(dstrain))
        return with_parameters(self._cell, free, lambda cell: cell.step(dstrain, state))

    def tangent(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """See `MaterialCell.tangent`."""
        free = self._of(len(dstrain))
        return with_parameters(self._cell, free, lambda cell: cell.tangent(dstrain, state))
