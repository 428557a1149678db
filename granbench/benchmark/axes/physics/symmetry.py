"""Whole paths in turned or exchanged axes: an isotropic material gives the turned stress."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from granbench.cells.contract import Conditions, MaterialCell
from granbench.cells.robust_runs import robust_rollout
from granbench.tensors import COMPONENT_ORDERS, component_rotation

ANGLE = math.radians(30.0)


def turn(order: str) -> np.ndarray | None:
    """The rotation by 30 degrees that is tried; None where the axes cannot be turned.

    In the plane about its normal, else about an axis that is not an axis of symmetry.
    """
    if order == "principal":
        return None
    cosine, sine = math.cos(ANGLE), math.sin(ANGLE)
    if order == "plane":
        return np.array([[cosine, -sine], [sine, cosine]])
    axis = np.array([1.0, 2.0, 3.0]) / math.sqrt(14.0)
    cross = np.cross(axis, np.eye(3)).T
    return cosine * np.eye(3) + sine * cross + (1.0 - cosine) * np.outer(axis, axis)


def exchanges(order: str) -> tuple[np.ndarray, ...]:
    """Exchanges of two axes that all others are made of: one in the plane, else two."""
    if order == "plane":
        return (np.array([[0.0, 1.0], [1.0, 0.0]]),)
    return np.eye(3)[[1, 0, 2]], np.eye(3)[[0, 2, 1]]


def asymmetry(
    cell: MaterialCell,
    strain: Tensor,
    conditions: Conditions,
    stress: Tensor,
    rotations: Sequence[np.ndarray],
) -> Tensor:
    """Largest difference along a path between the stress and that of the turned path, turned back.

    Strain, stress and every tensor among the conditions are turned; they begin a path, so that
    nothing else is known of it.

    Parameters
    ----------
    strain : (path, step, component), cumulative
    conditions : at step 0
    stress : (path, step, component), of the cell along `strain`, Pa
    rotations : orthogonal matrices; the worst of them counts

    Returns
    -------
    (path, component), Pa; NaN where the run broke down
    """
    worst = []
    for rotation in rotations:
        forth = torch.from_numpy(component_rotation(rotation, cell.order))
        back = torch.from_numpy(component_rotation(rotation.T, cell.order))
        turned = robust_rollout(cell, strain @ forth.T, _turned(conditions, forth, cell.order))
        worst.append((turned["stress"] @ back.T - stress).abs().amax(dim=1))
    return torch.stack(worst).amax(dim=0)


def _turned(conditions: Conditions, matrix: Tensor, order: str) -> Conditions:
    """Conditions in other axes: the stress, and scalars that are the components of a tensor."""
    labels = COMPONENT_ORDERS[order]
    scalars = dict(conditions.scalars)
    for name in conditions.scalars:
        stem = name.removesuffix(f"_{labels[0]}")
        parts = [f"{stem}_{label}" for label in labels]
        if stem != name and all(part in scalars for part in parts):
            tensor = torch.stack([conditions.scalars[part] for part in parts], dim=-1)
            turned = tensor @ matrix.T.to(tensor.dtype)
            scalars |= dict(zip(parts, turned.unbind(dim=-1), strict=True))
    stress = conditions.stress @ matrix.T.to(conditions.stress.dtype)
    # The accumulated strain of a path's start is zero in any axes.
    return replace(conditions, stress=stress, scalars=scalars)
