"""What is known of points before a cell is stepped: their start, or a true record."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import torch
from torch import Tensor

from granbench.errors import ModelError


class MissingScalarError(ModelError):
    """A model needs a quantity at the start of a path that the conditions do not give.

    Attributes
    ----------
    name : dataset name of the quantity, such as `initial_void_ratio`
    """

    def __init__(self, name: str, given: Iterable[str]) -> None:
        self.name = name
        super().__init__(
            f"the model needs {name!r} at the start of a path, but the conditions give only "
            f"{', '.join(sorted(given)) or 'the stress'}; add it to their scalars, or use a "
            "dataset that has it"
        )


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
        MissingScalarError
            If the path does not carry it.
        """
        if name not in self.scalars:
            raise MissingScalarError(name, self.scalars)
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
