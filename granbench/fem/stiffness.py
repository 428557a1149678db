"""The stiffness matrix of the free displacements: its pattern once, its values on request."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from granbench.fem.mesh import Floats
from granbench.fem.operators import Operators

Solve = Callable[[Floats], Floats]
"""Function from forces (free,) to displacements (free,)."""


class StiffnessPattern:
    """Sparsity pattern of the stiffness, and the places of element stiffnesses in it.

    Parameters
    ----------
    operators : of the mesh
    free : places of the free displacements in nodal vectors
    """

    def __init__(self, operators: Operators, free: np.ndarray) -> None:
        self.operators, self.size = operators, len(free)
        place = np.full(2 * operators.node_count, -1)
        place[free] = np.arange(self.size)
        of_elements = place[operators.element_dofs]
        row, column = (
            np.broadcast_to(of_elements[:, :, None], (*of_elements.shape, of_elements.shape[1])),
            np.broadcast_to(of_elements[:, None], (*of_elements.shape, of_elements.shape[1])),
        )
        self._kept = np.flatnonzero((row.ravel() >= 0) & (column.ravel() >= 0))
        key = column.ravel()[self._kept].astype(np.int64) * self.size + row.ravel()[self._kept]
        entries, self._entry = np.unique(key, return_inverse=True)
        self._rows = (entries % self.size).astype(np.int32)
        starts = np.searchsorted(entries // self.size, np.arange(self.size + 1))
        self._starts = starts.astype(np.int32)

    def matrix(self, tangent: Floats) -> csc_array:
        """K = B^T W C B of the free displacements, N/m2, from a tangent (point, 3, 3), Pa."""
        operators = self.operators
        elements, _, width = operators.element_strain.shape
        strain = operators.element_strain.reshape(-1, 3, width)
        stress = (tangent @ strain).reshape(elements, -1, width)
        local = (operators.element_force @ stress).ravel()[self._kept]
        data = np.bincount(self._entry, local, len(self._rows))
        return csc_array((data, self._rows, self._starts), shape=(self.size, self.size))

    def factorised(self, tangent: Floats) -> Solve | None:
        """Solver of K x = f; None if K is singular or not finite."""
        matrix = self.matrix(tangent)
        if not np.isfinite(matrix.data.sum()):
            return None
        # The pattern is symmetric and pivots stay near the diagonal: half the time of COLAMD.
        try:
            factors = splu(
                matrix,
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.01,
                options={"SymmetricMode": True},
            )
        except RuntimeError:
            return None
        return factors.solve
