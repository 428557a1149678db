"""A cell that passes everything on to another one, as the base of cells that change one thing."""

from typing import Any

from torch import Tensor

from granbench.cells.contract import CONTRACT_ATTRIBUTES, Conditions, History, MaterialCell


class CellWrapper(MaterialCell):
    """A cell with the attributes, states, stresses and tangents of another one.

    A subclass overrides only what it changes. Whatever `MaterialCell` declares is forwarded: its
    attributes are looked up in the wrapped cell whenever they are read, so that one which changes
    there changes here, unless they are set in the wrapper itself or in its class.

    Parameters
    ----------
    cell : the cell to wrap, left as it is

    Attributes
    ----------
    wrapped : the cell itself
    """

    def __init__(self, cell: MaterialCell) -> None:
        self.wrapped = cell

    @property
    def has_own_tangent(self) -> bool:
        """See `MaterialCell.has_own_tangent`."""
        if type(self).tangent is CellWrapper.tangent:
            return self.wrapped.has_own_tangent
        return True

    def initial_state(self, conditions: Conditions) -> Tensor:
        """See `MaterialCell.initial_state`."""
        return self.wrapped.initial_state(conditions)

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `MaterialCell.step`."""
        return self.wrapped.step(dstrain, state)

    def tangent(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """See `MaterialCell.tangent`."""
        return self.wrapped.tangent(dstrain, state)

    def condition(self, history: History) -> Tensor:
        """See `MaterialCell.condition`."""
        return self.wrapped.condition(history)

    def condition_each(self, history: History) -> Tensor:
        """See `MaterialCell.condition_each`."""
        return self.wrapped.condition_each(history)

    def parameters_count(self) -> int:
        """See `MaterialCell.parameters_count`."""
        return self.wrapped.parameters_count()


class _Forwarded:
    """An attribute that is read from the wrapped cell until it is set in the wrapper."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __get__(self, wrapper: CellWrapper | None, owner: type[CellWrapper]) -> Any:
        if wrapper is None:
            return getattr(MaterialCell, self.name, None)
        return getattr(wrapper.wrapped, self.name)


for _name in CONTRACT_ATTRIBUTES:
    setattr(CellWrapper, _name, _Forwarded(_name))
