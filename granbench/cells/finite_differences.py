"""Tangents from finite differences of a cell's own stresses."""

from collections.abc import Callable

import torch
from torch import Tensor

SHARE = 1e-3
LEAST = {torch.float64: 1e-8, torch.float32: 1e-5}
"""Strain of a difference: a share of the increment, and at least so much, so that the change of
stress is larger than the rounding of the cell's floating type."""
COARSEST = 1e-3
"""The least strain for a type of fewer digits."""

Step = Callable[[Tensor, Tensor], tuple[Tensor, Tensor]]
"""A cell's `step`."""


@torch.no_grad()
def step_and_tangent(step: Step, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Stress, state and one-sided differences, from one step of all points and shifted copies.

    Parameters
    ----------
    step : of a cell
    dstrain, state : (point, ...), as in `MaterialCell.step`

    Returns
    -------
    stress, state : as of `MaterialCell.step`
    tangent : (point, component, component), Pa, as of `MaterialCell.tangent`
    """
    points, components = dstrain.shape
    least = LEAST.get(dstrain.dtype, COARSEST)
    size = (SHARE * dstrain.abs().amax(dim=1)).clamp(min=least)
    shifts = dstrain.new_zeros(components + 1, points, components)
    for component in range(components):
        shifts[component + 1, :, component] = size
    stress, after = step((dstrain + shifts).flatten(0, 1), state.repeat(components + 1, 1))
    own, *moved = stress.unflatten(0, (components + 1, points)).unbind()
    columns = [(other - own) / size[:, None] for other in moved]
    return own, after[:points], torch.stack(columns, dim=2)
