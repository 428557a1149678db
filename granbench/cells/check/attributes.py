"""The attributes that a cell must have, and the shape and type of what its methods return."""

from typing import Any

import torch
from torch import Tensor

from granbench.cells.contract import MaterialCell, StateLayout
from granbench.errors import ModelError
from granbench.tensors import COMPONENT_ORDERS


def require_attributes(cell: MaterialCell) -> None:
    """Refuse a cell whose attributes are missing or contradict each other.

    Raises
    ------
    ModelError
        With the attribute to change.
    """
    if not isinstance(cell, MaterialCell):
        raise ModelError(
            f"{kind(cell)} is not a MaterialCell; wrap a torch module in granbench.cells.ModuleCell"
        )
    name = getattr(cell, "name", None)
    if not isinstance(name, str) or not name:
        raise ModelError(f"a {type(cell).__name__} has no `name`; give it one, as text")
    if cell.order not in COMPONENT_ORDERS:
        raise ModelError(
            f"{name}: `order` is {cell.order!r}; it must be one of {', '.join(COMPONENT_ORDERS)}"
        )
    if not isinstance(cell.dtype, torch.dtype) or not cell.dtype.is_floating_point:
        raise ModelError(f"{name}: `dtype` is {cell.dtype!r}; give torch.float64 or float32")
    layout = getattr(cell, "layout", None)
    if not isinstance(layout, StateLayout) or "stress" not in layout:
        raise ModelError(
            f"{name}: `layout` has no slice 'stress'; give StateLayout.of(stress="
            f"{cell.component_count}, ...)"
        )
    widths = {part: where.stop - where.start for part, where in layout.slices.items()}
    if widths["stress"] != cell.component_count:
        raise ModelError(
            f"{name}: the slice 'stress' of its layout is {widths['stress']} wide, but there are "
            f"{cell.component_count} {cell.order} components; correct the layout or the order"
        )
    for internal in cell.internals:
        if widths.get(internal) != 1:
            raise ModelError(
                f"{name}: {internal!r} of its `internals` is not a slice of width 1 in its layout; "
                "add it to the layout, or remove it from `internals`"
            )


def require_tensor(
    cell: MaterialCell, method: str, what: str, part: Any, shape: tuple[int, int]
) -> None:
    """Refuse a result of a method that is not a tensor of the right shape and type.

    Parameters
    ----------
    method : `initial_state` or `step`
    what : `a stress` or `a state`
    part : what was returned
    shape : that it must have

    Raises
    ------
    ModelError
        Naming the method and what it must return.
    """
    name = f"`{method}` of {cell.name}"
    if not isinstance(part, Tensor):
        raise ModelError(f"{name} returns {kind(part)} as {what}; it must be a torch tensor")
    if tuple(part.shape) != shape:
        raise ModelError(
            f"{name} returns {what} of shape {tuple(part.shape)} for {shape[0]} points; it must be "
            f"{shape}, one row a point"
        )
    if not part.is_floating_point() or not part.is_cpu or part.layout != torch.strided:
        raise ModelError(
            f"{name} returns {what} of type {part.dtype} on {part.device}; it must be of "
            f"{cell.dtype}, the model's own, dense and on the CPU"
        )
    if part.requires_grad:
        raise ModelError(
            f"{name} returns {what} with gradients although torch has them switched off, so that "
            "the memory of a run grows with every step; return it with `.detach()`"
        )


def kind(found: object) -> str:
    """What something is, for an error."""
    return "None" if found is None else f"an object of type {type(found).__name__}"
