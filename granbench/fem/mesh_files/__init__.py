"""Meshes from files of mesh generators, as plane elements with named edges.

Everything here runs without torch and scikit-fem, in the process that reads files from outside.
"""

from granbench.fem.mesh_files.cells import PlaneCells
from granbench.fem.mesh_files.reading import FORMATS, read_plane_cells

__all__ = ["FORMATS", "PlaneCells", "read_plane_cells"]
