"""Abaqus input files: nodes, plane elements, and the sets and surfaces that name boundaries.

A boundary is a node set, a surface of element sides, or an element set of lines (trusses or beams).
Everything else in the file - materials, steps, loads - is left alone. Files that the file names are
not opened.

References
----------
Abaqus keywords reference guide: *NODE, *ELEMENT, *NSET, *ELSET, *SURFACE, *INSTANCE.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from granbench.errors import ConfigurationError
from granbench.fem.mesh_files.abaqus_assembly import Assembly, Entry, Instance, Part
from granbench.fem.mesh_files.abaqus_elements import nodes_of
from granbench.fem.mesh_files.contents import MOST_NODES, MeshContents, require_size

MAKES_MESH = ("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM", "PARAMETER")
"""Keywords by which Abaqus itself makes, moves or computes nodes and elements."""

Rows = list[tuple[int, list[str]]]
"""Data lines below a keyword: the number of the line, and what is between the commas."""


@dataclass(frozen=True)
class _Keyword:
    """A keyword line: its number, and its parameters by their names in upper case."""

    line: int
    name: str
    parameters: dict[str, str]

    @property
    def place(self) -> str:
        return f"line {self.line}: *{self.name}"


def read_abaqus(path: Path) -> MeshContents:
    """The mesh of an Abaqus input file.

    Raises
    ------
    ConfigurationError
        Naming the line, and the element type or keyword that is not read.
    """
    raw = path.read_bytes()
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    if "\0" in text:
        raise ConfigurationError("is binary and no Abaqus input file; give the text file (.inp)")
    reader = _Reader()
    for keyword, rows in _keywords(text.splitlines()):
        reader.take(keyword, rows)
    assembly = Assembly(reader.instances, list(reader.parts.values()), reader.root)
    return assembly.contents(reader.node_sets, reader.element_sets, reader.surfaces, reader.names)


def _keywords(lines: list[str]) -> list[tuple[_Keyword, Rows]]:
    """Keywords with the data lines below each; comments are left out."""
    kept = [
        (number, line.strip())
        for number, line in enumerate(lines, start=1)
        if line.strip() and not line.lstrip().startswith("**")
    ]
    found: list[tuple[_Keyword, Rows]] = []
    continued = False
    for number, line in kept:
        if continued:
            found[-1][0].parameters.update(_parameters(line))
            continued = line.endswith(",")
        elif line.startswith("*"):
            name, _, rest = line[1:].partition(",")
            keyword = _Keyword(number, " ".join(name.upper().split()), _parameters(rest))
            found.append((keyword, []))
            continued = line.endswith(",")
        elif found:
            found[-1][1].append((number, [word.strip() for word in line.split(",")]))
    return found


def _parameters(text: str) -> dict[str, str]:
    pairs = (word.partition("=") for word in text.split(",") if word.strip())
    return {name.strip().upper(): value.strip().strip('"').strip() for name, _, value in pairs}


class _Reader:
    """Reads one keyword after the other and keeps what belongs to the mesh."""

    def __init__(self) -> None:
        self.root = self.part = Part("")
        self.parts: dict[str, Part] = {}
        self.instances: list[Instance] = []
        self.instance: str | None = None
        self.node_sets: dict[str, list[Entry]] = {}
        self.element_sets: dict[str, list[Entry]] = {}
        self.surfaces: dict[str, list[Entry]] = {}
        self.names: dict[str, str] = {}

    def take(self, keyword: _Keyword, rows: Rows) -> None:
        """One keyword with its data lines."""
        self._refuse_other_files(keyword)
        takers = {
            "PART": self._begin_part,
            "INSTANCE": self._begin_instance,
            "END PART": self._end,
            "END INSTANCE": self._end,
            "NODE": self._take_nodes,
            "ELEMENT": self._take_elements,
            "NSET": self._take_set,
            "ELSET": self._take_set,
            "SURFACE": self._take_surface,
        }
        if taker := takers.get(keyword.name):
            taker(keyword, rows)

    def _refuse_other_files(self, keyword: _Keyword) -> None:
        name, given = keyword.name, keyword.parameters
        reads = name in ("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE") and "INPUT" in given
        if name in ("INCLUDE", "IMPORT", "MANIFEST") or reads:
            file = given.get("INPUT") or "another file"
            raise ConfigurationError(
                f"{keyword.place} reads {file}; other files are not opened, so put the lines of "
                "that one here"
            )
        polar = name == "NODE" and given.get("SYSTEM", "R").upper() != "R"
        if name in MAKES_MESH or polar:
            raise ConfigurationError(
                f"{keyword.place}{', system' if polar else ''} makes or moves nodes in Abaqus "
                "itself and is not read; write out all nodes in x and y, as Abaqus/CAE does"
            )

    def _begin_part(self, keyword: _Keyword, rows: Rows) -> None:
        label = self._label(keyword, "NAME")
        self.part = self.parts.setdefault(label, Part(label))

    def _begin_instance(self, keyword: _Keyword, rows: Rows) -> None:
        label, wanted = self._label(keyword, "NAME"), self._label(keyword, "PART")
        if len(rows) > 1 and not keyword.parameters.get("LIBRARY"):
            raise ConfigurationError(
                f"{keyword.place} {self.names[label]} is turned, which is not read; mesh the part "
                "as it is to stand"
            )
        part = self.parts.setdefault(wanted, Part(wanted))
        shift = tuple(_number(line, word) for line, words in rows for word in words if word)
        self.instances.append(Instance(label, part, shift))
        # A mesh that is written within the instance belongs to its part.
        self.part, self.instance = part, label

    def _end(self, keyword: _Keyword, rows: Rows) -> None:
        self.part, self.instance = self.root, None

    def _take_nodes(self, keyword: _Keyword, rows: Rows) -> None:
        members = self._entries(keyword, "NSET", self.node_sets)
        for line, words in rows:
            number, *coordinates = words[:4]
            if len(coordinates) < 2:
                raise ConfigurationError(
                    f"line {line}: a node is its number, x and y; {len(words)} are here"
                )
            tag = _whole(line, number)
            self.part.nodes[tag] = tuple(_number(line, word or "0") for word in coordinates)
            members.append(Entry(self._where(), str(tag)))
        require_size(0, len(self.part.nodes))

    def _take_elements(self, keyword: _Keyword, rows: Rows) -> None:
        kind = keyword.parameters.get("TYPE", "").upper()
        if not kind:
            raise ConfigurationError(f"{keyword.place} has no type; write type=CPE4 or another")
        try:
            count = nodes_of(kind)
        except ConfigurationError as error:
            raise ConfigurationError(f"line {keyword.line}: {error}") from None
        if count is None:
            return
        members = self._entries(keyword, "ELSET", self.element_sets)
        numbers: list[int] = []
        for line, words in rows:
            numbers += [_whole(line, word) for word in words if word]
            if len(numbers) < 1 + count and not words[-1]:
                continue  # the element goes on in the next line
            if len(numbers) != 1 + count:
                raise ConfigurationError(
                    f"line {line}: an element {kind} is its number and {count} nodes; "
                    f"{len(numbers)} numbers are here"
                )
            tag, *nodes = numbers
            self.part.elements[tag] = kind, tuple(nodes)
            members.append(Entry(self._where(), str(tag)))
            numbers = []
        if numbers:
            raise ConfigurationError(f"element {numbers[0]} of type {kind} lacks nodes; add them")

    def _take_set(self, keyword: _Keyword, rows: Rows) -> None:
        nodes = keyword.name == "NSET"
        self._label(keyword, keyword.name)
        members = self._entries(
            keyword, keyword.name, self.node_sets if nodes else self.element_sets
        )
        where = keyword.parameters.get("INSTANCE", "").upper() or self._where()
        for line, words in rows:
            listed = [word for word in words if word]
            if "GENERATE" in keyword.parameters:
                listed = list(map(str, _generated(line, listed)))
            members += [Entry(where, word) for word in listed]

    def _take_surface(self, keyword: _Keyword, rows: Rows) -> None:
        kind = keyword.parameters.get("TYPE", "ELEMENT").upper()
        if kind not in ("ELEMENT", "NODE"):
            return
        self._label(keyword, "NAME")
        faces = self._entries(keyword, "NAME", self.surfaces)
        for _, words in rows:
            side = words[1].upper() if kind == "ELEMENT" and len(words) > 1 else ""
            faces.append(Entry(self._where(), words[0], "NODE" if kind == "NODE" else side))

    def _entries(
        self, keyword: _Keyword, parameter: str, kept: dict[str, list[Entry]]
    ) -> list[Entry]:
        """The list that a keyword adds to; a discarded one if it names no set."""
        if parameter not in keyword.parameters:
            return []
        return kept.setdefault(self._label(keyword, parameter), [])

    def _label(self, keyword: _Keyword, parameter: str) -> str:
        """The name that a keyword gives, in upper case."""
        written = keyword.parameters.get(parameter)
        if not written:
            raise ConfigurationError(f"{keyword.place} lacks {parameter.lower()}=; add a name")
        self.names.setdefault(written.upper(), written)
        return written.upper()

    def _where(self) -> str | None:
        return self.instance or self.part.name or None


def _generated(line: int, words: list[str]) -> range:
    """Numbers from the first to the last by a step."""
    numbers = [_whole(line, word) for word in words]
    first, last, step = (*numbers, 1)[:3] if len(numbers) == 2 else (*numbers, 0, 0, 0)[:3]
    if len(numbers) not in (2, 3) or step < 1 or not 0 <= last - first < MOST_NODES * step:
        raise ConfigurationError(
            f"line {line}: {', '.join(words)} generates no numbers; give first, last, step"
        )
    return range(first, last + 1, step)


def _whole(line: int, word: str) -> int:
    try:
        return int(word[:40])
    except ValueError:
        raise ConfigurationError(
            f"line {line}: {word[:40]!r} is where a whole number belongs; correct the line"
        ) from None


def _number(line: int, word: str) -> float:
    try:
        return float(word.upper().replace("D", "E"))
    except ValueError:
        raise ConfigurationError(
            f"line {line}: {word[:40]!r} is where a number belongs; correct the line"
        ) from None
