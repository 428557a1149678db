"""The free parameters of a model as one vector of unconstrained numbers, many vectors at a time.

`Parameter.constrained` maps a number u to a value: u = 0 is the value v0 that the cell was made
with, and for a positive parameter u is the logarithm of the factor to it. For one without bounds
it is v = v0 + |v0| u, which would tie a search to the size of a small v0; so here its number is
v - v0 where |v0| is below one.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from granbench.errors import ConfigurationError, Setting, alternatives
from granbench.models import ClassicalCell
from granbench.models.parameters import Parameter


@dataclass(frozen=True)
class ParameterSpace:
    """Which parameters of a cell are fitted.

    Parameters
    ----------
    cell : the model; its own parameters do not change
    names : of the free parameters, in the order of the vectors
    """

    cell: ClassicalCell
    names: tuple[str, ...]

    @classmethod
    def of(cls, cell: ClassicalCell, free: Sequence[str] | None = None) -> "ParameterSpace":
        """The space of the named parameters; all by default.

        Raises
        ------
        ConfigurationError
            If the model has no such parameter, or none is free.
        """
        table = [parameter.name for parameter in cell.parameter_table]
        for name in free or ():
            if name not in table:
                raise ConfigurationError(
                    Setting("free", (name,)),
                    f": {cell.name} has no parameter {name!r}; {alternatives(name, table)}",
                )
        names = tuple(name for name in table if free is None or name in free)
        if not names:
            raise ConfigurationError(
                f"no parameter of {cell.name} is free; name one with ", Setting("free")
            )
        return cls(cell, names)

    @property
    def size(self) -> int:
        """Number of free parameters."""
        return len(self.names)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The free parameters."""
        by_name = {parameter.name: parameter for parameter in self.cell.parameter_table}
        return tuple(by_name[name] for name in self.names)

    @property
    def scale(self) -> Tensor:
        """Factors (size,) from a vector to the unconstrained numbers of the cell."""
        return torch.tensor([self._scale(parameter) for parameter in self.parameters]).double()

    def _scale(self, parameter: Parameter) -> float:
        start = abs(self.cell.reference[parameter.name])
        return 1.0 / start if parameter.lower == -torch.inf and 0.0 < start < 1.0 else 1.0

    def values(self, vectors: Tensor) -> dict[str, Tensor]:
        """Values of the free parameters, each (...), of vectors (..., size)."""
        with torch.no_grad():
            numbers = vectors * self.scale
            return {
                parameter.name: parameter.constrained(
                    numbers[..., place], self.cell.reference[parameter.name]
                )
                for place, parameter in enumerate(self.parameters)
            }

    def vector(self, values: Mapping[str, float]) -> Tensor:
        """The vector (size,) of given values, with those of the cell for the other parameters."""
        numbers = torch.zeros(self.size, dtype=torch.float64)
        for place, parameter in enumerate(self.parameters):
            if parameter.name not in values:
                continue
            value, start = values[parameter.name], self.cell.reference[parameter.name]
            low, high = parameter.lower, parameter.upper
            if low == -math.inf:
                number = (value - start) / (abs(start) or 1.0)
            elif high == math.inf:
                number = math.log((value - low) / (start - low))
            else:
                number = _logit((value - low) / (high - low)) - _logit((start - low) / (high - low))
            numbers[place] = number
        return numbers / self.scale

    def per_point(self, vectors: Tensor, tests: int) -> dict[str, Tensor]:
        """Unconstrained parameters (point,) by name, for points vector by vector, then test."""
        columns = (vectors * self.scale).unbind(dim=1)
        return {
            name: column.repeat_interleave(tests)
            for name, column in zip(self.names, columns, strict=True)
        }


def _logit(share: float) -> float:
    return math.log(share / (1.0 - share))


class _Holder(torch.nn.Module):
    """Wraps an action with a cell as the call of a module, for `functional_call`."""

    def __init__(self, cell: ClassicalCell) -> None:
        super().__init__()
        self.cell = cell

    def forward(self, action: Callable[[ClassicalCell], Any]) -> Any:
        return action(self.cell)


def with_parameters(
    cell: ClassicalCell, free: Mapping[str, Tensor], action: Callable[[ClassicalCell], Any]
) -> Any:
    """The result of an action with a cell that has other unconstrained parameters.

    Parameters
    ----------
    cell : not changed
    free : () or (point,) by name; they may carry gradients of either mode
    action : called with the cell
    """
    # The others without gradients, which are not needed and would cost a graph.
    fixed = {name: value.detach() for name, value in cell.free.items()}
    replaced = {f"cell.free.{name}": value for name, value in {**fixed, **free}.items()}
    return torch.func.functional_call(_Holder(cell), replaced, (action,))
