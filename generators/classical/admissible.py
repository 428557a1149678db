"""Strain paths that a pressure-dependent model can follow.

A Gaussian-process path dilates by some ten percent as often as it contracts. Beyond its tension
apex a frictional model has no strength, and its stress stays at the apex for any strain: such a
record has no information on the material, whose grains would have lost contact. A model whose
stiffness increases with the pressure is compressed to thousands of its initial pressure just as
easily; a few such paths would outweigh all others, and the grains would be crushed. Both are due to
the volume change. The volumetric part of the path is therefore reduced, while the deviatoric part -
amplitude, turns, rotation of axes - is that of every other dataset.
"""

import numpy as np
import torch
from numpy.typing import NDArray

from granbench.errors import ModelError
from granbench.generators.classical.response import isotropic_start
from granbench.models.classical import ClassicalCell
from granbench.paths.drawn import on_strain_grid
from granbench.paths.programme import Floats
from granbench.tensors import normal_mask, volumetric_strain

LOWEST_PRESSURE, HIGHEST_PRESSURE = 0.1, 50.0
"""Smallest and largest mean stress on an admissible path over the initial one: 10 kPa to 5 MPa for
100 kPa, about the range of the particle tests."""

FACTORS = (*(2.0 ** (-k / 4) for k in range(25)), 0.0)
"""Factors on the volumetric strain in the order in which they are tried, until one is admissible.
A bisection would not do: for a model that dilates, a smaller factor need not be safer."""

POINTS_TOGETHER = 8192
"""Number of points that are run together, with several factors of a path among them: one step of so
many points takes three times as long as one of a hundred."""

EXPLANATION = (
    "The volumetric part of each drawn strain path is multiplied by `volumetric_factor`, the "
    "largest of 2^(-k/4), k = 0 ... 24, and 0 with which the mean stress stays between "
    f"{LOWEST_PRESSURE:g} and {HIGHEST_PRESSURE:g} of the initial one: beyond its tension apex "
    "the model has no strength and its stress says nothing, and without a limit a few paths of "
    "extreme compression would outweigh the others. The deviatoric part is as it was drawn, the "
    "same for all models. It is the mean stress that is kept compressive: a model without a "
    "tension cut-off may still pull in one direction."
)


def scaled_volume(strain: Floats, factor: Floats, order: str = "plane") -> Floats:
    """Multiply the volumetric part of strains by a factor, and round them to the strain grid.

    Parameters
    ----------
    strain : (path, step, component)
    factor : (path,)
    order : component order
    """
    normal = np.array(normal_mask(order))
    dimension = normal.sum()
    change = (factor[:, None] - 1.0) * volumetric_strain(strain, order) / dimension
    return on_strain_grid(strain + change[..., None] * normal)


def admissible_factors(cell: ClassicalCell, strain: Floats, mean_stress: float) -> Floats:
    """The largest factor on the volumetric strain of each path that keeps the pressure in range.

    Parameters
    ----------
    cell : the model
    strain : (path, step, component), as drawn
    mean_stress : isotropic, at step 0, Pa

    Returns
    -------
    (path,), each one of `FACTORS`

    Raises
    ------
    ModelError
        If a path is not admissible even at constant volume.
    """
    chosen = np.full(len(strain), np.nan)
    left = list(FACTORS)
    while left and (open_paths := np.flatnonzero(np.isnan(chosen))).size:
        count = max(1, POINTS_TOGETHER // open_paths.size)
        tried, left = np.array(left[:count]), left[count:]
        paths, factors = np.repeat(open_paths, tried.size), np.tile(tried, open_paths.size)
        scaled = scaled_volume(strain[paths], factors, cell.order)
        held = admissible(cell, scaled, mean_stress).reshape(open_paths.size, tried.size)
        found = held.any(axis=1)
        chosen[open_paths[found]] = tried[held[found].argmax(axis=1)]
    if np.isnan(chosen).any():
        path = int(np.argmax(np.isnan(chosen)))
        raise ModelError(
            f"{cell.name}: the mean stress leaves its range on path {path} of {len(strain)} even "
            "at constant volume; start from another mean stress or draw smaller strains"
        )
    return chosen


def admissible(cell: ClassicalCell, strain: Floats, mean_stress: float) -> NDArray[np.bool_]:
    """Whether the mean stress stays in range along each path.

    Parameters
    ----------
    cell, mean_stress : as for `admissible_factors`
    strain : (path, step, component)

    Returns
    -------
    (path,)
    """
    lowest, highest = LOWEST_PRESSURE * mean_stress, HIGHEST_PRESSURE * mean_stress
    increments = torch.from_numpy(np.diff(strain, axis=1))
    state = cell.initial_state(isotropic_start(cell, mean_stress, len(strain)))
    alive = torch.arange(len(strain))
    with torch.no_grad():
        for increment in increments.unbind(dim=1):
            _, state = cell.step(increment[alive], state)
            pressure = cell.rows.mean(state.T[: cell.rows.count])
            # NaN, of a model that failed, is out of range. Paths out of range take longest to run.
            held = (pressure >= lowest) & (pressure <= highest)
            alive, state = alive[held], state[held]
    stays = np.zeros(len(strain), dtype=bool)
    stays[alive.numpy()] = True
    return stays
