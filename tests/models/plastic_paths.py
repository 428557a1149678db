"""Strain paths and small controls that drive the plastic models in their tests."""

import math

import numpy as np
import torch
from torch import Tensor

from granbench.cells.contract import Conditions
from granbench.models import ClassicalCell

PRESSURE = 1e5


def unit(cell: ClassicalCell) -> Tensor:
    """Components of the unit tensor in the cell's order."""
    return cell.rows.normal[: cell.component_count, 0]


@torch.no_grad()
def isotropic(cell: ClassicalCell, points: int, pressure: float = PRESSURE) -> Tensor:
    """State at an isotropic stress."""
    stress = (pressure * unit(cell)).expand(points, -1)
    return cell.initial_state(Conditions(stress.to(cell.dtype)))


def random_increments(
    cell: ClassicalCell, points: int, steps: int, size: float, seed: int = 0
) -> Tensor:
    """Smooth random paths, (step, point, component), with increments of about `size`."""
    generator = torch.Generator().manual_seed(seed)
    count = cell.component_count
    waves = torch.randn(6, points, count, generator=generator, dtype=torch.float64)
    time = torch.linspace(0.0, 4.0, steps, dtype=torch.float64)[:, None, None]
    return size * sum(wave * torch.cos((k + 1) * time) for k, wave in enumerate(waves)) / 2.0


@torch.no_grad()
def run(cell: ClassicalCell, increments: Tensor, state: Tensor) -> Tensor:
    """States (step, point, n_state) after each increment (step, point, component)."""
    states = []
    for increment in increments:
        _, state = cell.step(increment.to(cell.dtype), state)
        states.append(state)
    return torch.stack(states)


def stress_of(cell: ClassicalCell, states: Tensor) -> Tensor:
    return states[..., cell.layout["stress"]]


def all_rows(cell: ClassicalCell, state: Tensor) -> Tensor:
    """Stress rows (component, point), with zz last in plane strain."""
    return state.T[: cell.rows.count]


def plastic_rows(cell: ClassicalCell, state: Tensor) -> Tensor:
    """Plastic strain rows (component, point)."""
    return state.T[cell.rows.count : 2 * cell.rows.count]


def invariants(cell: ClassicalCell, state: Tensor) -> tuple[Tensor, Tensor]:
    """p and q of a state, (point,)."""
    p, s = cell.rows.split(all_rows(cell, state))
    return p, cell.rows.deviatoric_stress(s)


def rotation(seed: int, plane: bool) -> np.ndarray:
    """A random rotation matrix, about z if in the plane."""
    generator = np.random.default_rng(seed)
    if plane:
        angle = generator.uniform(0.0, 2.0 * math.pi)
        turn = np.eye(3)
        turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        return turn
    q, r = np.linalg.qr(generator.normal(size=(3, 3)))
    return q * np.sign(np.diag(r))


PLACES = {
    "plane": ((0, 0), (1, 1), (0, 1)),
    "full": ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)),
}


def rotated(tensors: Tensor, order: str, turn: np.ndarray) -> Tensor:
    """Tensors (..., component) in axes turned by `turn`."""
    matrix = tensors.new_zeros(*tensors.shape[:-1], 3, 3)
    for k, (i, j) in enumerate(PLACES[order]):
        matrix[..., i, j] = matrix[..., j, i] = tensors[..., k]
    turn_tensor = torch.from_numpy(turn)
    matrix = turn_tensor @ matrix @ turn_tensor.T
    return torch.stack([matrix[..., i, j] for i, j in PLACES[order]], dim=-1)


@torch.no_grad()
def compressed(
    cell: ClassicalCell,
    state: Tensor,
    driven: tuple[float, ...],
    free: tuple[int, ...],
    steps: int,
    scale: float = PRESSURE,
    within: float = 1e-11,
) -> Tensor:
    """States of a test in which some stress stays as it is: (step, point, n_state).

    Every step adds the strain `driven`; the components `free`, which move together, are found by
    Newton's method so that the stress of the first of them stays what it is, `within` so much of
    the scale. A substepped model jumps where the number of its pieces changes: by its tolerance.
    """
    held = state[:, free[0]]
    direction = torch.zeros(cell.component_count, dtype=torch.float64)
    direction[list(free)] = 1.0
    states = []
    lateral = torch.zeros_like(held)
    for _ in range(steps):
        for _ in range(40):
            increment = torch.tensor(driven, dtype=torch.float64) + lateral[:, None] * direction
            stress, after, tangent = cell.tangent(increment, state)
            error = stress[:, free[0]] - held
            if (error.abs() < within * scale).all():
                break
            lateral = lateral - error / (tangent[:, free[0]] @ direction)
        else:
            raise ArithmeticError(f"lateral stress off by {error.abs().max():g} Pa")
        state = after
        states.append(state)
    return torch.stack(states)
