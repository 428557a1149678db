"""A coarse comparison of a tangent with differences of stresses, cheap enough to make always.

The physics axis measures how good a tangent is; this only decides whether Newton's method can use
it.
"""

import torch
from torch import Tensor

from granbench.cells.contract import MaterialCell
from granbench.cells.robust_runs import robust_call

WIDTHS = {torch.float64: (1e-5, 1e-6, 1e-7), torch.float32: (2e-4, 5e-5)}
"""Half widths of central differences, strain, by floating type."""
COARSEST = (1e-3,)
"""Half width for a type of fewer digits."""

KINK = 0.1
"""Forward and backward differences that differ by more have no derivative between them."""

MISMATCH = 0.2
"""Relative difference of a row of the tangent above which Newton's method cannot use it. A curved
response in single precision stays well below."""

SMALL = 0.02
"""Rows below this share of the largest are not compared by their own size."""


def tangent_mismatch(
    cell: MaterialCell, dstrain: Tensor, state: Tensor, tangent: Tensor
) -> tuple[int, float] | None:
    """Which row of a tangent is wrong at most points that have a derivative, and by how much.

    Parameters
    ----------
    dstrain, state : (point, ...), where the tangent (point, component, component), Pa, holds

    Returns
    -------
    The component and the median relative difference, or None where the tangent can be used
    """
    best = torch.full(dstrain.shape, torch.inf, dtype=torch.float64)
    for width in WIDTHS.get(cell.dtype, COARSEST):
        forward, backward = _differences(cell, dstrain, state, width)
        central = 0.5 * (forward + backward)
        size = torch.linalg.vector_norm(central, dim=2)
        least = SMALL * size.amax(dim=1, keepdim=True)
        scale = torch.maximum(torch.maximum(size, _row_norm(tangent.double())), least)
        smooth = _row_norm(forward - backward) <= KINK * torch.maximum(size, least)
        error = _row_norm(tangent.double() - central) / scale
        best = torch.where(smooth & (error < best), error, best)
    smooth = best.isfinite()
    if not smooth.any():
        return None
    medians = torch.stack(
        [row[known].median() if known.any() else torch.tensor(0.0).double()
         for row, known in zip(best.T, smooth.T, strict=True)]
    )  # fmt: skip
    component = int(medians.argmax())
    share = float(medians[component])
    return (component, share) if share > MISMATCH else None


def _row_norm(rows: Tensor) -> Tensor:
    return torch.linalg.vector_norm(rows, dim=2)


@torch.no_grad()
def _differences(
    cell: MaterialCell, dstrain: Tensor, state: Tensor, width: float
) -> tuple[Tensor, Tensor]:
    """Forward and backward differences, each (point, component, component), Pa."""
    points, components = dstrain.shape
    shifts = torch.zeros(2 * components + 1, 1, components, dtype=dstrain.dtype)
    for component in range(components):
        shifts[component, 0, component] = width
        shifts[components + component, 0, component] = -width
    tried = dstrain + shifts
    states = state.repeat(len(shifts), 1)
    stress, *_ = robust_call(cell.step, tried.flatten(0, 1), states)
    stress = stress.double().unflatten(0, (len(shifts), points))
    # What the floating type made of the width, not the width itself.
    moved = (tried - dstrain).double().sum(dim=2)[..., None]
    columns = (stress[:-1] - stress[-1]) / moved[:-1]
    forward, backward = columns[:components], columns[components:]
    return forward.permute(1, 2, 0), backward.permute(1, 2, 0)
