"""Loading of a body: prescribed motion, pressures, tractions and weight, in time.

Every prescribed motion follows one driving displacement d(t): that of a platen, a wall, a footing.
A `Prescribed` gives the motion of its nodes for a unit of it. The reaction is the force conjugate
to d, so that d times the reaction is the work of the drive.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from granbench.errors import ConfigurationError
from granbench.fem.mesh import Floats

PerUnit = float | Callable[[Floats], Floats]
"""Movement for a unit of the driving displacement: a number, or from nodes (node, direction)."""


@dataclass(frozen=True)
class LoadingHistory:
    """A quantity in time, linear between given instants.

    Parameters
    ----------
    times : s, from 0, increasing
    values : at these times

    Raises
    ------
    ConfigurationError
        If the times do not increase from 0, or a number is missing or not finite.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        times, values = np.asarray(self.times, float), np.asarray(self.values, float)
        if times.ndim != 1 or times.shape != values.shape or len(times) < 2:
            raise ConfigurationError(
                f"a load path has {np.size(times)} times and {np.size(values)} values; give the "
                "same number of each, at least two"
            )
        if not (np.isfinite(times).all() and np.isfinite(values).all()):
            raise ConfigurationError("a load path has a time or a value that is not finite")
        if times[0] != 0.0:
            raise ConfigurationError(f"a load path begins at {times[0]:g} s; it must begin at 0")
        if (late := np.diff(times) <= 0.0).any():
            at = int(late.argmax())
            raise ConfigurationError(
                f"the times of a load path must increase: entry {at + 1} is at {times[at + 1]:g} s "
                f"after {times[at]:g} s; sort the rows or correct the times"
            )

    @classmethod
    def constant(cls, value: float) -> LoadingHistory:
        """The same value at all times."""
        return cls((0.0, 1.0), (value, value))

    @classmethod
    def through(cls, turning_points: Sequence[float], speed: float) -> LoadingHistory:
        """A history from 0 to each turning point in turn at a constant speed.

        Parameters
        ----------
        turning_points : m
        speed : m/s, above zero
        """
        if not speed > 0.0:
            raise ConfigurationError(f"speed is {speed:g} m/s; give one above 0")
        values = (0.0, *turning_points)
        lengths = np.abs(np.diff(values))
        return cls((0.0, *np.cumsum(lengths / speed)), values)

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
    """Prescribed motions, forces and weight of a body.

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
