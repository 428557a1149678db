"""Meshes from files of mesh generators, with the boundaries that they name."""

from __future__ import annotations

import stat
from pathlib import Path

import numpy as np
import skfem

from granbench.errors import ConfigurationError
from granbench.fem.mesh import ELEMENTS, PlaneMesh
from granbench.fem.mesh_files import FORMATS, PlaneCells, read_plane_cells
from granbench.files.bounded_reading import read_bounded

SUFFIXES = tuple(FORMATS)

LARGEST_FILE = 200 * 2**20
"""Bytes; several times the size of the largest mesh that can be analysed."""

DEFAULT_ELEMENTS = {3: "tri6", 4: "quad8"}
"""Elements by their number of corners: those with nodes on their edges."""

OTHER_PROGRAMS = (
    ".xdmf", ".xmf", ".med", ".unv", ".bdf", ".nas", ".dat", ".g", ".e", ".exo", ".cdb", ".su2",
    ".ply", ".stl", ".vtp", ".vtm", ".geo", ".step", ".stp", ".iges", ".cas", ".f3grid", ".h5",
    ".xml", ".k", ".obj", ".off", ".ugrid", ".cgns", ".dxf", ".post", ".fem", ".neu", ".p3d",
)  # fmt: skip
"""Endings of other mesh and geometry files; they are recognised, to say what to do with them."""


def is_mesh_file(name: str) -> bool:
    """Whether a name is that of a file and not of one of a problem's meshes."""
    path = Path(name)
    return path.suffix.lower() in (*SUFFIXES, *OTHER_PROGRAMS) or len(path.parts) > 1


def read_mesh(file: Path | str, element: str | None = None) -> PlaneMesh:
    """A plane mesh from a file of Gmsh (.msh), Abaqus (.inp), VTK (.vtk, .vtu) or Medit (.mesh).

    Elements of first and second order become elements with nodes on their edges, whose sides are
    curved where the file's are. The mesh's `notes` say what was changed.

    Parameters
    ----------
    file : coordinates in m, x to the right and y up. Boundaries are named groups of edges: Gmsh's
        physical curves, Abaqus' node sets, surfaces, and element sets of lines
    element : a key of `granbench.fem.mesh.ELEMENTS`; by default one with nodes on its edges

    Raises
    ------
    ConfigurationError
        Naming the file: it is missing, too large or damaged, of another format, without plane
        elements, or has an inverted one.
    """
    path = Path(file)
    _require_file(path)
    if element is not None and element not in ELEMENTS:
        raise ConfigurationError(f"unknown element {element!r}; there are {', '.join(ELEMENTS)}")
    cells = read_bounded(path, ConfigurationError, read_plane_cells, str(path))
    try:
        return _built(cells, element or DEFAULT_ELEMENTS[cells.corners.shape[1]])
    except ConfigurationError as error:
        raise ConfigurationError(f"mesh {path}: {error}") from error


def _require_file(path: Path) -> None:
    """Refuse a file of an unknown format before it is opened."""
    if path.suffix.lower() not in SUFFIXES:
        raise ConfigurationError(
            f"mesh {path}: {path.suffix or 'a file without an ending'} is not read; write it as "
            f"one of {', '.join(SUFFIXES)} (Gmsh opens most formats and saves .msh)"
        )
    try:
        found = path.stat()
    except (OSError, ValueError) as error:
        missing = isinstance(error, FileNotFoundError | NotADirectoryError)
        reason = "there is no such file" if missing else getattr(error, "strerror", None) or error
        raise ConfigurationError(f"mesh {path}: {reason}; check the name") from error
    if not stat.S_ISREG(found.st_mode):
        raise ConfigurationError(f"mesh {path}: is not a regular file; give a file of a mesh")
    if found.st_size > LARGEST_FILE:
        raise ConfigurationError(
            f"mesh {path}: has {found.st_size / 2**20:.0f} MiB, more than the {LARGEST_FILE >> 20} "
            "MiB that are read; give a coarser mesh"
        )


def _built(cells: PlaneCells, element: str) -> PlaneMesh:
    """scikit-fem's mesh of the cells."""
    kind, curved = (
        (skfem.MeshTri, skfem.MeshTri2)
        if cells.corners.shape[1] == 3
        else (skfem.MeshQuad, skfem.MeshQuad2)
    )
    geometry = kind(np.ascontiguousarray(cells.nodes.T), np.ascontiguousarray(cells.corners.T))
    notes = cells.notes
    facets = {name: _facets(geometry, pairs) for name, pairs in cells.boundaries.items()}
    if cells.middles is not None:
        geometry = _curved(geometry, curved, cells)
        if ELEMENTS[element].shape in (skfem.ElementQuad1, skfem.ElementTriP1):
            notes = (*notes, f"its edges are curved, which {element} follows only in its area")
    if facets:
        geometry = geometry.with_boundaries(facets)
    return PlaneMesh(geometry, element, notes)


def _facets(geometry: skfem.Mesh, pairs: np.ndarray) -> np.ndarray:
    """Numbers of the edges between pairs of nodes."""
    count = geometry.p.shape[1]
    keys = geometry.facets[0].astype(np.int64) * count + geometry.facets[1]
    order = np.argsort(keys)
    wanted = pairs.min(axis=1).astype(np.int64) * count + pairs.max(axis=1)
    return np.asarray(order[np.searchsorted(keys[order], wanted)])


def _curved(geometry: skfem.Mesh, kind: type[skfem.Mesh], cells: PlaneCells) -> skfem.Mesh:
    """The mesh with its edges through their middles.

    The middle of a quadrilateral is where the shape functions of 8 nodes put it, so that
    displacements that are linear in x and y stay within what its element can take.
    """
    assert cells.middles is not None
    mesh = kind.from_mesh(geometry)
    places = mesh.doflocs.copy()
    pairs = np.stack([cells.corners, np.roll(cells.corners, -1, axis=1)], axis=-1).reshape(-1, 2)
    facets = _facets(mesh, pairs)
    places[:, mesh.dofs.facet_dofs[0, facets]] = cells.middles.reshape(-1, 2).T
    if cells.corners.shape[1] == 4:
        corner_mean = cells.nodes[cells.corners].mean(axis=1)
        centre = 2.0 * cells.middles.mean(axis=1) - corner_mean
        places[:, mesh.dofs.interior_dofs[0]] = centre.T
    return kind(places, mesh.t)
