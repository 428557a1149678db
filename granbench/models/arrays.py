"""Functions for the formulas of models, the same for torch and NumPy.

A formula takes tensors where gradients are wanted or points are many. Where no gradient is wanted
and points are few it takes NumPy's arrays, whose calls cost a third of torch's: of some hundred
points the number of calls decides the time, not that of points. So the text of a model keeps to
operators, comparisons, indices, `abs`, `any` and `all`, which both have alike, and to the
functions here, which have the names and meanings of torch's where those exist.

Which of the two a call takes is up to `granbench.models.classical.ClassicalCell.step`.
"""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
import torch
from torch import Tensor

Array: TypeAlias = Tensor
"""A tensor or a NumPy array. To mypy it is a tensor: it cannot express "all of one kind", and
what it checks for tensors holds for both."""

Number: TypeAlias = Array | float


def is_tensor(x: Array) -> bool:
    """Whether x is torch's; else it is NumPy's, be it an array or what is left of one: a number."""
    return isinstance(x, Tensor)


def in_numpy(x: Tensor) -> Array:
    """The entries of a tensor, not copied, as NumPy's array; no gradient follows it."""
    entries: Any = (x.detach() if x.requires_grad else x).numpy()
    return entries


def in_torch(x: Array) -> Tensor:
    """The entries of an array, not copied, as a tensor."""
    return x if isinstance(x, Tensor) else torch.from_numpy(x)


def exp(x: Array) -> Array:
    """e to the x."""
    return torch.exp(x) if isinstance(x, Tensor) else np.exp(x)


def expm1(x: Array) -> Array:
    """e to the x, less one."""
    return torch.expm1(x) if isinstance(x, Tensor) else np.expm1(x)


def log(x: Array) -> Array:
    """Natural logarithm."""
    return torch.log(x) if isinstance(x, Tensor) else np.log(x)


def log1p(x: Array) -> Array:
    """Natural logarithm of 1 + x."""
    return torch.log1p(x) if isinstance(x, Tensor) else np.log1p(x)


def sqrt(x: Array) -> Array:
    """Square root."""
    return torch.sqrt(x) if isinstance(x, Tensor) else np.sqrt(x)


def power(x: Array, exponent: Number) -> Array:
    """x to a power."""
    return torch.pow(x, exponent) if isinstance(x, Tensor) else np.power(x, exponent)


def addcmul(x: Array, a: Array, b: Array, *, value: float = 1.0) -> Array:
    """x + value a b; one pass over tensors."""
    if isinstance(x, Tensor):
        return torch.addcmul(x, a, b, value=value)
    product: Any = a * b
    return x + product if value == 1.0 else x - product if value == -1.0 else x + value * product


def contracted(weights: Array, a: Array, b: Array) -> Array:
    """Sums (point,) over the rows of a b, each times its weight (row,)."""
    if isinstance(a, Tensor):
        return weights @ (a * b)
    # The order in which NumPy's `@` sums depends on how many points there are.
    return np.einsum("i,ij,ij->j", weights, a, b)


def at_least(x: Array, lowest: float) -> Array:
    """x, or `lowest` where x is below it; NaN stays NaN."""
    return x.clamp(min=lowest) if isinstance(x, Tensor) else np.maximum(x, lowest)


def between(x: Array, lowest: float, highest: float) -> Array:
    """x, clipped to two bounds; NaN stays NaN."""
    if isinstance(x, Tensor):
        return x.clamp(lowest, highest)
    return np.minimum(np.maximum(x, lowest), highest)


def minimum(a: Array, b: Array) -> Array:
    """Minimum of two, entry by entry; NaN where either is NaN."""
    return torch.minimum(a, b) if isinstance(a, Tensor) else np.minimum(a, b)


def maximum(a: Array, b: Array) -> Array:
    """Maximum of two, entry by entry; NaN where either is NaN."""
    return torch.maximum(a, b) if isinstance(a, Tensor) else np.maximum(a, b)


def where(condition: Array, a: Number, b: Number) -> Array:
    """`a` where the condition holds, `b` elsewhere."""
    chosen: Any = torch.where if isinstance(condition, Tensor) else np.where
    return chosen(condition, a, b)


def isfinite(x: Array) -> Array:
    """Mask of the entries that are finite."""
    return torch.isfinite(x) if isinstance(x, Tensor) else np.isfinite(x)


def isnan(x: Array) -> Array:
    """Mask of the entries that are NaN."""
    return torch.isnan(x) if isinstance(x, Tensor) else np.isnan(x)


def full_like(x: Array, number: float) -> Array:
    """An array like x with all entries equal to one number."""
    return torch.full_like(x, number) if isinstance(x, Tensor) else np.full_like(x, number)


def zeros_like(x: Array) -> Array:
    """An array like x of zeros."""
    return torch.zeros_like(x) if isinstance(x, Tensor) else np.zeros(x.shape, x.dtype)


def ones_like(x: Array) -> Array:
    """An array like x of ones."""
    return torch.ones_like(x) if isinstance(x, Tensor) else np.ones(x.shape, x.dtype)


def stack(rows: Sequence[Array]) -> Array:
    """Rows (point,) as (row, point)."""
    # np.stack takes seven times as long for the same.
    return torch.stack(list(rows)) if isinstance(rows[0], Tensor) else np.array(rows)


def cat(parts: Sequence[Array]) -> Array:
    """Parts (row, point) one below the other."""
    return torch.cat(list(parts)) if isinstance(parts[0], Tensor) else np.concatenate(parts)


def places(mask: Array) -> Array:
    """Numbers of the points (point,) where a mask holds."""
    return mask.nonzero().squeeze(-1) if isinstance(mask, Tensor) else np.flatnonzero(mask)


def replaced(x: Array, points: Array, by: Array) -> Array:
    """x (..., point), left as it is, with other entries for some points."""
    if isinstance(x, Tensor):
        return x.index_copy(-1, points, by)
    after: Any = x.copy()
    after[..., points] = by
    return after


def detached(x: Array) -> Array:
    """x as a constant to gradients."""
    return x.detach() if isinstance(x, Tensor) else x


def gradients_wanted(*of: Array) -> bool:
    """Whether what is made of these is to be differentiated."""
    return torch.is_grad_enabled() and any(isinstance(x, Tensor) and x.requires_grad for x in of)


def rounding_unit(x: Array) -> float:
    """Distance from 1 to the next number of the type of x."""
    return torch.finfo(x.dtype).eps if isinstance(x, Tensor) else float(np.finfo(x.dtype).eps)


_SMALLEST_SQUARES = {
    kind.itemsize: torch.finfo(kind).tiny ** 0.5 for kind in (torch.float32, torch.float64)
}


def smallest_square(x: Array) -> float:
    """Square, of the type of x, of which neither the root nor its inverse is lost to rounding."""
    return _SMALLEST_SQUARES[x.dtype.itemsize]
