"""Contents of a mesh file of any format: nodes, plane elements, and named groups."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from granbench.errors import ConfigurationError

MOST_ELEMENTS = 100_000
"""Plane elements, with some hours of computing in the quickest analysis."""
MOST_NODES = 1_000_000
"""Nodes that a file may declare."""


@dataclass(frozen=True)
class ElementBlock:
    """Plane elements of one kind.

    Parameters
    ----------
    kind : name in the file's format, such as CPE4R
    nodes : (element, 3, 4, 6, 8 or 9), places in the nodes of the file: corners in order around the
        element, then the nodes on its edges from the first corner on, then one in its middle
    """

    kind: str
    nodes: np.ndarray


@dataclass(frozen=True)
class MeshContents:
    """A mesh file as it was read.

    Parameters
    ----------
    nodes : (node, 2 or 3), coordinates in m
    blocks : the plane elements
    lines : (line, 2 or 3) nodes of the lines in a named group; the groups that can be boundaries
    node_sets : (node,) places of the nodes in a named group
    notes : what a user should know of the file
    """

    nodes: np.ndarray
    blocks: tuple[ElementBlock, ...]
    lines: Mapping[str, tuple[np.ndarray, ...]] = field(default_factory=dict)
    node_sets: Mapping[str, np.ndarray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def require_size(elements: int, nodes: int) -> None:
    """Refuse a mesh that is too large for this program.

    Raises
    ------
    ConfigurationError
        Naming the count and the limit.
    """
    for count, most, what in (
        (elements, MOST_ELEMENTS, "elements"),
        (nodes, MOST_NODES, "nodes"),
    ):
        if count > most:
            raise ConfigurationError(f"has {count:,} {what}; give a mesh of at most {most:,}")
