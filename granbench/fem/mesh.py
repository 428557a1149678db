"""Plane meshes with named boundaries, and the finite elements on them.

Geometry and shape functions are scikit-fem's; here they get names, and a mesh whose elements are
inverted is refused. Coordinates are (x, y) in metres, y points up.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import skfem
from skfem.quadrature import get_quadrature

from granbench.errors import ConfigurationError

Floats = np.ndarray
Where = Callable[[Floats], Floats]
"""Function from coordinates (direction, ...) to a mask (...)."""

FLATTEST = 1e-6
"""Least Jacobian determinant in an element relative to its largest; below, it is degenerate."""

REACH = 1e-6
"""A named place is the node within this share of the mesh's extent."""


@dataclass(frozen=True)
class ElementKind:
    """A plane element.

    Parameters
    ----------
    shape : scikit-fem's shape functions
    corners : 3 or 4
    integration_order : for which scikit-fem gives the wanted Gauss points
    """

    shape: type[skfem.Element]
    corners: int
    integration_order: int


ELEMENTS: Mapping[str, ElementKind] = {
    "quad8": ElementKind(skfem.ElementQuadS2, 4, 3),  # 2 x 2 points: reduced integration
    "quad4": ElementKind(skfem.ElementQuad1, 4, 3),  # 2 x 2 points: full integration
    "tri3": ElementKind(skfem.ElementTriP1, 3, 1),  # 1 point
    "tri6": ElementKind(skfem.ElementTriP2, 3, 2),  # 3 points
}
"""Element kinds by the name that a user gives them."""


@dataclass(frozen=True)
class PlaneMesh:
    """A mesh, the kind of its elements, and its named boundaries.

    Parameters
    ----------
    geometry : scikit-fem's mesh of triangles or quadrilaterals, curved ones included; the names of
        its `boundaries` are those that supports and loads refer to
    element : a key of `ELEMENTS`
    notes : remarks on a mesh from a file, for the user

    Raises
    ------
    ConfigurationError
        If the element is unknown or does not fit the mesh, a coordinate is not finite, or an
        element is inverted or degenerate.
    """

    geometry: skfem.Mesh
    element: str = "quad8"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.element not in ELEMENTS:
            raise ConfigurationError(
                f"unknown element {self.element!r}; use one of {', '.join(ELEMENTS)}"
            )
        corners = self.geometry.refdom.nnodes
        if self.geometry.dim() != 2 or corners != self.kind.corners:
            fitting = [name for name, kind in ELEMENTS.items() if kind.corners == corners]
            raise ConfigurationError(
                f"the mesh has elements of {corners} corners, which cannot be {self.element}; use "
                f"{' or '.join(fitting) or 'a plane mesh of triangles or quadrilaterals'}"
            )
        lost = ~np.isfinite(self.geometry.p).all(axis=0)
        if lost.any():
            raise ConfigurationError(
                f"node {int(lost.argmax())} of the mesh has a coordinate that is not finite; "
                "correct it"
            )
        self._refuse_inverted()

    @classmethod
    def of_arrays(
        cls,
        nodes: Floats,
        corners: np.ndarray,
        boundaries: Mapping[str, Where],
        element: str | None = None,
    ) -> PlaneMesh:
        """A mesh of straight elements.

        Parameters
        ----------
        nodes : (node, direction), m
        corners : (element, 3 or 4), the elements' corners in order around them
        boundaries : name -> mask over the midpoints of boundary edges
        element : a key of `ELEMENTS`; by default the one with nodes on its edges
        """
        quadrilateral = corners.shape[1] == 4
        kind = skfem.MeshQuad if quadrilateral else skfem.MeshTri
        mesh = kind(
            np.ascontiguousarray(np.asarray(nodes, dtype=float).T),
            np.ascontiguousarray(np.asarray(corners).T),
        )
        mesh = mesh.with_boundaries(dict(boundaries))
        return cls(mesh, element or ("quad8" if quadrilateral else "tri6"))

    @property
    def kind(self) -> ElementKind:
        """The element's shape functions and integration."""
        return ELEMENTS[self.element]

    @cached_property
    def basis(self) -> skfem.CellBasis:
        """Scalar shape functions at the Gauss points."""
        return skfem.CellBasis(
            self.geometry, self.kind.shape(), intorder=self.kind.integration_order
        )

    @cached_property
    def nodes(self) -> Floats:
        """(node, direction), m; those on edges included."""
        return self.basis.doflocs.T.copy()

    @property
    def element_nodes(self) -> np.ndarray:
        """(element, local node): corners first, then the edges' nodes."""
        return self.basis.element_dofs.T

    @cached_property
    def area(self) -> float:
        """Area of the body, m2."""
        return float(self.basis.dx.sum())

    def edge_length(self, facets: np.ndarray) -> float:
        """Length of some edges from corner to corner, m."""
        start, end = self.geometry.p[:, self.geometry.facets[:2, facets]].transpose(1, 0, 2)
        return float(np.hypot(*(end - start)).sum())

    @cached_property
    def outline(self) -> np.ndarray:
        """Edges that belong to one element alone."""
        return np.asarray(self.geometry.boundary_facets())

    @property
    def boundary_names(self) -> tuple[str, ...]:
        """Names that supports and loads may refer to."""
        return tuple(self.geometry.boundaries or ())

    def facets_on(self, boundary: str) -> np.ndarray:
        """Edges of a named boundary.

        Raises
        ------
        ConfigurationError
            If there is no such boundary, or it has no edges.
        """
        facets = (self.geometry.boundaries or {}).get(boundary)
        if facets is None:
            raise ConfigurationError(
                f"the mesh has no boundary {boundary!r}; there are "
                f"{', '.join(self.boundary_names) or 'none'}"
            )
        if len(facets) == 0:
            raise ConfigurationError(
                f"boundary {boundary!r} has no edges in this mesh; refine the mesh or correct the "
                "boundary"
            )
        return np.asarray(facets)

    def nodes_on(self, boundary: str) -> np.ndarray:
        """Nodes of a named boundary, those on edges included; raises as `facets_on`."""
        return self.basis.get_dofs(self.facets_on(boundary)).flatten()

    def node_at(self, x: float, y: float) -> int:
        """The node at a place.

        Raises
        ------
        ConfigurationError
            If there is none.
        """
        distance = np.hypot(*(self.nodes - (x, y)).T)
        nearest = int(distance.argmin())
        if distance[nearest] > REACH * np.ptp(self.nodes, axis=0).max():
            found = self.nodes[nearest]
            raise ConfigurationError(
                f"no node lies at ({x:g}, {y:g}); the nearest is at ({found[0]:g}, {found[1]:g})"
            )
        return nearest

    @cached_property
    def characteristic_length(self) -> float:
        """L of Eq 5.8, m: the shortest distance between two nodes of one element."""
        corners = self.nodes[self.element_nodes]
        distance = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=-1)
        first, second = np.triu_indices(distance.shape[1], 1)
        return float(distance[:, first, second].min())

    def turned(self, displacement: Floats) -> Floats:
        """Elements that a displacement turns over at one of their corners, or makes flat there.

        Parameters
        ----------
        displacement : (node, direction), m

        Returns
        -------
        (element,), whether the Jacobian of its corners has another sign than in the mesh
        """
        turns = self._corner_jacobians(self.nodes + displacement) * self._jacobians_at_rest
        return np.asarray((turns <= 0.0).any(axis=1))

    @cached_property
    def _corners(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Each element's corners, those before and those after them, (element, corner)."""
        corners = self.element_nodes[:, : self.kind.corners]
        return corners, np.roll(corners, 1, axis=1), np.roll(corners, -1, axis=1)

    @cached_property
    def _jacobians_at_rest(self) -> Floats:
        return self._corner_jacobians(self.nodes)

    def _corner_jacobians(self, nodes: Floats) -> Floats:
        """Cross products of the two edges that meet at each corner, (element, corner), m2."""
        here, before, after = self._corners
        x, y = np.ascontiguousarray(nodes.T)
        came_x, came_y = x[here] - x[before], y[here] - y[before]
        goes_x, goes_y = x[after] - x[here], y[after] - y[here]
        return np.asarray(came_x * goes_y - came_y * goes_x)

    def _refuse_inverted(self) -> None:
        """Raise for the worst element that is turned inside out, flat, or folded over another."""
        determinant = self._determinants()
        size = np.abs(determinant).max(axis=1)
        typical = np.median(size) or size.max() or 1.0
        least = np.where(
            determinant[:, 0] < 0.0, (-determinant).min(axis=1), determinant.min(axis=1)
        )
        margin = least / np.maximum(size, FLATTEST * typical)
        if (bad := margin < FLATTEST).any():
            worst = int(np.argmin(margin))
            raise self._inverted(worst, int(bad.sum()), "inverted or flat")
        folds = self._folds()
        if folds.any():
            raise self._inverted(int(folds.argmax()), int((folds > 0).sum()), "folded over another")

    def _determinants(self) -> Floats:
        """Jacobian determinants at Gauss points and corners, (element, place); may be zero."""
        shape = self.geometry.refdom
        at_points, _ = get_quadrature(shape, self.kind.integration_order)
        places = np.hstack([at_points, shape.p])
        mapping = self.geometry.mapping()
        if isinstance(mapping, skfem.MappingIsoparametric):  # whose own method raises at a zero
            (a, b), (c, d) = [[mapping.J(i, j, places) for j in (0, 1)] for i in (0, 1)]
            return np.asarray(a * d - b * c)
        with np.errstate(divide="ignore", invalid="ignore"):  # a triangle's is inverted at once
            return np.asarray(mapping.detDF(places))

    def _folds(self) -> np.ndarray:
        """Number of edges of each element whose neighbour lies on the element's own side."""
        mesh = self.geometry
        inner = mesh.f2t[1] >= 0
        start, end = mesh.p[:, mesh.facets[0, inner]], mesh.p[:, mesh.facets[1, inner]]
        centres = mesh.p[:, mesh.t[: self.kind.corners]].mean(axis=1)
        sides = [
            (end[0] - start[0]) * (centres[1, of] - start[1])
            - (end[1] - start[1]) * (centres[0, of] - start[0])
            for of in mesh.f2t[:, inner]
        ]
        folded = sides[0] * sides[1] > 0.0
        return np.bincount(mesh.f2t[:, inner][:, folded].ravel(), minlength=mesh.t.shape[1])

    def _inverted(self, element: int, count: int, how: str) -> ConfigurationError:
        x, y = self.geometry.p[:, self.geometry.t[: self.kind.corners, element]].mean(axis=1)
        more = f", and {count - 1} more are" if count > 1 else ""
        return ConfigurationError(
            f"element {element} of the mesh, with its centre at ({x:g}, {y:g}), is {how}{more}; "
            "correct the mesh"
        )
