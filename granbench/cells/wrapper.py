"""A cell that passes everything on to another one, as the base of cells that change one thing."""

import inspect
from typing import Any

from torch import Tensor

from granbench.cells.contract import CONTRACT_ATTRIBUTES, Conditions, History, MaterialCell

_FOLLOWS = {
    "initial_state": ("condition", "condition_each"),
    "step": ("tangent", "condition", "condition_each"),
}
"""Methods of `MaterialCell` that are made of a method, by its name."""


class CellWrapper(MaterialCell):
    """A cell with the attributes, states, stresses and tangents of another one.

    A subclass overrides only what it changes. Whatever `MaterialCell` declares is forwarded: its
    attributes are looked up in the wrapped cell whenever they are read, so that one which changes
    there changes here, unless they are set in the wrapper itself or in its class.

    A subclass that overrides `step` is another model. What follows from the steps is then made of
    its own steps, unless the subclass overrides that too: `tangent`, `condition` and
    `condition_each` are those of `MaterialCell`, and the name is that of the wrapped cell followed
    by that of the class, such as ``j2 + HalfSteps``. With `initial_state` the conditioning changes
    as well. A wrapper that only counts, times or rearranges the calls says so, and everything is
    forwarded::

        class Counted(CellWrapper, same_model=True): ...

    Parameters
    ----------
    cell : the cell to wrap, left as it is

    Attributes
    ----------
    wrapped : the cell itself
    """

    def __init_subclass__(cls, *, same_model: bool = False) -> None:
        super().__init_subclass__()
        if same_model:
            return
        for changed, follow in _FOLLOWS.items():
            for name in follow:
                if changed in vars(cls) and name not in vars(cls):
                    setattr(cls, name, getattr(MaterialCell, name))
        if "step" in vars(cls) and isinstance(inspect.getattr_static(cls, "name"), _Forwarded):
            setattr(cls, "name", _NameWithClass(cls.__name__))  # noqa: B010

    def __init__(self, cell: MaterialCell) -> None:
        self.wrapped = cell

    @property
    def has_own_tangent(self) -> bool:
        """See `MaterialCell.has_own_tangent`."""
        if type(self).tangent is CellWrapper.tangent:
            return self.wrapped.has_own_tangent
        return super().has_own_tangent

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


class _NameWithClass:
    """The wrapped cell's name and the wrapper's class, until a name is set in the wrapper."""

    def __init__(self, class_name: str) -> None:
        self.class_name = class_name

    def __get__(self, wrapper: CellWrapper | None, owner: type[CellWrapper]) -> Any:
        return self if wrapper is None else f"{wrapper.wrapped.name} + {self.class_name}"


for _name in CONTRACT_ATTRIBUTES:
    setattr(CellWrapper, _name, _Forwarded(_name))
