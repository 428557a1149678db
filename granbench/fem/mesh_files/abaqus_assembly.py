"""Parts of an Abaqus file placed by their instances, and the sets and surfaces on them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from granbench.errors import ConfigurationError
from granbench.fem.mesh_files.abaqus_elements import corners_of, is_plane
from granbench.fem.mesh_files.contents import ElementBlock, MeshContents, require_size

SIDE = re.compile(r"^S([1-4])$")

Member = tuple[str, int]
"""A node or element: the name of its body, and its number there."""


@dataclass
class Part:
    """A part, or the file itself where it has none."""

    name: str
    nodes: dict[int, tuple[float, ...]] = field(default_factory=dict)
    elements: dict[int, tuple[str, tuple[int, ...]]] = field(default_factory=dict)


@dataclass(frozen=True)
class Instance:
    """A part moved to its place."""

    name: str
    part: Part
    shift: tuple[float, ...]


@dataclass(frozen=True)
class Entry:
    """Entries of a set or surface.

    Parameters
    ----------
    where : the instance or part whose numbers these are; None for the file itself
    what : a number, or the name of a set
    side : of a surface: S1 to S4, NODE for a node, or nothing for all that is outside
    """

    where: str | None
    what: str
    side: str = ""


Sets = Mapping[str, list[Entry]]
"""Sets by their names in upper case, as Abaqus compares names."""


class Assembly:
    """Bodies with one numbering of nodes and elements.

    Parameters
    ----------
    instances : parts in their places
    parts : all parts; without instances, each is in its place as it is
    root : what is outside of all parts
    """

    def __init__(self, instances: list[Instance], parts: list[Part], root: Part) -> None:
        bodies = instances or [Instance(part.name, part, ()) for part in parts]
        self.bodies = [*bodies, Instance("", root, ())] if root.nodes else list(bodies)
        require_size(
            sum(len(body.part.elements) for body in self.bodies) // 4,  # lines are among them
            sum(len(body.part.nodes) for body in self.bodies),
        )
        self.nodes: list[tuple[float, float, float]] = []
        self.node_places: dict[Member, int] = {}
        self.elements: dict[Member, tuple[str, tuple[int, ...]]] = {}
        for body in self.bodies:
            self._place(body)

    def _place(self, body: Instance) -> None:
        right, up, out = (*body.shift, 0.0, 0.0, 0.0)[:3]
        for number, place in body.part.nodes.items():
            x, y, z = (*place, 0.0)[:3]
            self.node_places[body.name, number] = len(self.nodes)
            self.nodes.append((x + right, y + up, z + out))
        for number, (kind, nodes) in body.part.elements.items():
            try:
                places = tuple(self.node_places[body.name, node] for node in nodes)
            except KeyError as missing:
                raise ConfigurationError(
                    f"element {number} of type {kind} has node {missing.args[0][1]}, which is not "
                    "in the file; write the file again"
                ) from None
            self.elements[body.name, number] = kind, places

    def contents(
        self, node_sets: Sets, element_sets: Sets, surfaces: Sets, names: Mapping[str, str]
    ) -> MeshContents:
        """The mesh with its named boundaries.

        Parameters
        ----------
        node_sets, element_sets, surfaces : as the file lists them
        names : as they are written in the file, by those in upper case
        """
        members = _Members(self, node_sets, element_sets)
        lines: dict[str, list[tuple[int, ...]]] = {}
        nodes: dict[str, list[int]] = {}
        for label in element_sets:
            for element in members.of_set(label, elements=True):
                kind, places = self.elements[element]
                if not is_plane(kind):
                    lines.setdefault(names[label], []).append(places)
        for label, entries in surfaces.items():
            edges, single = self._surface(entries, members)
            lines.setdefault(names[label], []).extend(edges)
            nodes.setdefault(names[label], []).extend(single)
        for label in node_sets:
            listed = members.of_set(label, elements=False)
            nodes.setdefault(names[label], []).extend(self.node_places[node] for node in listed)
        return MeshContents(
            np.array(self.nodes, dtype=float).reshape(-1, 3),
            self._blocks(),
            {name: _by_length(rows) for name, rows in lines.items() if rows},
            {name: np.array(places) for name, places in nodes.items() if places},
        )

    def _blocks(self) -> tuple[ElementBlock, ...]:
        rows: dict[str, list[tuple[int, ...]]] = {}
        for kind, nodes in self.elements.values():
            if is_plane(kind):
                rows.setdefault(kind, []).append(nodes)
        return tuple(ElementBlock(kind, np.array(nodes)) for kind, nodes in rows.items())

    def _surface(
        self, entries: list[Entry], members: _Members
    ) -> tuple[list[tuple[int, ...]], list[int]]:
        """Edges of a surface, and nodes between which all free edges belong to it."""
        edges: list[tuple[int, ...]] = []
        nodes: list[int] = []
        for entry in entries:
            if entry.side == "NODE":
                found = members.of_entry(entry, elements=False)
                nodes += [self.node_places[node] for node in found]
                continue
            for element in members.of_entry(entry, elements=True):
                kind, places = self.elements[element]
                side = SIDE.match(entry.side)
                if not is_plane(kind):
                    edges.append(places)
                elif side and int(side[1]) <= corners_of(kind):
                    first = int(side[1]) - 1
                    edges.append((places[first], places[(first + 1) % corners_of(kind)]))
                else:
                    nodes += places
        return edges, nodes


class _Members:
    """Members of sets from their entries."""

    def __init__(self, assembly: Assembly, node_sets: Sets, element_sets: Sets) -> None:
        self.assembly = assembly
        self.sets = {True: element_sets, False: node_sets}
        self.known: dict[tuple[bool, str], list[Member]] = {}

    def of_set(self, label: str, *, elements: bool) -> list[Member]:
        """Members of a set, each once."""
        key = elements, label
        if key not in self.known:
            self.known[key] = []  # so that a set within itself ends
            found: list[Member] = []
            for entry in self.sets[elements].get(label, ()):
                found += self.of_entry(entry, elements=elements)
            self.known[key] = list(dict.fromkeys(found))
        return self.known[key]

    def of_entry(self, entry: Entry, *, elements: bool) -> list[Member]:
        """Members that an entry stands for; numbers that no body has are passed over."""
        where, what = entry.where, entry.what.strip('"').upper()
        if "." in what:
            instance, _, rest = what.partition(".")
            if any(body.name == instance for body in self.assembly.bodies):
                where, what = instance, rest
        bodies = self._bodies(where)
        if what.isdigit():
            known = self.assembly.elements if elements else self.assembly.node_places
            return [(body, int(what)) for body in bodies if (body, int(what)) in known]
        listed = self.of_set(what, elements=elements)
        return [member for member in listed if member[0] in bodies] if where else listed

    def _bodies(self, where: str | None) -> list[str]:
        """Names of the bodies at a place: an instance, or all instances of a part."""
        bodies = self.assembly.bodies
        if where is None:
            return [body.name for body in bodies if not body.name] or [b.name for b in bodies]
        return [body.name for body in bodies if where in (body.name, body.part.name)]


def _by_length(rows: list[tuple[int, ...]]) -> tuple[np.ndarray, ...]:
    lengths = sorted({len(row) for row in rows})
    return tuple(np.array([row for row in rows if len(row) == length]) for length in lengths)
