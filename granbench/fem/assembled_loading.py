"""A loading as nodal vectors of one mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import splu

from granbench.errors import ConfigurationError
from granbench.fem.loading import Loading, Pressure
from granbench.fem.mesh import Floats
from granbench.fem.operators import Operators

EXACT = 1e-10
"""Relative: rounding of coordinates, and less than any motion that is meant."""


@dataclass(frozen=True)
class AssembledLoading:
    """A loading as nodal vectors.

    Parameters
    ----------
    loading : that the vectors are made from
    fixed : (2 node,), whether the displacement is prescribed
    unit : (2 node,), prescribed displacement for a unit of the driving one; zero elsewhere
    spread : (2 node,), the same, spread over the body, see `spread_motion`
    force_vectors : (force, 2 node), nodal forces of each force's unit value, m
    weight : (2 node,), nodal forces of gravity, N/m
    """

    loading: Loading
    fixed: Floats
    unit: Floats
    spread: Floats
    force_vectors: Floats
    weight: Floats

    @property
    def free_places(self) -> np.ndarray:
        """Places of the displacements that are not prescribed."""
        return np.flatnonzero(~self.fixed)

    def force_values(self, time: float | Floats) -> Floats:
        """Values of the forces at times, (..., force), Pa."""
        forces = self.loading.forces
        values = [force.history.at(time) for force in forces]
        return np.stack(values, axis=-1) if values else np.zeros((*np.shape(time), 0))

    def external_force(self, values: Floats) -> Floats:
        """Nodal forces (2 node,) of forces with these values, and weight, N/m."""
        return values @ self.force_vectors + self.weight

    def reaction(self, internal: Floats, external: Floats) -> float:
        """Force conjugate to the driving displacement, N/m, from nodal forces (2 node,)."""
        return float(self.unit @ (internal - external))


def assemble_loading(loading: Loading, operators: Operators, density: float) -> AssembledLoading:
    """Nodal vectors of a loading.

    Parameters
    ----------
    loading : prescribed motions, forces and weight
    operators : of the mesh
    density : kg/m3, of the weight

    Raises
    ------
    ConfigurationError
        If two prescribed motions contradict each other, or leave the body free to move.
    """
    mesh, count = operators.mesh, operators.node_count
    unit, fixed = np.zeros(2 * count), np.zeros(2 * count, dtype=bool)
    for motion in loading.prescribed:
        where = motion.where
        nodes = mesh.nodes_on(where) if isinstance(where, str) else [mesh.node_at(*where)]
        for direction, value in enumerate((motion.x, motion.y)):
            if value is None:
                continue
            places = np.asarray(nodes) + direction * count
            wanted = value(mesh.nodes[nodes]) if callable(value) else np.full(len(places), value)
            clash = fixed[places] & (unit[places] != wanted)
            if clash.any():
                x, y = mesh.nodes[np.asarray(nodes)[clash.argmax()]]
                raise ConfigurationError(
                    f"two motions are prescribed to the node at ({x:g}, {y:g}) in direction "
                    f"{'xy'[direction]}; leave one of them out"
                )
            unit[places], fixed[places] = wanted, True
    forces = [
        operators.pressure_force(force.boundary)
        if isinstance(force, Pressure)
        else operators.traction_force(force.boundary, force.direction)
        for force in loading.forces
    ]
    weight = np.zeros(2 * count)
    if any(loading.gravity):
        weight = density * operators.body_force(loading.gravity)
    return AssembledLoading(
        loading=loading,
        fixed=fixed,
        unit=unit,
        spread=spread_motion(operators, fixed, unit),
        force_vectors=np.array(forces) if forces else np.zeros((0, 2 * count)),
        weight=weight,
    )


def spread_motion(operators: Operators, fixed: Floats, unit: Floats) -> Floats:
    """A prescribed motion spread over the body, (2 node,).

    Where an affine motion meets what is prescribed, as in compression between platens or against
    a wall, it is that one: the boundary's displacement spread linearly over the body. Elsewhere it
    is the displacement of a linear elastic body without Poisson's effect.

    Parameters
    ----------
    operators : of the mesh
    fixed, unit : (2 node,), which displacements are prescribed, and their values

    Raises
    ------
    ConfigurationError
        If the body can move as a whole.
    """
    centred = operators.mesh.nodes - operators.mesh.nodes.mean(axis=0)
    ones, (x, y) = np.ones(len(centred)), centred.T / np.abs(centred).max()
    rigid = np.column_stack([np.r_[ones, 0.0 * x], np.r_[0.0 * x, ones], np.r_[-y, x]])
    if np.linalg.matrix_rank(rigid[fixed], tol=EXACT) < 3:
        raise ConfigurationError(
            "the prescribed motions leave the body free to move as a whole; hold it in x and in y"
        )
    linear = np.column_stack([ones, x, y])
    along_x, along_y = (
        _affine(linear, fixed_part, unit_part)
        for fixed_part, unit_part in zip(np.split(fixed, 2), np.split(unit, 2), strict=True)
    )
    if along_x is not None and along_y is not None:
        return np.where(fixed, unit, np.concatenate([along_x, along_y]))
    stiffness = (operators.force @ operators.strain).tocsc()
    free = np.flatnonzero(~fixed)
    factors = splu(stiffness[free][:, free], permc_spec="MMD_AT_PLUS_A")
    spread = unit.copy()
    spread[free] = factors.solve(-(stiffness[free] @ unit))
    return spread


def _affine(linear: Floats, fixed: Floats, values: Floats) -> Floats | None:
    """One direction of the affine motion with prescribed values; None if there is not just one."""
    if not values.any():
        return np.zeros_like(values)
    known = linear[fixed]
    coefficients, _, rank, _ = np.linalg.lstsq(known, values[fixed], rcond=EXACT)
    missed = np.abs(known @ coefficients - values[fixed]).max()
    return linear @ coefficients if rank == 3 and missed < EXACT * np.abs(values).max() else None
