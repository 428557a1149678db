"""What is done to a body: prescribed motion, pressures, tractions and weight, in time.

Every prescribed motion follows one driving displacement d(t): that of a platen, a wall, a footing.
A `Prescribed` says how far its nodes move for a unit of it. The reaction is the force conjugate
to d, so that d times the reaction is the work of the drive.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import splu

from granbench.errors import ConfigurationError
from granbench.fem.mesh import Floats
from granbench.fem.operators import Operators

EXACT = 1e-10
"""Relative: rounding of coordinates, and less than any motion that is meant."""

PerUnit = float | Callable[[Floats], Floats]
"""Movement for a unit of the driving displacement: a number, or from nodes (node, direction)."""


@dataclass(frozen=True)
class LoadingHistory:
    """A quantity in time, linear between given instants.

    Parameters
    ----------
    times : s, from 0 on, rising
    values : at these times

    Raises
    ------
    ConfigurationError
        If the times do not rise from 0, or a number is missing or not finite.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        times, values = np.asarray(self.times, float), np.asarray(self.values, float)
        if times.ndim != 1 or times.shape != values.shape or len(times) < 2:
            raise ConfigurationError(
                f"a load path has {np.size(times)} times and {np.size(values)} values; give as "
                "many of each, two at least"
            )
        if not (np.isfinite(times).all() and np.isfinite(values).all()):
            raise ConfigurationError("a load path has a time or a value that is not finite")
        if times[0] != 0.0:
            raise ConfigurationError(f"a load path begins at {times[0]:g} s; let it begin at 0")
        if (late := np.diff(times) <= 0.0).any():
            at = int(late.argmax())
            raise ConfigurationError(
                f"a load path is not monotone in time: entry {at + 1} is at {times[at + 1]:g} s "
                f"after {times[at]:g} s; let its times rise"
            )

    @classmethod
    def constant(cls, value: float) -> LoadingHistory:
        """The same value at all times."""
        return cls((0.0, 1.0), (value, value))

    @classmethod
    def through(cls, turning_points: Sequence[float], speed: float) -> LoadingHistory:
        """From 0 to each turning point in turn at a constant speed.

        Parameters
        ----------
        turning_points : m
        speed : m/s, above zero
        """
        if not speed > 0.0:
            raise ConfigurationError(f"a speed of {speed:g} m/s loads nothing; give one above 0")
        values = (0.0, *turning_points)
        lengths = np.abs(np.diff(values))
        return cls((0.0, *np.cumsum(lengths / speed)), values)

    @classmethod
    def of_velocity(cls, times: Sequence[float], velocities: Sequence[float]) -> LoadingHistory:
        """Displacement of a velocity that is constant between given times.

        Parameters
        ----------
        times : (n + 1,), s
        velocities : (n,), m/s, of each interval
        """
        lengths = np.diff(times) * np.asarray(velocities, float)
        return cls(tuple(times), (0.0, *np.cumsum(lengths)))

    @property
    def end(self) -> float:
        """Last given time, s."""
        return self.times[-1]

    @property
    def turning_times(self) -> Floats:
        """Times, s, at which the value turns, comes to rest or leaves it."""
        direction = np.sign(np.diff(self.values))
        return np.asarray(self.times)[1:-1][direction[1:] != direction[:-1]]

    def at(self, time: float | Floats) -> Floats:
        """Value at a time; the last one after the end."""
        return np.asarray(np.interp(time, self.times, self.values))


@dataclass(frozen=True)
class Prescribed:
    """Prescribed motion of a boundary or of one node.

    Parameters
    ----------
    where : name of a boundary, or coordinates of a node, m
    x, y : displacement for a unit of the driving one; 0 holds it, None leaves it free
    """

    where: str | tuple[float, float]
    x: PerUnit | None = None
    y: PerUnit | None = None


@dataclass(frozen=True)
class Pressure:
    """A pressure against the outward normal of a boundary, Pa; positive compresses."""

    boundary: str
    history: LoadingHistory


@dataclass(frozen=True)
class Traction:
    """A traction in a fixed direction (x, y) on a boundary, Pa times the direction."""

    boundary: str
    direction: tuple[float, float]
    history: LoadingHistory


@dataclass(frozen=True)
class Loading:
    """All that is done to a body.

    Parameters
    ----------
    prescribed : motions; where two prescribe the same displacement they must agree
    drive : the driving displacement, m; its end is the end of the analysis
    forces : pressures and tractions
    gravity : acceleration (x, y), m/s2; the initial stress must balance it
    """

    prescribed: tuple[Prescribed, ...]
    drive: LoadingHistory
    forces: tuple[Pressure | Traction, ...] = ()
    gravity: tuple[float, float] = (0.0, 0.0)

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Names of the boundaries that it refers to."""
        moved = (motion.where for motion in self.prescribed if isinstance(motion.where, str))
        return tuple(dict.fromkeys((*moved, *(force.boundary for force in self.forces))))


@dataclass(frozen=True)
class AssembledLoading:
    """A loading as nodal vectors.

    Parameters
    ----------
    loading : what it is of
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
    loading : what is done
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
