"""The tangent of a cell against differences of its own steps."""

import copy
from dataclasses import dataclass

import torch
from torch import Tensor

from granbench.cells.contract import FLOATING_FAILURES, MaterialCell
from granbench.cells.robust_runs import Series, robust_series, robust_step
from granbench.cells.user_code import failure_location
from granbench.errors import GranbenchError

WIDTHS = (1e-4, 1e-5, 1e-6, 1e-7)
"""Half widths of the differences, strain. The widest sees curvature, the narrowest rounding; a
tangent that is right agrees with one of them."""

KINK = 0.1
"""Forward and backward differences that differ by more, relative to their norm, say that there
is no derivative to compare with."""


@dataclass(frozen=True)
class TangentErrors:
    """How far tangents are from differences.

    Parameters
    ----------
    error : (point,), relative; NaN where the cell broke down
    kink : (point,), whether the response has no derivative there, so that `error` says nothing
    """

    error: Tensor
    kink: Tensor


def tangent_obstacle(cell: MaterialCell, dstrain: Tensor, state: Tensor) -> str | None:
    """Why a cell that can be stepped has no tangent of its own, or None.

    Parameters
    ----------
    dstrain, state : of points at which the cell can be evaluated
    """
    increment, before = dstrain[:1].to(cell.dtype), state[:1].to(cell.dtype)
    try:
        *_, tangent = cell.tangent(increment, before)
        if (
            not cell.has_own_tangent
            and tangent.any()
            and cell.differentiated(increment, before) is None
        ):
            return (
                "the model gives torch no gradients; analyses take its tangent by differences, "
                "with which it would be compared here"
            )
    except (GranbenchError, *FLOATING_FAILURES):
        return None
    except Exception as error:
        return f"the tangent of the model fails: {failure_location(error)}"
    return None


def in_double_precision(cell: MaterialCell, dstrain: Tensor, state: Tensor) -> MaterialCell:
    """A copy of a cell whose torch modules compute in double precision.

    Differences of a network in single precision can be off by a tenth where its tangent is small.
    A cell whose numbers are not in torch modules cannot be copied so, and is returned itself.

    Parameters
    ----------
    dstrain, state : of points at which the cell can be evaluated
    """
    if cell.dtype == torch.float64:
        return cell
    try:
        double = copy.deepcopy(cell)
        double.dtype = torch.float64
        for part in vars(double).values():
            if isinstance(part, torch.nn.Module):
                part.double()
        if isinstance(double, torch.nn.Module):
            double.double()
        stress, _ = double.step(dstrain[:1].double(), state[:1].double())
    except Exception:  # user code: the cell can still be evaluated in its own precision
        return cell
    return double if stress.dtype == torch.float64 else cell


def tangent_errors(
    cell: MaterialCell, dstrain: Tensor, state: Tensor, stiffness: float
) -> TangentErrors:
    """Relative difference of `MaterialCell.tangent` and central differences of `step`.

    Both are of the cell in double precision, where that can be had. At each of `WIDTHS` where
    forward and backward differences agree, the norm of the difference is divided by the larger of
    the two norms; the smallest of the quotients counts.

    Parameters
    ----------
    dstrain : (point, component)
    state : (point, n_state)
    stiffness : Pa; norms below a thousandth of it are rounding, and count as that
    """
    cell = in_double_precision(cell, dstrain, state)
    increment = dstrain.to(cell.dtype)
    start = state.to(cell.dtype)
    tangent = _tangents(cell, increment, start)
    stress = robust_step(cell, increment, start)["stress"]
    floor = torch.full_like(stress[:, 0], 1e-3 * stiffness)
    best = torch.full_like(floor, torch.inf)
    followed = torch.zeros_like(floor, dtype=torch.bool)
    for width in WIDTHS:
        forward, backward, central = _differences(cell, increment, start, stress, width)
        scale = torch.stack([_norm(tangent), _norm(central), floor]).amax(dim=0)
        smooth = _norm(forward - backward) <= KINK * torch.maximum(_norm(central), floor)
        error = _norm(tangent - central) / scale
        best = torch.where(smooth & ~(error >= best), error, best)
        followed |= torch.isfinite(central).flatten(1).all(dim=1)
    broken = ~followed | ~torch.isfinite(tangent).flatten(1).all(dim=1)
    kink = torch.isinf(best) & ~broken
    return TangentErrors(torch.where(broken, torch.nan, best), kink)


def _tangents(cell: MaterialCell, dstrain: Tensor, state: Tensor) -> Tensor:
    components = dstrain.shape[1]

    def run(points: slice, _: int) -> Series:
        return {"tangent": cell.tangent(dstrain[points], state[points])[2]}

    widths = {"tangent": (components, components)}
    return robust_series(run, len(dstrain), None, widths)["tangent"]


def _differences(
    cell: MaterialCell, dstrain: Tensor, state: Tensor, stress: Tensor, width: float
) -> tuple[Tensor, Tensor, Tensor]:
    """Forward, backward and central differences, each (point, component, component), Pa."""
    columns = []
    for component in range(dstrain.shape[1]):
        further, nearer = dstrain.clone(), dstrain.clone()
        further[:, component] += width
        nearer[:, component] -= width
        after = robust_step(cell, further, state)["stress"]
        before = robust_step(cell, nearer, state)["stress"]
        # What the floating type made of the width, not the width itself.
        up = (further - dstrain)[:, component, None].double()
        down = (dstrain - nearer)[:, component, None].double()
        columns.append(
            torch.stack(
                [(after - stress) / up, (stress - before) / down, (after - before) / (up + down)]
            )
        )
    forward, backward, central = torch.stack(columns, dim=-1)
    return forward, backward, central


def _norm(tangent: Tensor) -> Tensor:
    return torch.linalg.vector_norm(tangent, dim=(1, 2))
