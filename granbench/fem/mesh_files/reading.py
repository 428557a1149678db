"""Reads a mesh file into plane elements, in a separate process for files from outside."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Mapping
from pathlib import Path

import meshio
import numpy as np

from granbench.errors import ConfigurationError
from granbench.fem.mesh_files.abaqus import read_abaqus
from granbench.fem.mesh_files.cells import PlaneCells, plane_cells
from granbench.fem.mesh_files.contents import ElementBlock, MeshContents
from granbench.fem.mesh_files.gmsh import read_gmsh

MESHIO_CELLS: Mapping[str, int] = {
    "triangle": 3, "triangle6": 6, "triangle7": 6, "quad": 4, "quad8": 8, "quad9": 9
}  # fmt: skip
"""Plane cells of meshio, and the number of their nodes in use: corners, then edges."""
SOLID_CELLS = ("tetra", "hexahedron", "wedge", "pyramid", "polyhedron")


def read_plane_cells(path: str) -> PlaneCells:
    """The plane elements of a mesh file of one of the `FORMATS`.

    Raises
    ------
    ConfigurationError
        Naming the file, what is wrong with it, and the remedy.
    """
    file = Path(path)
    try:
        return plane_cells(FORMATS[file.suffix.lower()](file))
    except ConfigurationError as error:
        raise ConfigurationError(f"mesh {path}: {error}") from error


def _read_vtk(path: Path) -> MeshContents:
    return _of_meshio(path, meshio.vtk.read)


def _read_vtu(path: Path) -> MeshContents:
    return _of_meshio(path, meshio.vtu.read)


def _read_medit(path: Path) -> MeshContents:
    return _of_meshio(path, meshio.medit.read)


def _of_meshio(path: Path, read: Callable[[str], meshio.Mesh]) -> MeshContents:
    """The mesh that meshio reads; if it finds none, the user sees meshio's message."""
    printed = io.StringIO()
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            found = read(str(path))
    except MemoryError:
        raise
    except (Exception, SystemExit) as error:
        words = " ".join(f"{printed.getvalue()} {error}".split())[:200]
        raise ConfigurationError(
            f"is no {path.suffix} file that meshio reads ({type(error).__name__}: "
            f"{words or 'without a reason'}); write it as .msh, with Gmsh or `meshio convert`"
        ) from error
    blocks = []
    for block in found.cells:
        if block.type in MESHIO_CELLS:
            nodes = np.asarray(block.data)[:, : MESHIO_CELLS[block.type]].astype(np.int64)
            if len(nodes) and not 0 <= nodes.min() <= nodes.max() < len(found.points):
                raise ConfigurationError(
                    "has an element at a node that is not in the file; write it again"
                )
            blocks.append(ElementBlock(block.type, nodes))
        elif block.type.startswith(SOLID_CELLS):
            raise ConfigurationError("has three-dimensional elements; mesh the plane section alone")
    nodes = np.asarray(found.points, dtype=float)
    if nodes.ndim != 2 or nodes.shape[1] not in (2, 3):
        raise ConfigurationError("has nodes without x and y; write it again")
    return MeshContents(nodes, tuple(blocks))


FORMATS: Mapping[str, Callable[[Path], MeshContents]] = {
    ".msh": read_gmsh,
    ".inp": read_abaqus,
    ".vtk": _read_vtk,
    ".vtu": _read_vtu,
    ".mesh": _read_medit,
}
"""Readers by the ending of the file's name. Boundaries have names in the first two."""
