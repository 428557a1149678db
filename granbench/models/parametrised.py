"""A torch module with named material parameters and published sets of their values."""

from collections.abc import Mapping, Sequence
from typing import ClassVar, NamedTuple, cast

import torch
from torch import Tensor

from granbench.errors import ModelError, alternatives
from granbench.models.parameters import Constants, Parameter


class _Fixed(NamedTuple):
    """Constants that were made once, of unconstrained numbers `free`, for both kinds of arrays."""

    free: list[float]
    in_torch: Constants
    in_numpy: Constants


class ParametrisedModule(torch.nn.Module):
    """Material parameters, each with its range, unconstrained form and published values.

    Parameters
    ----------
    values : parameters that replace those of the set, by name
    parameter_set : a key of `parameter_sets`; the first of them where None
    dtype : floating type

    Attributes
    ----------
    parameter_table : its parameters
    parameter_sets : published values, the default first
    reference : the values that it was made with, by name
    free : the unconstrained numbers that a fit moves, zero at the reference

    Raises
    ------
    ModelError
        If a set or a parameter is unknown, or a value is out of range.
    """

    name: str
    parameter_table: ClassVar[tuple[Parameter, ...]]
    parameter_sets: ClassVar[Mapping[str, Mapping[str, float]]]

    def __init__(
        self, values: Mapping[str, float] | None, parameter_set: str | None, dtype: torch.dtype
    ) -> None:
        super().__init__()
        self.reference = {**self._published(parameter_set), **self._known(values or {})}
        self.free = torch.nn.ParameterDict()
        for parameter in self.parameter_table:
            parameter.check(self.reference[parameter.name], self.name)
            self.free[parameter.name] = torch.nn.Parameter(torch.zeros((), dtype=dtype))
        self._last_fixed: _Fixed | None = None

    @classmethod
    def _published(cls, parameter_set: str | None) -> Mapping[str, float]:
        if parameter_set is None:
            return next(iter(cls.parameter_sets.values()))
        if parameter_set not in cls.parameter_sets:
            raise ModelError(
                f"{cls.name} has no parameter set {parameter_set!r}; "
                f"{alternatives(parameter_set, cls.parameter_sets)}"
            )
        return cls.parameter_sets[parameter_set]

    @classmethod
    def _known(cls, values: Mapping[str, float]) -> Mapping[str, float]:
        names = [parameter.name for parameter in cls.parameter_table]
        for name in values:
            if name not in names:
                raise ModelError(
                    f"{cls.name} has no parameter {name!r}: {alternatives(name, names)}"
                )
        return values

    def constants(self) -> Constants:
        """The parameters' values and what is `derived` from them, by name, differentiable.

        Tensors () or (point,).
        """
        fixed = self._fixed()
        return fixed.in_torch if fixed else self._constrained(self._free_values())

    def _fixed(self) -> "_Fixed | None":
        """Constants that all points share and no gradient is wanted of; None if there are none."""
        free = self._free_values()
        wanted = torch.is_grad_enabled() and any(value.requires_grad for value in free)
        if wanted or any(value.ndim for value in free) or torch.compiler.is_compiling():
            return None
        # A run asks for the same numbers at every step.
        numbers = [value.item() for value in free]
        if self._last_fixed is None or self._last_fixed.free != numbers:
            with torch.inference_mode(False):  # a later call may want gradients of the stress
                constants = self._constrained([value.detach() for value in free])
            self._last_fixed = _Fixed(numbers, constants, constants.in_numpy())
        return self._last_fixed

    def _free_values(self) -> list[Tensor]:
        # `self.free.values()` takes ten times as long.
        return list(cast(dict[str, Tensor], self.free._parameters).values())

    def _constrained(self, free: Sequence[Tensor]) -> Constants:
        constants = Constants()
        for parameter, value in zip(self.parameter_table, free, strict=True):
            number = parameter.constrained(value, self.reference[parameter.name])
            setattr(constants, parameter.name, number)
        vars(constants).update(self.derived(constants))
        return constants

    def derived(self, c: Constants) -> Mapping[str, Tensor]:
        """Constants that follow from the parameters `c`, such as moduli; none by default."""
        return {}

    @torch.no_grad()
    def values(self) -> dict[str, float]:
        """The parameters as numbers, by name; a model with parameters per point has none.

        Raises
        ------
        ModelError
            If the parameters differ from point to point.
        """
        if any(value.ndim > 0 for value in self._free_values()):
            raise ModelError(f"the parameters of {self.name} differ from point to point")
        constants = vars(self.constants())
        return {
            parameter.name: float(constants[parameter.name]) for parameter in self.parameter_table
        }
