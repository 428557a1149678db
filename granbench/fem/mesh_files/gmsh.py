"""Gmsh's MSH files: versions 2 and 4.1, text and binary, first and second order.

Physical groups are taken by their names: physical curves become boundaries. Entities without a
physical group, which a file has when it was saved with `Mesh.SaveAll`, count as part of the body if
they are surfaces, and are left out if they are curves or points. Partitioned files are read whole.

References
----------
Gmsh reference manual, "MSH file format" and "Legacy formats".
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from granbench.errors import ConfigurationError
from granbench.fem.mesh_files.contents import ElementBlock, MeshContents, require_size
from granbench.fem.mesh_files.gmsh_sections import DAMAGED, Numbers, header, sections

POINT, LINES = 15, {1: 2, 8: 3}
PLANE = {2: ("triangle", 3), 3: ("quadrangle", 4), 9: ("6-node triangle", 6),
         10: ("9-node quadrangle", 9), 16: ("8-node quadrangle", 8)}  # fmt: skip
"""Gmsh's numbers of element types: their nodes."""
SOLID = (4, 5, 6, 7, 11, 12, 13, 14, 17, 18, 19)

NAME = re.compile(r'^\s*(\d)\s+(-?\d+)\s+"?(.*?)"?\s*$')


@dataclass
class _Parsed:
    """Content of the sections that have been read so far."""

    names: dict[tuple[int, int], str] = field(default_factory=dict)
    groups: dict[tuple[int, int], list[int]] = field(default_factory=dict)
    tags: np.ndarray | None = None
    nodes: np.ndarray | None = None
    elements: list[tuple[int, np.ndarray, list[int]]] = field(default_factory=list)


def read_gmsh(path: Path) -> MeshContents:
    """The mesh of an MSH file.

    Raises
    ------
    ConfigurationError
        Naming the section and what is wrong with it; the remedy for versions and element types that
        are not read.
    """
    raw = path.read_bytes()
    found = _Parsed()
    version, order, size, begin = header(raw)
    for section, content in sections(raw, begin):
        numbers = Numbers(section, content, order, size)
        if section == "PhysicalNames":
            _read_names(found, content)
        elif section == "Entities" and version == 4:
            _read_entities(found, numbers, partitioned=False)
        elif section == "PartitionedEntities" and version == 4:
            _read_entities(found, numbers, partitioned=True)
        elif section == "ParametricNodes":
            raise ConfigurationError("has parametric nodes; save it without Mesh.SaveParametric")
        elif section == "Nodes":
            (_read_nodes if version == 4 else _read_nodes_2)(found, numbers, content)
        elif section == "Elements":
            (_read_elements if version == 4 else _read_elements_2)(found, numbers, content)
    return _contents(found)


def _read_names(found: _Parsed, content: bytes) -> None:
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    for line in text.splitlines()[1:]:
        if matched := NAME.match(line):
            found.names[int(matched[1]), abs(int(matched[2]))] = matched[3]


def _read_entities(found: _Parsed, numbers: Numbers, *, partitioned: bool) -> None:
    """Physical groups of each entity, by its dimension and tag."""
    if partitioned:
        numbers.count()
        numbers.integers(2 * numbers.count())
    for dimension, count in enumerate(numbers.counts(4)):
        for _ in range(int(count)):
            tag = int(numbers.integers(1)[0])
            parent = None
            if partitioned:
                parent = tuple(map(int, numbers.integers(2)))
                numbers.integers(numbers.count())
            numbers.reals(3 if dimension == 0 else 6)
            groups = [abs(int(group)) for group in numbers.integers(numbers.count())]
            if not groups and parent is not None and parent[0] == dimension:
                groups = found.groups.get((parent[0], parent[1]), [])
            found.groups[dimension, tag] = groups
            if dimension:
                numbers.integers(numbers.count())


def _read_nodes(found: _Parsed, numbers: Numbers, content: bytes) -> None:
    blocks, total, _, _ = map(int, numbers.counts(4))
    require_size(0, total)
    tags, nodes = [], []
    for _ in range(blocks):
        dimension, _, parametric = map(int, numbers.integers(3))
        count = numbers.count()
        tags.append(numbers.counts(count))
        width = 3 + (dimension if parametric else 0)
        nodes.append(numbers.reals(count * width).reshape(count, width)[:, :3])
    found.tags = np.concatenate(tags) if tags else np.zeros(0, np.int64)
    found.nodes = np.concatenate(nodes) if nodes else np.zeros((0, 3))


def _read_nodes_2(found: _Parsed, numbers: Numbers, content: bytes) -> None:
    if numbers.order is None:
        total = numbers.count()
        require_size(0, total)
        rows = numbers.reals(4 * total).reshape(total, 4)
        tags = Numbers(numbers.section, b"", None, 8)
        tags.words = numbers.words[1 : 1 + 4 * total : 4]
        found.tags, found.nodes = tags.counts(total), rows[:, 1:]
        return
    total = _counted_line(numbers, content)
    require_size(0, total)
    kind = np.dtype([("tag", numbers.order + "i4"), ("x", numbers.order + "f8", 3)])
    if total * kind.itemsize > len(content) - numbers.place:
        raise numbers.too_few()
    rows = np.frombuffer(content, kind, total, numbers.place)
    found.tags, found.nodes = rows["tag"].astype(np.int64), rows["x"].astype(float)


def _counted_line(numbers: Numbers, content: bytes) -> int:
    """The count in the first line of a binary section of version 2; numbers follow it."""
    line, _, _ = content.partition(b"\n")
    try:
        count = int(line)
    except ValueError:
        raise ConfigurationError(
            f"section ${numbers.section} does not begin with a count; {DAMAGED}"
        ) from None
    numbers.place = len(line) + 1
    return count


def _read_elements(found: _Parsed, numbers: Numbers, content: bytes) -> None:
    blocks, _, _, _ = map(int, numbers.counts(4))
    for _ in range(blocks):
        dimension, entity, kind = map(int, numbers.integers(3))
        count = numbers.count()
        width = 1 + _nodes_of(kind)
        nodes = numbers.counts(count * width).reshape(count, width)[:, 1:]
        found.elements.append((kind, nodes, found.groups.get((dimension, entity), [])))


def _read_elements_2(found: _Parsed, numbers: Numbers, content: bytes) -> None:
    rows: dict[tuple[int, int], list[np.ndarray]] = {}
    if numbers.order is None:
        total = numbers.count()
        for _ in range(total):
            _, kind, tag_count = map(int, numbers.integers(3))
            tags = numbers.integers(tag_count)
            group = abs(int(tags[0])) if tag_count else 0
            nodes = numbers.integers(_nodes_of(kind))
            rows.setdefault((kind, group), []).append(nodes[None])
    else:
        total, done = _counted_line(numbers, content), 0
        while done < total:
            kind, count, tag_count = map(int, numbers.integers(3))
            if count < 1 or tag_count < 0:
                raise numbers.too_few()
            width = 1 + tag_count + _nodes_of(kind)
            block = numbers.integers(count * width).reshape(count, width)
            groups = np.abs(block[:, 1]) if tag_count else np.zeros(count, np.int64)
            for group in np.unique(groups):
                nodes = block[groups == group][:, 1 + tag_count :]
                rows.setdefault((kind, int(group)), []).append(nodes)
            done += count
    for (kind, group), parts in rows.items():
        found.elements.append((kind, np.concatenate(parts), [group] if group else []))


def _nodes_of(kind: int) -> int:
    """Nodes of an element type.

    Raises
    ------
    ConfigurationError
        With the remedy, if it is of three dimensions or of third order.
    """
    if kind == POINT:
        return 1
    if kind in LINES:
        return LINES[kind]
    if kind in PLANE:
        return PLANE[kind][1]
    if kind in SOLID:
        raise ConfigurationError("has three-dimensional elements; mesh the plane section alone")
    raise ConfigurationError(
        f"has elements of third or higher order (Gmsh's type {kind}), which are not read; mesh "
        "with Mesh.ElementOrder = 1 or 2"
    )


def _contents(found: _Parsed) -> MeshContents:
    for section, part in (("Nodes", found.nodes), ("Elements", found.elements or None)):
        if part is None:
            raise ConfigurationError(f"has no section ${section}; {DAMAGED}")
    assert found.nodes is not None and found.tags is not None
    places = _Places(found.tags)
    blocks: list[ElementBlock] = []
    lines: dict[str, tuple[np.ndarray, ...]] = {}
    unnamed: set[int] = set()
    for kind, tags, groups in found.elements:
        nodes = places.of(tags)
        if kind in PLANE:
            blocks.append(ElementBlock(PLANE[kind][0], nodes))
        elif kind in LINES:
            for group in groups:
                name = found.names.get((1, group))
                if name is None:
                    unnamed.add(group)
                    continue
                lines[name] = (*lines.get(name, ()), nodes)
    notes: tuple[str, ...] = ()
    if unnamed:
        listed = ", ".join(map(str, sorted(unnamed)[:8]))
        notes = (f"physical curves without a name are left out ({listed}); name them in Gmsh",)
    return MeshContents(found.nodes, tuple(blocks), lines, notes=notes)


class _Places:
    """Places in the array of nodes by node tag; tags may be sparse and in any order."""

    def __init__(self, tags: np.ndarray) -> None:
        self.order = np.argsort(tags, kind="stable")
        self.sorted = tags[self.order]

    def of(self, tags: np.ndarray) -> np.ndarray:
        """Places of tags; raises ConfigurationError for one that no node has."""
        at = np.searchsorted(self.sorted, tags)
        known = at < len(self.sorted)
        known[known] = self.sorted[at[known]] == tags[known]
        if not known.all():
            raise ConfigurationError(
                f"has an element at node {tags[~known][0]}, which is not in the file; {DAMAGED}"
            )
        return np.asarray(self.order[at])
