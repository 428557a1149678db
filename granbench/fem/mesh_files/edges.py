"""Edges of plane elements, and which of them the groups of a file name."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from granbench.errors import ConfigurationError
from granbench.fem.mesh_files.contents import MeshContents

STRAIGHT = 1e-6
"""Distance of an edge's node from its middle, over the edge's length, that is rounding."""


@dataclass(frozen=True)
class MergedNodes:
    """Nodes in the plane, with nodes at one place merged into one.

    Parameters
    ----------
    nodes : (node, direction), m
    renamed : from places in the file's nodes to places in these; -1 for one that is away from all
        elements
    """

    nodes: np.ndarray
    renamed: np.ndarray


class Edges:
    """Edges of elements, each once.

    Parameters
    ----------
    corners : (element, corner)
    nodes : (node, direction), m
    """

    def __init__(self, corners: np.ndarray, nodes: np.ndarray) -> None:
        self.nodes = nodes
        pairs = np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1)
        self.shape = corners.shape
        self.keys, of_element, counts = np.unique(
            self.key(pairs.reshape(-1, 2)), return_inverse=True, return_counts=True
        )
        self.of_element = of_element.reshape(self.shape)
        self.pairs = np.column_stack([self.keys // len(nodes), self.keys % len(nodes)])
        self.free = counts == 1
        self._require_one_body(corners, counts)

    def key(self, pairs: np.ndarray) -> np.ndarray:
        """One number for each pair of nodes."""
        low, high = pairs.min(axis=1), pairs.max(axis=1)
        return np.asarray(low.astype(np.int64) * len(self.nodes) + high)

    def find(self, pairs: np.ndarray) -> np.ndarray:
        """Numbers of the edges between pairs of nodes; -1 where there is none."""
        if len(pairs) == 0:
            return np.zeros(0, np.int64)
        key = self.key(pairs)
        at = np.minimum(np.searchsorted(self.keys, key), len(self.keys) - 1)
        return np.where((self.keys[at] == key) & (pairs >= 0).all(axis=1), at, -1)

    def _require_one_body(self, corners: np.ndarray, counts: np.ndarray) -> None:
        if (crowded := counts > 2).any():
            x, y = self.nodes[self.pairs[crowded.argmax()]].mean(axis=0)
            raise ConfigurationError(
                f"the edge at ({x:g}, {y:g}) belongs to {counts[crowded.argmax()]} elements; leave "
                "one element in each place"
            )
        elements = np.repeat(np.arange(self.shape[0]), self.shape[1])
        size = (self.shape[0], len(self.keys))
        on = coo_array((np.ones(len(elements)), (elements, self.of_element.ravel())), shape=size)
        parts, _ = connected_components((on @ on.T).tocsr(), directed=False)
        if parts > 1:
            raise ConfigurationError(
                f"it falls into {parts} parts that share no nodes; join them (in Gmsh "
                "fragment the surfaces, or let them share their curves)"
            )

    def middles(self, given: np.ndarray) -> np.ndarray | None:
        """Middle of each element's edges, (element, edge, direction); None if all are straight."""
        ends = self.nodes[self.pairs]
        straight = ends.mean(axis=1)
        node = np.full(len(self.keys), -1)
        has = given >= 0
        node[self.of_element[has]] = given[has]
        differs = has & (node[self.of_element] != given)
        if differs.any():
            x, y = straight[self.of_element[differs][0]]
            raise ConfigurationError(
                f"two elements have different nodes on their common edge at ({x:g}, {y:g}); mesh "
                "them together"
            )
        middles = np.where((node >= 0)[:, None], self.nodes[node], straight)
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        off = np.linalg.norm(middles - straight, axis=1)
        if (off <= STRAIGHT * length).all():
            return None
        return np.asarray(middles[self.of_element])


def named_edges(
    found: MeshContents, merged: MergedNodes, edges: Edges, middles: np.ndarray, notes: list[str]
) -> dict[str, np.ndarray]:
    """Pairs of corners of the edges in every named group."""
    is_corner = np.zeros(len(merged.nodes), dtype=bool)
    is_corner[edges.pairs] = True
    edge_with = np.full(len(merged.nodes) + 1, -1)
    edge_with[middles[middles >= 0]] = edges.of_element[middles >= 0]
    boundaries: dict[str, np.ndarray] = {}
    for name, groups in found.lines.items():
        parts = [
            _edges_of_lines(merged.renamed[lines], edges, is_corner, edge_with)
            for lines in groups
            if len(lines)
        ]
        listed = np.unique(np.concatenate(parts)) if parts else np.zeros(0, np.int64)
        if (lost := sum(int((part < 0).sum()) for part in parts)) and (listed >= 0).any():
            notes.append(f"{lost} lines of its group {name!r} lie along no element's edge")
        boundaries[name] = edges.pairs[listed[listed >= 0]]
    for name, nodes in found.node_sets.items():
        if len(boundaries.get(name, ())):
            continue
        within = np.zeros(len(merged.nodes) + 1, dtype=bool)
        within[merged.renamed[nodes]] = True
        within[-1] = False  # where the nodes of no element went
        boundaries[name] = edges.pairs[within[edges.pairs].all(axis=1) & edges.free]
    return {name: pairs for name, pairs in boundaries.items() if len(pairs)}


def _edges_of_lines(
    lines: np.ndarray, edges: Edges, is_corner: np.ndarray, edge_with: np.ndarray
) -> np.ndarray:
    """The edge along each line, -1 where there is none.

    Of a line with three nodes those count that are corners of elements, whatever their order; a
    line from a corner to the node in the middle of an edge counts for that edge.
    """
    corner = is_corner[lines] & (lines >= 0)
    pairs = np.full((len(lines), 2), -1)
    two = corner.sum(axis=1) == 2
    pairs[two] = lines[two][corner[two]].reshape(-1, 2)
    along = edges.find(pairs)
    half = (corner.sum(axis=1) == 1) & (lines.shape[1] == 2)
    along[half] = edge_with[np.where(corner[half], -1, lines[half]).max(axis=1)]
    return along
