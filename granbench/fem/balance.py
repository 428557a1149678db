"""Forces of a displacement increment: their imbalance, and the tangent stiffness."""

from __future__ import annotations

import numpy as np

from granbench.fem.gauss_points import GaussPoints
from granbench.fem.mesh import Floats
from granbench.fem.operators import Operators
from granbench.fem.stiffness import StiffnessPattern


class Balance:
    """The forces of an increment from the kept state.

    Parameters
    ----------
    operators : of the mesh
    points : the material
    free : places of the free displacements

    Attributes
    ----------
    external, internal : (2 node,), forces to balance, and those of the last stress, N/m
    """

    def __init__(self, operators: Operators, points: GaussPoints, free: np.ndarray) -> None:
        self.operators, self.points, self.free = operators, points, free
        self.pattern = StiffnessPattern(operators, free)
        self.external = self.internal = np.zeros(2 * operators.node_count)
        self.scale, self.reference, self.step = 0.0, 0.0, 0

    def aim_at(self, external: Floats, step: int) -> None:
        """Set the external forces to be balanced, and the number of the load step.

        Residuals are relative to the largest nodal forces of what was kept, and of the first
        increment that is tried; if those of every trial counted, one that is far out would make
        the next ones look balanced.
        """
        self.external, self.step, self.reference = external, step, 0.0

    def keep(self) -> None:
        """Take the forces of the last answer into the reference of residuals, for good."""
        self.scale = self._largest()

    def _largest(self) -> float:
        sizes = (float(np.linalg.norm(force)) for force in (self.internal, self.external))
        return max(self.scale, *sizes)

    def residual(self, increment: Floats) -> tuple[Floats, float]:
        """Forces out of balance at the free displacements, and their size over the reference."""
        stress = self.points.step(self.operators.strain @ increment, self.step)
        return self._unbalanced(stress)

    def linearised(self, increment: Floats) -> tuple[Floats, float, Floats]:
        """The same as `residual`, with the tangent (point, 3, 3), Pa."""
        strain = self.operators.strain @ increment
        stress, tangent = self.points.tangent(strain, self.step)
        return (*self._unbalanced(stress), tangent)

    def initial_stiffness(self) -> Floats:
        """Tangent (point, 3, 3), Pa, of a zero increment from the kept state."""
        return self.points.tangent(np.zeros_like(self.points.strain), self.step)[1]

    def _unbalanced(self, stress: Floats) -> tuple[Floats, float]:
        self.internal = self.operators.force @ stress
        self.reference = self.reference or self._largest() or 1.0
        rest = (self.external - self.internal)[self.free]
        return rest, float(np.linalg.norm(rest)) / self.reference

    def moved(self, increment: Floats, correction: Floats) -> Floats:
        """An increment with its free displacements corrected."""
        increment = increment.copy()
        increment[self.free] += correction
        return increment
