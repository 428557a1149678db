"""The points and strain increments that a cell is tried with where a caller gives none."""

import torch
from torch import Tensor

from granbench.cells.contract import Conditions, MaterialCell
from granbench.tensors import COMPONENT_ORDERS, normal_mask

POINTS, STEPS = 4, 4
"""Four points find a model that mixes the rows of a batch or depends on its size; four steps find a
memory that is written at every call, also one that only shows from the second step of a path."""

STRAIN = 2e-4
"""Size of the increments. They are small, so that every model can follow them, and find only what
is wrong from the first strain on. What is wrong at yield or at large stress is found after the use,
when some of its own steps are repeated."""

KNOWN = {"initial_void_ratio": 0.7, "grading_index": 1.1}
"""Scalars of the points where no start is given, beside their mean stress."""


def probe_increments(order: str, points: int) -> Tensor:
    """Small strain increments (point, step, component), each point with its own, compressive."""
    components = len(COMPONENT_ORDERS[order])
    numbers = torch.arange(points * STEPS * components, dtype=torch.float64)
    spread = torch.cos(2.4 * numbers).reshape(points, STEPS, components)
    return 0.5 * STRAIN * (spread + torch.tensor(normal_mask(order), dtype=torch.float64))


def spread_rows(count: int) -> list[int]:
    """`POINTS` places among `count` rows, evenly spread; repeated where there are fewer rows."""
    return [round(place * (count - 1) / (POINTS - 1)) for place in range(POINTS)]


def default_start(cell: MaterialCell) -> Conditions:
    """Isotropic stresses of 100 to 400 kPa at `POINTS` points, and what is `KNOWN` of them."""
    pressure = 1e5 * torch.arange(1.0, POINTS + 1.0, dtype=torch.float64)
    normal = torch.tensor(normal_mask(cell.order), dtype=torch.float64)
    scalars = {name: torch.full_like(pressure, value) for name, value in KNOWN.items()}
    known = {"initial_mean_stress": pressure, **scalars}
    return Conditions((pressure[:, None] * normal).to(cell.dtype), known)
