"""Material parameters: what each is, the range it must lie in, and its unconstrained form."""

import math
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from granbench.errors import ModelError
from granbench.models.arrays import Array, in_numpy


@dataclass(frozen=True)
class Parameter:
    """One material constant of a classical model.

    Parameters
    ----------
    name : in files, options and code, such as `friction_slope`
    symbol : in equations, figures and tables, such as `M`
    units : SI, "1" where dimensionless
    meaning : in words
    lower, upper : open bounds of the values that the model is defined for

    Notes
    -----
    Fitting moves an unconstrained number u, zero at the value v0 that the model was made with::

        a bound below only    v = lower + (v0 - lower) exp(u)
        two bounds            v = lower + (upper - lower) sigmoid(u + u0), v0 at u = 0
        no bound              v = v0 + |v0| u   (v0 + u where v0 = 0)

    so that v is v0 where nothing was fitted (to the last bit, but for the rounding of a bound
    below that is not zero), and all u are of one size.
    """

    name: str
    symbol: str
    units: str
    meaning: str
    lower: float = 0.0
    upper: float = math.inf

    def check(self, value: float, model: str) -> None:
        """Refuse a value that the model is not defined for.

        Raises
        ------
        ModelError
            Naming the model, the parameter and its range.
        """
        if not (math.isfinite(value) and self.lower < value < self.upper):
            bounds = (
                "a finite number"
                if math.isinf(self.lower) and math.isinf(self.upper)
                else f"above {self.lower:g}"
                if math.isinf(self.upper)
                else f"between {self.lower:g} and {self.upper:g}, both excluded"
            )
            raise ModelError(
                f"{model}: parameter {self.name!r} ({self.symbol}, {self.units}) is {value:g} "
                f"but must be {bounds}; correct the value"
            )

    def constrained(self, free: Tensor, reference: float) -> Tensor:
        """Value of the parameter for an unconstrained number.

        Parameters
        ----------
        free : () or (point,), unconstrained
        reference : the value at `free` = 0
        """
        if self.lower == -math.inf:
            return reference + (abs(reference) or 1.0) * free
        if self.upper == math.inf:
            grown = (reference - self.lower) * torch.exp(free)
            return self.lower + grown if self.lower else grown
        share = (reference - self.lower) / (self.upper - self.lower)
        start = math.log(share / (1.0 - share))
        began: Tensor | float = (
            torch.sigmoid(torch.full_like(free, start))
            if torch.compiler.is_compiling()
            else _sigmoid(start, free.dtype)
        )
        moved = torch.sigmoid(start + free) - began
        return reference + (self.upper - self.lower) * moved


@cache
def _sigmoid(number: float, dtype: torch.dtype) -> float:
    """torch's sigmoid, whose last bit need not be that of `math`; kept, for every step asks."""
    return float(torch.sigmoid(torch.tensor(number, dtype=dtype)))


class Constants:
    """A model's parameters and what follows from them, by name: () or (point,) each."""

    # A SimpleNamespace would be the same, but torch.compile cannot follow it.
    def __init__(self, **values: Array) -> None:
        vars(self).update(values)

    def in_numpy(self) -> "Constants":
        """The same as NumPy's arrays."""
        return Constants(**{name: in_numpy(value) for name, value in vars(self).items()})

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Array: ...

        def __setattr__(self, name: str, value: Array) -> None: ...
