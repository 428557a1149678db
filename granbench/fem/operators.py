r"""Operators of a mesh: sparse matrices between nodes and Gauss points, built once.

    strain   d eps = B du                         (Eq 5.5)
    force    I = B^T W sigma                      (Eq 5.2)
    mass     M = rho int N N dA, lumped           (Eq 5.3)

A nodal vector holds x of all nodes, then y: (2 node,). A Gauss-point vector is component-major:
xx of all points, then yy, then the tensor shear xy: (3 point,). Displacements and forces follow
the axes; strain and stress are compression positive. That sign changes in `compression_positive`
and nowhere else: as B carries it, so does its transpose, and the virtual work
``sigma : d eps = I . du`` is the same in both.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import skfem
from scipy import sparse
from scipy.sparse import csr_array

from granbench.fem.mesh import Floats, PlaneMesh
from granbench.tensors import (
    COMPONENT_ORDERS,
    contraction_weights,
    normal_mask,
    volumetric_strain,
)

ORDER = "plane"
"""Component order of strain and stress in plane strain."""


def compression_positive(symmetric_gradient: Floats) -> Floats:
    """Strain of a displacement, compression positive, from its symmetric gradient.

    The one place where the sign of mechanics of materials becomes that of soil mechanics.
    """
    return -symmetric_gradient


@dataclass(frozen=True)
class Operators:
    """A mesh's matrices; per unit thickness.

    Parameters
    ----------
    mesh : the mesh
    strain : B, (3 point, 2 node), 1/m
    force : B^T W, (2 node, 3 point), m
    volumes : (point,), what each Gauss point integrates over, m2
    points : (point, direction), m
    element_strain : (element, 3 Gauss points, 2 local nodes), B of each element with rows in the
        order (Gauss point, component)
    element_force : (element, 2 local nodes, 3 Gauss points), its B^T W
    element_dofs : (element, 2 local nodes), places in nodal vectors
    element_volumes : (element, local node), share of each node in the element's area, m2
    """

    mesh: PlaneMesh
    strain: csr_array
    force: csr_array
    volumes: Floats
    points: Floats
    element_strain: Floats
    element_force: Floats
    element_dofs: np.ndarray
    element_volumes: Floats

    @property
    def node_count(self) -> int:
        """Number of nodes."""
        return len(self.mesh.nodes)

    @property
    def point_count(self) -> int:
        """Number of Gauss points."""
        return len(self.volumes)

    def lumped_mass(self, density: float) -> Floats:
        """Diagonal of the lumped mass matrix, (2 node,), kg/m.

        By scaling the diagonal of the consistent one to the element's mass (Hinton, Rock &
        Zienkiewicz 1976), positive for every element; row sums are negative at the corners of
        8-node quadrilaterals.
        """
        share = np.bincount(
            self.mesh.element_nodes.ravel(), self.element_volumes.ravel(), self.node_count
        )
        return density * np.tile(share, 2)

    def pressure_force(self, boundary: str) -> Floats:
        """Nodal forces of a unit pressure on a named boundary, (2 node,), m.

        A pressure pushes against the outward normal of the reference geometry (small strain).
        """
        return -self._boundary_force(boundary, lambda normal: normal)

    def traction_force(self, boundary: str, direction: tuple[float, float]) -> Floats:
        """Nodal forces of a traction in a fixed direction on a named boundary, (2 node,), m."""
        fixed = np.asarray(direction, dtype=float)[:, None, None]
        return self._boundary_force(boundary, lambda normal: np.broadcast_to(fixed, normal.shape))

    def _boundary_force(self, boundary: str, traction: Callable[[Floats], Floats]) -> Floats:
        basis = skfem.FacetBasis(
            self.mesh.geometry,
            self.mesh.kind.shape(),
            facets=self.mesh.facets_on(boundary),
            intorder=4,
        )
        field = traction(basis.normals)
        parts = [
            skfem.LinearForm(lambda v, w, part=part: part * v).assemble(basis) for part in field
        ]
        return np.concatenate(parts)

    def body_force(self, acceleration: tuple[float, float]) -> Floats:
        """Nodal forces of a unit density under an acceleration, (2 node,), m3/s2."""
        shape = skfem.LinearForm(lambda v, w: v).assemble(self.mesh.basis)
        return np.concatenate([component * shape for component in acceleration])

    def volumetric_strain(self, strain: Floats) -> float:
        """Mean volumetric strain of the body from strain (3, point), compression positive."""
        volumetric = volumetric_strain(strain.T, ORDER)
        return float(volumetric @ self.volumes / self.volumes.sum())


def build_operators(mesh: PlaneMesh, *, b_bar: bool = False) -> Operators:
    """The matrices of a mesh.

    Parameters
    ----------
    mesh : the mesh
    b_bar : take the volumetric strain of each element as its mean (Hughes 1980), against locking
        of fully integrated elements where the flow keeps its volume. 8-node quadrilaterals have
        2 x 2 points and need it less.
    """
    basis = mesh.basis
    gradients = np.stack([shape[0].grad for shape in basis.basis])  # (local, direction, el, gp)
    dx, dy = np.moveaxis(gradients, 0, -1)  # each (element, Gauss point, local)
    zero = np.zeros_like(dx)
    # What the displacements in x and in y give to each component; xy is the tensor shear.
    gradient = {"xx": (dx, zero), "yy": (zero, dy), "xy": (0.5 * dy, 0.5 * dx)}
    rows = [np.concatenate(gradient[label], axis=-1) for label in COMPONENT_ORDERS[ORDER]]
    local = np.stack(rows, axis=2)  # (element, Gauss point, component, 2 local)
    weights = basis.dx
    if b_bar:
        trace = volumetric_strain(np.moveaxis(local, 2, -1), ORDER)
        mean = np.einsum("eg,egl->el", weights, trace) / weights.sum(axis=1)[:, None]
        normal = np.array(normal_mask(ORDER))[:, None]
        local += 0.5 * (mean[:, None] - trace)[:, :, None] * normal
    local = compression_positive(local)
    elements, per_element, _, width = local.shape
    weighted = local * weights[:, :, None, None] * np.array(contraction_weights(ORDER))[:, None]
    dofs = np.concatenate([mesh.element_nodes, mesh.element_nodes + len(mesh.nodes)], axis=1)
    strain = _global(local, dofs, 2 * len(mesh.nodes))
    force = _compact(csr_array(_global(weighted, dofs, 2 * len(mesh.nodes)).T))
    flat = (elements, per_element * 3, width)
    return Operators(
        mesh=mesh,
        strain=strain,
        force=force,
        volumes=weights.ravel().copy(),
        points=np.asarray(basis.global_coordinates()).reshape(2, -1).T.copy(),
        element_strain=local.reshape(flat),
        element_force=np.ascontiguousarray(weighted.reshape(flat).transpose(0, 2, 1)),
        element_dofs=dofs,
        element_volumes=_node_shares(mesh),
    )


def _global(local: Floats, dofs: np.ndarray, columns: int) -> csr_array:
    """Rows (component, element, Gauss point) of the local ones; without the zeros in them."""
    elements, per_element, components, _ = local.shape
    count = elements * per_element
    row = (
        np.arange(count).reshape(elements, per_element, 1, 1)
        + count * np.arange(components)[:, None]
    )
    column = dofs[:, None, None, :]
    row, column = (np.broadcast_to(part, local.shape) for part in (row, column))
    kept = local != 0.0
    matrix = sparse.coo_array(
        (local[kept], (row[kept], column[kept])), shape=(components * count, columns)
    )
    return _compact(csr_array(matrix))


def _compact(matrix: csr_array) -> csr_array:
    """The matrix with 4-byte indices, which are faster to read."""
    parts = (matrix.data, matrix.indices.astype(np.int32), matrix.indptr.astype(np.int32))
    return csr_array(parts, shape=matrix.shape)


def _node_shares(mesh: PlaneMesh) -> Floats:
    """(element, local node): the element's area shared out as the consistent mass diagonal is."""
    order = 2 * mesh.kind.shape().maxdeg
    basis = skfem.CellBasis(mesh.geometry, mesh.kind.shape(), intorder=order)
    values = [np.broadcast_to(np.asarray(shape[0]), basis.dx.shape) for shape in basis.basis]
    diagonal = np.stack([(value**2 * basis.dx).sum(axis=1) for value in values], axis=1)
    area = basis.dx.sum(axis=1)
    return diagonal * (area / diagonal.sum(axis=1))[:, None]
