"""Meshes from files of mesh generators, with the boundaries that they name."""

from __future__ import annotations

import contextlib
import io
import logging
from collections.abc import Mapping
from pathlib import Path

import meshio
import skfem
from skfem.io.meshio import from_meshio

from granbench.errors import ConfigurationError
from granbench.fem.mesh import ELEMENTS, PlaneMesh

SUFFIXES = (".msh", ".inp", ".vtk", ".vtu", ".xdmf", ".med", ".mesh")
"""Of the formats that are read; boundary names come with Gmsh's and Abaqus' files."""

DEFAULT_ELEMENTS: Mapping[str, str] = {
    "quad": "quad8",
    "quad9": "quad8",
    "triangle": "tri6",
    "triangle6": "tri6",
}
"""meshio's cells and the element that they become. With `quad9` and `triangle6` edges may curve."""


def is_mesh_file(name: str) -> bool:
    """Whether a name is that of a file and not of one of a problem's meshes."""
    return Path(name).suffix.lower() in SUFFIXES


def read_mesh(file: Path | str, element: str | None = None) -> PlaneMesh:
    """A plane mesh from a file that meshio reads.

    Parameters
    ----------
    file : coordinates in m, x to the right and y up; a third one is left out. Boundaries are named
        groups of edges: Gmsh's physical curves, Abaqus' element sets of lines
    element : a key of `granbench.fem.mesh.ELEMENTS`; by default one with nodes on its edges

    Raises
    ------
    ConfigurationError
        Naming the file: it is missing or no mesh, it holds no plane elements or several kinds, it
        names no boundary, or an element is inverted.
    """
    path = Path(file)
    if not path.is_file():
        raise ConfigurationError(f"mesh {path}: there is no such file; check the name")
    if element is not None and element not in ELEMENTS:
        raise ConfigurationError(f"unknown element {element!r}; there are {', '.join(ELEMENTS)}")
    found = _read(path)
    kinds = sorted({block.type for block in found.cells if block.dim == 2})
    if len(kinds) != 1 or kinds[0] not in DEFAULT_ELEMENTS:
        raise ConfigurationError(
            f"mesh {path}: its plane cells are {', '.join(kinds) or 'none'}; give cells of one "
            f"kind: {', '.join(DEFAULT_ELEMENTS)}"
        )
    geometry = _geometry(path, found)
    if not geometry.boundaries:
        raise ConfigurationError(
            f"mesh {path}: names no boundary; name groups of its edges (physical curves in Gmsh)"
        )
    try:
        return PlaneMesh(geometry, element or DEFAULT_ELEMENTS[kinds[0]])
    except ConfigurationError as error:
        raise ConfigurationError(f"mesh {path}: {error}") from error


def _read(path: Path) -> meshio.Mesh:
    """What meshio makes of a file; its readers raise whatever a broken file leads them to."""
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # some of its readers print blank lines
            return meshio.read(path)
    except OSError as error:
        raise ConfigurationError(f"mesh {path}: cannot be read ({error.strerror})") from error
    except (Exception, SystemExit) as error:
        raise ConfigurationError(
            f"mesh {path}: is no mesh that can be read ({str(error) or type(error).__name__}); "
            f"give a file of one of the formats {', '.join(SUFFIXES)}"
        ) from error


def _geometry(path: Path, found: meshio.Mesh) -> skfem.Mesh:
    """scikit-fem's mesh, with named boundaries only; what it says in a log is ours to say."""
    log = logging.getLogger("skfem")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        mesh = from_meshio(found)
    except Exception as error:
        raise ConfigurationError(
            f"mesh {path}: its cells do not make a mesh ({error}); mend it or write it again"
        ) from error
    finally:
        log.setLevel(level)
    return mesh
