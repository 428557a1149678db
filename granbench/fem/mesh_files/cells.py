"""Plane elements of one shape with named edges, from the contents of a mesh file.

Nodes of no element are left out, nodes at one place become one, elements are turned anticlockwise,
and what makes no body is refused: elements out of one plane, parts that share no nodes, elements
that are there twice over.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from granbench.errors import ConfigurationError
from granbench.fem.mesh_files.contents import ElementBlock, MeshContents, require_size
from granbench.fem.mesh_files.edges import Edges, MergedNodes, named_edges

SAME_PLACE = 1e-8
"""Distance of two nodes, over the mesh's extent, below which they are one."""
FLAT = 1e-6
"""Distance from one plane, over the mesh's extent, that is rounding of the file."""
FARTHEST = 1e6
"""Coordinate, m, beyond which rounding spoils a mesh of some metres."""


@dataclass(frozen=True)
class PlaneCells:
    """Plane elements of three or of four corners.

    Parameters
    ----------
    nodes : (corner node, direction), m
    corners : (element, 3 or 4), places in `nodes`, anticlockwise
    middles : (element, edge, direction), m, of the edges from each corner to the next; None if all
        of them are straight
    boundaries : (edge, 2) places in `nodes`, by name
    notes : changes to the file's mesh, and remarks on it, for the user
    """

    nodes: np.ndarray
    corners: np.ndarray
    middles: np.ndarray | None
    boundaries: Mapping[str, np.ndarray]
    notes: tuple[str, ...]


def plane_cells(found: MeshContents) -> PlaneCells:
    """Plane elements of one shape, with named edges.

    Raises
    ------
    ConfigurationError
        If there are none, they lie in no plane x-y, fall into several parts, or have an edge that
        belongs to three elements.
    """
    notes = list(found.notes)
    corners, middles = _elements(found.blocks, notes)
    require_size(len(corners), 0)
    merged = _plane_nodes(found.nodes, np.union1d(corners.ravel(), middles[middles >= 0]), notes)
    corners = merged.renamed[corners]
    middles = np.where(middles >= 0, merged.renamed[middles], -1)
    corners, middles = _each_once(corners, middles)
    corners, middles = _anticlockwise(merged.nodes, corners, middles)
    edges = Edges(corners, merged.nodes)
    positions = edges.middles(middles)
    boundaries = named_edges(found, merged, edges, middles, notes)
    used, places = np.unique(corners, return_inverse=True)
    renumbered = np.full(len(merged.nodes), -1)
    renumbered[used] = np.arange(len(used))
    return PlaneCells(
        merged.nodes[used],
        places.reshape(corners.shape),
        positions,
        {name: renumbered[pairs] for name, pairs in boundaries.items()},
        tuple(notes),
    )


def _elements(blocks: tuple[ElementBlock, ...], notes: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Corners and edge nodes (-1 where there is none) of all elements, in one shape."""
    blocks = tuple(block for block in blocks if len(block.nodes))
    if not blocks:
        raise ConfigurationError(
            "has no plane elements; give triangles or quadrilaterals (in Gmsh a physical surface, "
            "or Mesh.SaveAll)"
        )
    by_shape: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    for block in blocks:
        count = block.nodes.shape[1]
        shape = 3 if count in (3, 6) else 4
        corners = block.nodes[:, :shape]
        middles = block.nodes[:, shape : 2 * shape] if count > 4 else np.full_like(corners, -1)
        by_shape.setdefault(shape, []).append((corners, middles))
    if stress := [block.kind for block in blocks if block.kind.startswith("CPS")]:
        notes.append(
            f"its {' and '.join(dict.fromkeys(stress))} are elements of plane stress; the analysis "
            "is in plane strain"
        )
    joined = {
        shape: tuple(map(np.concatenate, zip(*parts, strict=True)))
        for shape, parts in by_shape.items()
    }
    if len(joined) == 1:
        ((corners, middles),) = joined.values()
        return corners, middles
    notes.append(
        f"it mixes {len(joined[3][0])} triangles with {len(joined[4][0])} quadrilaterals; each of "
        "these is cut into two triangles"
    )
    halves = _halves(*joined[4])
    return np.concatenate([joined[3][0], halves[0]]), np.concatenate([joined[3][1], halves[1]])


def _halves(corners: np.ndarray, middles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two triangles of each quadrilateral."""
    none = np.full(len(corners), -1)
    first = corners[:, [0, 1, 2]], np.column_stack([middles[:, 0], middles[:, 1], none])
    second = corners[:, [0, 2, 3]], np.column_stack([none, middles[:, 2], middles[:, 3]])
    return np.concatenate([first[0], second[0]]), np.concatenate([first[1], second[1]])


def _plane_nodes(nodes: np.ndarray, used: np.ndarray, notes: list[str]) -> MergedNodes:
    places = nodes[used]
    if not np.isfinite(places).all():
        lost = int(used[~np.isfinite(places).all(axis=1)][0])
        raise ConfigurationError(
            f"node {lost} (counted from 0) has a coordinate that is not finite; correct it"
        )
    if np.abs(places).max() > FARTHEST:
        raise ConfigurationError(
            f"has a node at {np.abs(places).max():.3g} m; give coordinates in m, near the origin"
        )
    extent = float(np.ptp(places, axis=0).max()) or 1.0
    if places.shape[1] == 3 and np.ptp(places[:, 2]) > FLAT * extent:
        low, high = places[:, 2].min(), places[:, 2].max()
        flat = [name for name, span in zip("xy", np.ptp(places, axis=0), strict=False)
                if span <= FLAT * extent]  # fmt: skip
        where = f"it lies in a plane of constant {flat[0]}" if flat else "it lies in no plane"
        raise ConfigurationError(
            f"its z goes from {low:g} to {high:g}: {where}; draw it in x (to the right) and y (up)"
        )
    flat_places = places[:, :2].astype(float)
    tree = cKDTree(flat_places)
    pairs = tree.query_pairs(SAME_PLACE * extent, output_type="ndarray")
    count = len(used)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    groups, labels = connected_components(graph, directed=False)
    first = np.full(groups, count)
    np.minimum.at(first, labels, np.arange(count))
    if groups < count:
        notes.append(
            f"{count - groups} of its nodes lie where another one is; they are taken for one"
        )
    renamed = np.full(len(nodes), -1)
    renamed[used] = labels
    # Lines may have nodes of their own along the elements' edges.
    others = np.flatnonzero((renamed < 0) & (np.abs(nodes) < FARTHEST).all(axis=1))
    away, nearest = tree.query(nodes[others, :2])
    beside = away <= SAME_PLACE * extent
    renamed[others[beside]] = labels[nearest[beside]]
    return MergedNodes(flat_places[first], renamed)


def _each_once(corners: np.ndarray, middles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Elements that a file lists once for every group that they are in."""
    _, first = np.unique(np.sort(corners, axis=1), axis=0, return_index=True)
    first.sort()
    return corners[first], middles[first]


def _anticlockwise(
    nodes: np.ndarray, corners: np.ndarray, middles: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.moveaxis(nodes[corners], -1, 0)
    area = (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1)
    clockwise = (area < 0.0)[:, None]
    turned = np.column_stack([corners[:, 0], corners[:, :0:-1]])
    return np.where(clockwise, turned, corners), np.where(clockwise, middles[:, ::-1], middles)
