"""Initial positions of grains: random without contact in a periodic cube, and exact lattices."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from granbench.errors import ConfigurationError
from granbench.generators.dem.diameters import Grading

Floats = NDArray[np.float64]

WIDE_SOLID_FRACTION = 0.40
NARROW_SOLID_FRACTION = 0.30
"""Random placement of equal spheres becomes slow above it, and impossible at 0.38."""

WIDE_GRADING_INDEX = 1.10
"""I_G above which small grains fill the gaps between large ones, so that 0.40 is reached fast."""

SIZE_CLASS_RATIO = 1.25
"""Largest over smallest diameter of the grains that are placed together."""

CANDIDATES_PER_GRAIN = 10
CANDIDATES_PER_ROUND = (500, 20_000)
"""Smallest and largest number of positions that are tried at once. For each grain that is not
placed yet, ten positions are tried in the first round of its class and ten more in each later one,
as free positions become rare."""

FAILED_ROUNDS = 20
"""Successive rounds without a placed grain, after which the placement fails."""


def default_solid_fraction(grading: Grading) -> float:
    """Solid fraction at which `place_grains` is fast: 0.40 for wide gradings, 0.30 for narrow."""
    wide = grading.grading_index > WIDE_GRADING_INDEX
    return WIDE_SOLID_FRACTION if wide else NARROW_SOLID_FRACTION


def place_grains(
    diameters: Floats, solid_fraction: float, rng: np.random.Generator
) -> tuple[Floats, float]:
    """Place grains at random in a periodic cube, no two in contact, the largest first.

    Parameters
    ----------
    diameters : (grain,), m
    solid_fraction : float
        Volume of the grains over volume of the cube, above 0 and below 1.
    rng : numpy.random.Generator

    Returns
    -------
    positions : (grain, 3), m, from 0 to the box edge, in the order of `diameters`
    box_edge : float, m

    Raises
    ------
    ConfigurationError
        If a diameter or the solid fraction is not positive, the box is smaller than two of the
        largest grains (nearest periodic images would be ambiguous), or no free position is left.
    """
    if diameters.size == 0 or not np.all(np.isfinite(diameters) & (diameters > 0.0)):
        raise ConfigurationError(
            "diameters must be positive and finite, and there must be at least one"
        )
    if not 0.0 < solid_fraction < 1.0:
        raise ConfigurationError(
            f"solid_fraction is {solid_fraction}; give a value between 0 and 1, such as "
            f"{NARROW_SOLID_FRACTION} or {WIDE_SOLID_FRACTION}"
        )
    box_edge = float((math.pi / 6.0 * (diameters**3).sum() / solid_fraction) ** (1.0 / 3.0))
    largest = float(diameters.max())
    if box_edge < 2.0 * largest:
        raise ConfigurationError(
            f"particle_count {diameters.size} gives a box of {box_edge / largest:.2f} times the "
            "largest diameter; at least 2 is needed: take more particles or a smaller size_ratio"
        )
    positions = np.empty((diameters.size, 3))
    placed: list[tuple[cKDTree, Floats]] = []
    for grains in _size_classes(diameters):
        positions[grains] = _place_class(diameters[grains], placed, box_edge, rng)
        placed.append((cKDTree(positions[grains], boxsize=box_edge), diameters[grains]))
    return positions, box_edge


def _size_classes(diameters: Floats) -> list[NDArray[np.intp]]:
    """Indices of the grains in classes of similar size, the largest first."""
    order = np.argsort(-diameters, kind="stable")
    level = np.floor(np.log(diameters[order[0]] / diameters[order]) / math.log(SIZE_CLASS_RATIO))
    return np.split(order, np.flatnonzero(np.diff(level)) + 1)


def _place_class(
    diameters: Floats,
    placed: Sequence[tuple[cKDTree, Floats]],
    box_edge: float,
    rng: np.random.Generator,
) -> Floats:
    """Positions of the grains of one size class among those already placed, (grain, 3), m."""
    positions = np.empty((diameters.size, 3))
    waiting = np.arange(diameters.size)
    done = np.empty(0, dtype=np.intp)
    rounds = failed = 0
    while waiting.size and failed < FAILED_ROUNDS:
        rounds += 1
        tried = np.clip(CANDIDATES_PER_GRAIN * rounds * waiting.size, *CANDIDATES_PER_ROUND)
        grain = np.resize(waiting, int(tried))
        candidate = rng.uniform(0.0, box_edge, (grain.size, 3))
        own = [(cKDTree(positions[done], boxsize=box_edge), diameters[done])] if done.size else []
        for tree, sizes in (*placed, *own):
            free = _free_of(candidate, diameters[grain], tree, sizes, box_edge)
            candidate, grain = candidate[free], grain[free]
        grain, first = np.unique(grain, return_index=True)
        candidate = candidate[first]
        apart = _apart_from_earlier(candidate, diameters[grain], box_edge)
        positions[grain[apart]] = candidate[apart]
        done = np.concatenate([done, grain[apart]])
        waiting = np.setdiff1d(waiting, grain[apart], assume_unique=True)
        failed = 0 if apart.any() else failed + 1
    if waiting.size:
        raise ConfigurationError(
            f"{waiting.size} grains of {diameters.min():.3g} to {diameters.max():.3g} m find no "
            "free position; lower solid_fraction (for equal spheres it must be below 0.38)"
        )
    return positions


def _free_of(
    candidate: Floats, diameter: Floats, tree: cKDTree, sizes: Floats, box_edge: float
) -> NDArray[np.bool_]:
    """Whether each candidate touches no grain of a tree, (candidate,)."""
    free = np.ones(len(candidate), dtype=bool)
    if free.size:
        reach = 0.5 * (diameter.max() + sizes.max())
        near = cKDTree(candidate, boxsize=box_edge).sparse_distance_matrix(
            tree, reach, output_type="ndarray"
        )
        touching = near["v"] < 0.5 * (diameter[near["i"]] + sizes[near["j"]])
        free[near["i"][touching]] = False
    return free


def _apart_from_earlier(candidate: Floats, diameter: Floats, box_edge: float) -> NDArray[np.bool_]:
    """Whether each candidate touches none of the candidates before it, (candidate,)."""
    apart = np.ones(len(candidate), dtype=bool)
    if len(candidate) > 1:
        pairs = cKDTree(candidate, boxsize=box_edge).query_pairs(
            float(diameter.max()), output_type="ndarray"
        )
        gap = _separation(candidate[pairs[:, 0]], candidate[pairs[:, 1]], box_edge)
        touching = gap < 0.5 * (diameter[pairs[:, 0]] + diameter[pairs[:, 1]])
        apart[pairs[touching].max(axis=1, initial=0)] = False
    return apart


def _separation(first: Floats, second: Floats, box_edge: float) -> Floats:
    """Distance of centres by the nearest periodic image, (pair,), m."""
    offset = first - second
    return np.linalg.norm(offset - box_edge * np.round(offset / box_edge), axis=-1)


def simple_cubic(cells: int | tuple[int, int, int], diameter: float) -> tuple[Floats, Floats]:
    """Equal spheres in point contact on a simple cubic lattice (solid fraction pi / 6).

    Parameters
    ----------
    cells : int or (3,), unit cells in each direction
    diameter : float, m; also the lattice constant

    Returns
    -------
    positions : (grain, 3), m, from 0 to the box edge
    box_edges : (3,), m, of the periodic box
    """
    return _lattice(cells, diameter, np.array([[0.5, 0.5, 0.5]]))


def face_centred_cubic(cells: int | tuple[int, int, int], diameter: float) -> tuple[Floats, Floats]:
    """Equal spheres in point contact on a face-centred cubic lattice (fraction pi / sqrt 18).

    Parameters
    ----------
    cells : int or (3,), unit cells of four grains in each direction
    diameter : float, m; the lattice constant is sqrt(2) times as long

    Returns
    -------
    positions : (grain, 3), m, from 0 to the box edge
    box_edges : (3,), m, of the periodic box
    """
    basis = 0.25 + np.array([[0.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]])
    return _lattice(cells, math.sqrt(2.0) * diameter, basis)


def _lattice(
    cells: int | tuple[int, int, int], constant: float, basis: Floats
) -> tuple[Floats, Floats]:
    counts = np.broadcast_to(np.asarray(cells, dtype=int), (3,))
    if counts.min() < 1 or not constant > 0.0:
        raise ConfigurationError(
            f"a lattice needs at least 1 cell in each direction and a positive diameter; "
            f"got cells {cells}"
        )
    corners = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 3)
    return (corners[:, None, :] + basis).reshape(-1, 3) * constant, counts * constant
