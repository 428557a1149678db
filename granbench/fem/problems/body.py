"""Whether a mesh from a file is of a problem's body, and which of its edges are which boundary.

Lengths, heights and supports of a problem are those of its own body, so a mesh of another body
would give a meaningless analysis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from granbench.errors import ConfigurationError
from granbench.fem.mesh import Floats, PlaneMesh

SAME_PLACE = 1e-3
"""Tolerance on the position of an outline or boundary, as a share of the body's extent."""
SAME_SIZE = 0.01
"""Relative tolerance on areas and lengths: polygons approximate curved edges."""


def with_boundaries_of(mesh: PlaneMesh, own: PlaneMesh) -> PlaneMesh:
    """The mesh with the boundary names of the problem's own one.

    Names are compared without regard to upper and lower case. Where a file names none of the
    boundaries, they are found by their place, and a note is added.

    Parameters
    ----------
    mesh : from a file
    own : the problem's, fine enough to stand for its body

    Raises
    ------
    ConfigurationError
        If the file names none of them and one cannot be found by its place.
    """
    wanted = own.boundary_names
    spelled: dict[str, str] = {}
    for name in mesh.boundary_names:
        spelled.setdefault(name.lower(), name)
    renamed = {
        name: spelled[name]
        for name in wanted
        if name not in mesh.boundary_names and name in spelled
    }
    if renamed:
        facets = {name: mesh.facets_on(other) for name, other in renamed.items()}
        return replace(mesh, geometry=mesh.geometry.with_boundaries(facets))
    if any(name in mesh.boundary_names for name in wanted):
        return mesh
    facets = {name: _facets_along(mesh, own, name) for name in wanted}
    for name, found in facets.items():
        if not len(found):
            raise ConfigurationError(
                f"it names no boundary of the problem, and none of its edges lies along {name!r}, "
                f"which spans {_span_text(own.nodes[own.nodes_on(name)])}; name groups of its "
                "edges, as physical curves in Gmsh"
            )
    listed = ", ".join(mesh.boundary_names[:4])
    note = (
        f"it names no boundary of the problem{f', but {listed}' if listed else ''}; "
        f"{', '.join(wanted)} are found by their place"
    )
    geometry = mesh.geometry.with_boundaries(facets)
    return replace(mesh, geometry=geometry, notes=(*mesh.notes, note))


def _facets_along(mesh: PlaneMesh, own: PlaneMesh, name: str) -> np.ndarray:
    """Edges of the outline that lie along a boundary of the problem's own mesh."""
    close = SAME_PLACE * np.ptp(own.nodes, axis=0).max()
    geometry = own.geometry
    ends = geometry.p[:, geometry.facets[:2, own.facets_on(name)]]
    corners = mesh.geometry.p[:, mesh.geometry.facets[:2, mesh.outline]]
    # The middle as well: an edge across a corner of the body is along neither of its sides.
    places = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1)
    apart = np.stack([_distance(place, ends) for place in places.transpose(1, 0, 2)])
    sagging = 0.1 * np.hypot(*(corners[:, 1] - corners[:, 0]))
    along = (apart[:2] <= close).all(axis=0) & (apart[2] <= close + sagging)
    return np.asarray(mesh.outline[along])


def _distance(points: Floats, ends: Floats) -> Floats:
    """Least distance (point,) of points (2, point) from segments with ends (2, 2, segment), m."""
    start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    offset = points[:, :, None] - start[:, None]
    share = np.clip((offset * along[:, None]).sum(axis=0) / (along**2).sum(axis=0), 0.0, 1.0)
    return np.asarray(np.hypot(*(offset - share * along[:, None])).min(axis=1))


def require_body(mesh: PlaneMesh, own: PlaneMesh, boundaries: Sequence[str] = ()) -> None:
    """Refuse a mesh of another body than the problem's own.

    Parameters
    ----------
    mesh : from a file
    own : the problem's, fine enough to stand for its body
    boundaries : those that the problem holds, moves or loads

    Raises
    ------
    ConfigurationError
        If it, or a boundary of it, does not span what the problem's own mesh spans, or differs
        from it in area or length, as one with a gap in a boundary or a slit does.
    """
    close = SAME_PLACE * np.ptp(own.nodes, axis=0).max()
    parts = {"the body": (mesh.nodes, own.nodes)}
    for name in boundaries:
        there = mesh.nodes[mesh.nodes_on(name)], own.nodes[own.nodes_on(name)]
        parts[f"its boundary {name!r}"] = there
    for name, (found, wanted) in parts.items():
        if np.abs(_span(found) - _span(wanted)).max() > close:
            raise ConfigurationError(
                f"{name} spans {_span_text(found)}, but the problem's {_span_text(wanted)}; scale "
                "or move the mesh, or correct its boundary names"
            )
    sizes = {
        "an area of {:.4g} m2": (mesh.area, own.area, "leave no holes and no elements twice"),
        "an outline of {:.4g} m": (
            mesh.edge_length(mesh.outline), own.edge_length(own.outline),
            "join elements along all of their edges",
        ),
    }  # fmt: skip
    for name in boundaries:
        lengths = (item.edge_length(item.facets_on(name)) for item in (mesh, own))
        label = f"{{:.4g}} m of boundary {name!r}"
        sizes[label] = (*lengths, "name all edges along it, and no others")  # type: ignore[assignment]
    for what, (size, right, remedy) in sizes.items():
        if abs(size - right) > SAME_SIZE * right:
            raise ConfigurationError(
                f"the mesh has {what.format(size)}, but the problem's own {right:.4g}; {remedy}"
            )


def _span(nodes: Floats) -> Floats:
    return np.stack([nodes.min(axis=0), nodes.max(axis=0)])


def _span_text(nodes: Floats) -> str:
    (left, bottom), (right, top) = _span(nodes)
    return f"x from {left:g} to {right:g} m and y from {bottom:g} to {top:g} m"
