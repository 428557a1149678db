"""Symmetric tensors as rows of components, so that one model serves every component order.

A batch of tensors is a tensor of rows (component, point): each row is contiguous, which is what
makes the updates fast. Which rows are normal components and how often a row counts in a double
contraction is all that a model has to know of the order.
"""

from functools import cache
from typing import NamedTuple

import torch
from torch import Tensor

from granbench.errors import ConfigurationError
from granbench.models.arrays import (
    Array,
    addcmul,
    at_least,
    contracted,
    in_numpy,
    is_tensor,
    smallest_square,
    sqrt,
)
from granbench.tensors import COMPONENT_ORDERS, PLANE_STRAIN_ROWS, is_normal


class _Units(NamedTuple):
    """Vectors that give invariants as products, in one kind of arrays.

    Parameters
    ----------
    normal : (component, 1), 1 for a normal component, 0 for a shear component
    trace : (component,), the same
    contraction : (component,), how often a component occurs in the tensor: 1 or 2
    """

    normal: Array
    trace: Array
    contraction: Array


class TensorRows:
    """Invariants of symmetric tensors held as rows, of torch or of NumPy.

    Parameters
    ----------
    labels : of the rows, such as `xx`; two different letters or digits mark a shear component
    dimension : of space; 2 for the plane models of the thesis' section 6.6, whose trace and
        deviator are those of the plane, else 3
    dtype : floating type

    Attributes
    ----------
    count : number of rows
    square_factor : q^2 / s:s, 3/2 or, in the plane, 2; then dq/dsigma = square_factor s/q
    normal : (component, 1) tensor, 1 for a normal component, 0 for a shear component
    weight : (component, 1) tensor, how often a component occurs in the tensor: 1 or 2
    spherical : (component, component, 1), I x I of Hooke's law
    deviatoric : (component, component, 1), what takes a tensor to its deviator
    """

    @torch.inference_mode(False)  # they are kept: gradients may be wanted of a later call
    def __init__(self, labels: tuple[str, ...], dimension: int, dtype: torch.dtype) -> None:
        self.labels = labels
        self.dimension = dimension
        self.count = len(labels)
        self.square_factor = 2.0 if dimension == 2 else 1.5
        normal = [is_normal(label) for label in labels]
        self._normal_rows = [row for row, is_normal in enumerate(normal) if is_normal]
        self.normal = torch.tensor(normal, dtype=dtype).unsqueeze(-1)
        self.weight = 2.0 - self.normal
        self.spherical = outer(self.normal, self.normal)
        unit = torch.eye(self.count, dtype=dtype).unsqueeze(-1)
        self.deviatoric = unit - self.spherical / dimension
        trace, weight = self.normal.squeeze(-1), self.weight.squeeze(-1)
        units = _Units(self.normal, trace, weight)
        self._of_torch, self._of_numpy = units, _Units(*map(in_numpy, units))

    def _units(self, rows: Array) -> _Units:
        return self._of_torch if is_tensor(rows) else self._of_numpy

    def mean(self, rows: Array) -> Array:
        """tr/dimension of tensors (component, point), as (point,)."""
        return self.trace(rows) * (1.0 / self.dimension)

    def trace(self, rows: Array) -> Array:
        """Trace of tensors (component, point), as (point,)."""
        if is_tensor(rows):
            # One product with a vector of ones and zeros costs less than picking rows and adding.
            return self._of_torch.trace @ rows
        # In NumPy adding costs less; the order in which `@` sums depends on how many points there
        # are.
        first, *others = self._normal_rows
        total = rows[first]
        for row in others:
            total = total + rows[row]
        return total

    def deviator(self, rows: Array) -> Array:
        """Deviatoric part of tensors (component, point)."""
        return self.split(rows)[1]

    def split(self, rows: Array) -> tuple[Array, Array]:
        """Mean (point,) and deviator (component, point) of tensors (component, point)."""
        mean = self.mean(rows)
        return mean, addcmul(rows, self._units(rows).normal, mean, value=-1.0)

    def joined(self, mean: Array, deviator: Array, factor: Array) -> Array:
        """Tensors (component, point) of a mean and `factor` times a deviator."""
        return addcmul(self._units(deviator).normal * mean, deviator, factor)

    def shifted(self, rows: Array, mean: Array) -> Array:
        """Tensors (component, point) with so much added to their mean."""
        return addcmul(rows, self._units(rows).normal, mean)

    def contraction(self, a: Array, b: Array) -> Array:
        """a : b of tensors (component, point), as (point,)."""
        return contracted(self._units(a).contraction, a, b)

    def deviatoric_square(self, deviator: Array) -> Array:
        """q^2 of a deviator (component, point)."""
        return self.square_factor * self.contraction(deviator, deviator)

    def deviatoric_stress(self, deviator: Array) -> Array:
        """q of a deviator (component, point): sqrt(3/2 s:s), or sqrt(2 s:s) in the plane.

        At least 1e-77 (3e-10 in float32), so that s/q and every gradient stay finite where the
        deviator vanishes: they are zero there.
        """
        return safe_root(self.deviatoric_square(deviator))


def safe_root(square: Array) -> Array:
    """Square root with a gradient of zero, not NaN, at zero."""
    return sqrt(at_least(square, smallest_square(square)))


def outer(a: Tensor, b: Tensor) -> Tensor:
    """a x b of rows (component, point), as (component, component, point)."""
    return a.unsqueeze(1) * b.unsqueeze(0)


@cache
def tensor_rows(order: str, dimension: int, dtype: torch.dtype) -> TensorRows:
    """Rows of stress and strain of a model in a component order.

    Parameters
    ----------
    order : a key of `granbench.tensors.COMPONENT_ORDERS`
    dimension : 2 or 3 of the model. A 3-D model in the `plane` order is in plane strain: its
        rows are xx, yy, xy and then the out-of-plane zz.
    dtype : floating type

    Raises
    ------
    ConfigurationError
        If the order is unknown.
    """
    if order not in COMPONENT_ORDERS:
        raise ConfigurationError(
            f"unknown component order {order!r}; use {', '.join(COMPONENT_ORDERS)}"
        )
    in_plane = order == "plane"
    labels = PLANE_STRAIN_ROWS if in_plane and dimension == 3 else COMPONENT_ORDERS[order]
    return TensorRows(labels, 2 if in_plane and dimension == 2 else 3, dtype)
