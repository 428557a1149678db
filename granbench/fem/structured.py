"""Structured meshes: rectangles with even or graded cells, and bodies that a map makes of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import skfem

from granbench.fem.mesh import ELEMENTS, REACH, Floats, PlaneMesh, Where


def grid(
    x: Floats,
    y: Floats,
    element: str = "quad8",
    boundaries: Mapping[str, Where] | None = None,
    *,
    mapped: Callable[[Floats, Floats], tuple[Floats, Floats]] | None = None,
) -> PlaneMesh:
    """A mesh of the cells between given lines; each is one quadrilateral or two triangles.

    Parameters
    ----------
    x, y : places of the lines, rising
    element : a key of `ELEMENTS`
    boundaries : name -> mask over the midpoints of boundary edges; by default the four sides
    mapped : from the corners' coordinates on these lines to those in the body, m
    """
    triangles = element in ELEMENTS and ELEMENTS[element].corners == 3
    kind = skfem.MeshTri if triangles else skfem.MeshQuad
    mesh = kind.init_tensor(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    if mapped is not None:
        mesh = kind(np.ascontiguousarray(np.stack(mapped(*mesh.p))), mesh.t)
    return PlaneMesh(
        mesh.with_boundaries(dict(boundaries or sides(x[0], x[-1], y[0], y[-1]))), element
    )


def rectangle(
    width: float, height: float, columns: int, rows: int, element: str = "quad8"
) -> PlaneMesh:
    """An even mesh of a rectangle from (0, 0), with boundaries left, right, bottom, top.

    Parameters
    ----------
    width, height : m
    columns, rows : number of cells
    element : a key of `ELEMENTS`
    """
    return grid(np.linspace(0.0, width, columns + 1), np.linspace(0.0, height, rows + 1), element)


def graded(length: float, count: int, growth: float) -> Floats:
    """Lines (count + 1,) from 0 to a length whose distances grow geometrically.

    Parameters
    ----------
    length : m
    count : of cells
    growth : last distance over the first
    """
    distances = growth ** np.linspace(0.0, 1.0, count)
    lines = np.concatenate([[0.0], np.cumsum(distances)])
    return length / lines[-1] * lines


def sides(left: float, right: float, bottom: float, top: float) -> dict[str, Where]:
    """Masks of the four sides of a rectangle, for `skfem.Mesh.with_boundaries`."""
    near = REACH * max(right - left, top - bottom)
    return {
        "left": lambda x: np.abs(x[0] - left) < near,
        "right": lambda x: np.abs(x[0] - right) < near,
        "bottom": lambda x: np.abs(x[1] - bottom) < near,
        "top": lambda x: np.abs(x[1] - top) < near,
    }
