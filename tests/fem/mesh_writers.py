"""Mesh files of the biaxial specimen, as Gmsh and Abaqus write them."""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

WIDTH, HEIGHT, COLUMNS, ROWS = 0.5, 1.0, 2, 4
SIDES = ("bottom", "right", "top", "left")
GMSH_TYPES = {3: 2, 4: 3, 6: 9, 8: 16, 9: 10}
ABAQUS_LINES = {2: "T2D2", 3: "T2D3"}


@dataclass(frozen=True)
class Specimen:
    """Nodes (node, 3), plane elements (element, 3 to 9), and lines (line, 2 or 3) by side."""

    nodes: np.ndarray
    elements: np.ndarray
    sides: dict[str, np.ndarray]

    @property
    def side_nodes(self) -> dict[str, np.ndarray]:
        return {name: np.unique(lines) for name, lines in self.sides.items()}


def specimen(nodes: int = 4) -> Specimen:
    """The biaxial test's coarse mesh, in elements of 3, 4, 6, 8 or 9 nodes."""
    x, y = np.linspace(0, WIDTH, 2 * COLUMNS + 1), np.linspace(0, HEIGHT, 2 * ROWS + 1)
    places = np.array([(a, b, 0.0) for b in y for a in x])
    at = np.arange(len(places)).reshape(len(y), len(x))
    columns, rows = slice(0, -2, 2), slice(0, -2, 2)
    block = [
        [at[rows.start + i :: 2, columns.start + j :: 2][:ROWS, :COLUMNS].ravel() for j in range(3)]
        for i in range(3)
    ]
    ring = [block[0][0], block[0][2], block[2][2], block[2][0], block[0][1], block[1][2],
            block[2][1], block[1][0], block[1][1]]  # fmt: skip
    if nodes in (3, 6):
        a, b, c, d, ab, bc, cd, da, middle = ring
        first, second = (a, b, c, ab, bc, middle), (a, c, d, middle, cd, da)
        elements = np.concatenate([np.stack(half, axis=1) for half in (first, second)])[:, :nodes]
    else:
        elements = np.stack(ring, axis=1)[:, :nodes]
    edges = dict(zip(SIDES, (at[0], at[:, -1], at[-1], at[:, 0]), strict=True))
    count = 2 if nodes <= 4 else 3
    sides = {
        name: np.stack([row[:-2:2], row[2::2], row[1:-1:2]], axis=1)[:, :count]
        for name, row in edges.items()
    }
    return Specimen(places, elements, sides)


def turned_clockwise(found: Specimen) -> Specimen:
    corners = 3 if found.elements.shape[1] in (3, 6) else 4
    order = [0, *range(corners - 1, 0, -1)]
    middles = [corners + number for number in range(corners - 1, -1, -1)]
    if found.elements.shape[1] > corners:
        order += middles + list(range(2 * corners, found.elements.shape[1]))
    return replace(found, elements=found.elements[:, order])


def gmsh_22(found: Specimen, *, binary: bool = False, groups: bool = True) -> bytes:
    """An MSH 2.2 file."""
    nodes = found.nodes
    used = np.unique(np.concatenate([found.elements.ravel(), *map(np.ravel, found.sides.values())]))
    rows = [
        (8 if lines.shape[1] == 3 else 1, tag, line)
        for tag, lines in enumerate(found.sides.values(), start=1)
        for line in lines
    ]
    kind = GMSH_TYPES[found.elements.shape[1]]
    rows += [(kind, 9, element) for element in found.elements]
    names = [f'1 {tag} "{name}"' for tag, name in enumerate(found.sides, start=1)] + ['2 9 "soil"']
    head = f"$MeshFormat\n2.2 {int(binary)} 8\n".encode()
    if binary:
        head += struct.pack("<i", 1) + b"\n"
    head += b"$EndMeshFormat\n"
    if groups:
        head += f"$PhysicalNames\n{len(names)}\n{chr(10).join(names)}\n$EndPhysicalNames\n".encode()
    body = f"$Nodes\n{len(used)}\n".encode()
    for node in used:
        if binary:
            body += struct.pack("<i3d", node + 1, *nodes[node])
        else:
            body += "{} {!r} {!r} {!r}\n".format(node + 1, *map(float, nodes[node])).encode()
    body += b"\n$EndNodes\n" if binary else b"$EndNodes\n"
    body += f"$Elements\n{len(rows)}\n".encode()
    for number, (kind, group, members) in enumerate(rows, start=1):
        tags = (group if groups else 0, group)
        if binary:
            body += struct.pack("<3i", kind, 1, 2) + struct.pack("<3i", number, *tags)
            body += np.asarray(members + 1, "<i4").tobytes()
        else:
            words = (number, kind, 2, *tags, *(members + 1))
            body += (" ".join(map(str, words)) + "\n").encode()
    return head + body + (b"\n" if binary else b"") + b"$EndElements\n"


def gmsh_41(found: Specimen, *, save_all: bool = False) -> bytes:
    """An MSH 4.1 file in text; with `save_all` it holds a construction line and a lonely node."""
    curves = list(found.sides.items())
    lines = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$Comments", "by hand", "$EndComments"]
    names = [f'1 {tag} "{name}"' for tag, (name, _) in enumerate(curves, start=1)]
    lines += ["$PhysicalNames", str(len(names)), *names, "$EndPhysicalNames", "$Entities"]
    extra = int(save_all)
    lines.append(f"0 {len(curves) + extra} 1 0")
    for tag in range(1, len(curves) + 1 + extra):
        groups = f"1 {tag}" if tag <= len(curves) else "0"
        lines.append(f"{tag} 0 0 0 1 1 0 {groups} 0")
    lines += ["1 0 0 0 1 1 0 0 0", "$EndEntities", "$Nodes"]
    count = len(found.nodes) + 2 * extra
    lines += [f"1 {count} 1 {count}", f"2 1 0 {count}", *map(str, range(1, count + 1))]
    places = [*found.nodes, *[(5.0, 5.0, 1.0), (6.0, 6.0, 2.0)][: 2 * extra]]
    lines += [" ".join(repr(float(value)) for value in place) for place in places]
    lines += ["$EndNodes", "$Elements"]
    total = sum(map(len, found.sides.values())) + len(found.elements) + extra
    lines.append(f"{len(curves) + 1 + extra} {total} 1 {total}")
    number = 0
    blocks = [(1, tag, 8 if rows.shape[1] == 3 else 1, rows)
              for tag, (_, rows) in enumerate(curves, start=1)]  # fmt: skip
    if save_all:
        blocks.append((1, len(curves) + 1, 1, np.array([[count - 2, count - 1]])))
    blocks.append((2, 1, GMSH_TYPES[found.elements.shape[1]], found.elements))
    for dimension, tag, kind, rows in blocks:
        lines.append(f"{dimension} {tag} {kind} {len(rows)}")
        for row in rows:
            number += 1
            lines.append(" ".join(map(str, (number, *(row + 1)))))
    return ("\n".join([*lines, "$EndElements"]) + "\n").encode()


def abaqus(found: Specimen, kind: str, *, boundaries: str = "nset") -> str:
    """An input file as Abaqus/CAE writes it; boundaries as nset, surface or elset of trusses."""
    part = ["*Heading", "** a comment", "*Part, name=Soil", "*Node"]
    used = np.unique(found.elements)
    part += [
        f"{node + 1:7d}, {float(found.nodes[node, 0])!r}, {float(found.nodes[node, 1])!r}"
        for node in used
    ]
    part.append(f"*Element, type={kind}")
    part += [
        ", ".join(map(str, (number, *(element + 1))))
        for number, element in enumerate(found.elements, start=1)
    ]
    part += ["*Elset, elset=all, generate", f"1, {len(found.elements)}, 1"]
    if boundaries == "elset":
        number = 1000
        for name, lines in found.sides.items():
            part.append(f"*Element, type={ABAQUS_LINES[lines.shape[1]]}, elset={name}")
            for line in lines:
                number += 1
                part.append(", ".join(map(str, (number, *(line + 1)))))
    part.append("*End Part")
    assembly = ["*Assembly, name=Assembly", "*Instance, name=Soil-1, part=Soil", "*End Instance"]
    corners = 3 if found.elements.shape[1] in (3, 6) else 4
    for name, nodes in found.side_nodes.items():
        if boundaries == "nset":
            numbers = list(map(str, nodes[np.isin(nodes, used)] + 1))
            assembly.append(f"*Nset, nset={name}, instance=Soil-1")
            assembly += [", ".join(numbers[i : i + 16]) for i in range(0, len(numbers), 16)]
        elif boundaries == "surface":
            faces = []
            for side in range(1, corners + 1):
                ends = found.elements[:, [side - 1, side % corners]]
                on = np.flatnonzero(np.isin(ends, nodes).all(axis=1)) + 1
                if len(on):
                    label = f"_{name}_S{side}"
                    assembly.append(f"*Elset, elset={label}, internal, instance=Soil-1")
                    assembly.append(", ".join(map(str, on)))
                    faces.append(f"{label}, S{side}")
            assembly += [f"*Surface, type=ELEMENT, name={name}", *faces]
    assembly += ["*End Assembly", "*Material, name=Sand", "*Elastic", "2e7, 0.2"]
    return "\n".join([*part, *assembly]) + "\n"


def written(file: Path, content: bytes | str) -> Path:
    """The file with its content."""
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return file
