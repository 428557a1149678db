"""Settings of the explicit solver, its time step (Eq 5.8) and output steps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from numbers import Integral

import numpy as np

from granbench.errors import ConfigurationError
from granbench.fem.gauss_points import GaussPoints
from granbench.fem.loading import LoadingHistory
from granbench.fem.mesh import Floats
from granbench.fem.operators import Operators

LARGEST_DAMPING = 1e4
LARGEST_MODULUS = 1e15
"""Largest modulus E of the damping (Eq 5.9), Pa."""
MOST_STEPS = 100_000_000
"""Time steps; even the fastest analysis would take hours, so a unit is probably wrong."""

MOST_TURNS = 10_000
"""Turning points of a load path, each of them an output step."""

ON_A_STEP = 1e-9
"""Distance of a number of time steps from a whole number that counts as rounding."""


def require_whole(settings: object, *names: str) -> None:
    """Refuse settings that must be whole numbers or None.

    Raises
    ------
    ConfigurationError
        Naming the first of them.
    """
    for name in names:
        value = getattr(settings, name)
        if not (value is None or isinstance(value, Integral)):
            raise ConfigurationError(f"{name} is {value!r}; give a whole number")


@dataclass(frozen=True)
class ExplicitSettings:
    """Settings of an explicit analysis.

    Parameters
    ----------
    density : rho, kg/m3
    damping : gamma of Eq 5.9
    damping_modulus : E of Eq 5.9, Pa; the thesis has 20 MPa for every material
    damping_length : m. Eq 5.9 gives a damping per area; over this length it is one per volume.
        The thesis has the metre that it does not write.
    safety : of the time step against L/c_d (Eq 5.8)
    modulus : rho c_d^2, Pa; by default the stiffest normal component of the cell's tangent at the
        start
    time_step : s, instead of the one from `safety`; it is shortened a little, so that output steps
        are at equal distances and the last at the end
    outputs : number of output steps after the first; there are some more where the drive turns
        between them
    turning_points : whether every turning point of the drive is an output step

    Raises
    ------
    ConfigurationError
        If a number is out of range.
    """

    density: float = 2650.0
    damping: float = 1.0
    damping_modulus: float = 20e6
    damping_length: float = 1.0
    safety: float = 0.2
    modulus: float | None = None
    time_step: float | None = None
    outputs: int = 100
    turning_points: bool = True

    def __post_init__(self) -> None:
        require_whole(self, "outputs")
        for name in ("density", "damping_length", "safety", "outputs", "modulus", "time_step"):
            value = getattr(self, name)
            if value is not None and not (0.0 < value < math.inf):
                raise ConfigurationError(f"{name} is {value:g}; give one above 0")
        for name, largest in (("damping", LARGEST_DAMPING), ("damping_modulus", LARGEST_MODULUS)):
            if not 0.0 <= getattr(self, name) <= largest:
                raise ConfigurationError(
                    f"{name} is {getattr(self, name):g}; give 0 to {largest:g}"
                )

    @property
    def damping_rate(self) -> float:
        """Alpha, 1/s."""
        per_area = 2.0 * self.damping * math.sqrt(self.density * self.damping_modulus)
        return per_area / self.damping_length / self.density


@dataclass(frozen=True)
class TimeStep:
    """A time step and what bounds it.

    Parameters
    ----------
    chosen : s, from the settings or Eq 5.8
    limit : 2/omega_max, s, of the stiffest element at the start
    """

    chosen: float
    limit: float


def choose_time_step(
    operators: Operators, points: GaussPoints, settings: ExplicitSettings
) -> TimeStep:
    """The time step of an analysis (Eq 5.8) and the stability limit.

    The limit takes the highest frequency of any element by itself, which is never below that of
    the mesh.

    Raises
    ------
    ConfigurationError
        If the time step is beyond the limit, or the cell's tangent gives none.
    """
    _, tangent = points.tangent(np.zeros_like(points.strain), 0)
    stiffest = float(np.abs(tangent[:, (0, 1), (0, 1)]).max())
    modulus = settings.modulus or stiffest
    if not 0.0 < modulus < math.inf:
        raise ConfigurationError(
            f"{points.cell.name} has no stiffness at the start for the time step; give a modulus"
        )
    if not np.isfinite(tangent).all() or settings.modulus:
        tangent = np.tile(modulus * np.diag([1.0, 1.0, 0.5]), (points.count, 1, 1))
    elements = len(operators.element_dofs)
    stress = tangent.reshape(elements, -1, 3, 3) @ operators.element_strain.reshape(
        elements, -1, 3, operators.element_dofs.shape[1]
    )
    stiffness = operators.element_force @ stress.reshape(operators.element_strain.shape)
    root = 1.0 / np.sqrt(settings.density * np.tile(operators.element_volumes, 2))
    scaled = root[:, :, None] * (stiffness + stiffness.transpose(0, 2, 1)) / 2.0 * root[:, None]
    limit = 2.0 / math.sqrt(np.linalg.eigvalsh(scaled)[:, -1].max())
    speed = math.sqrt(modulus / settings.density)
    length = operators.mesh.characteristic_length
    chosen = settings.time_step or settings.safety * length / speed
    if chosen > limit:
        raise ConfigurationError(
            f"the time step of {chosen:.3g} s is unstable: this mesh and material need one below "
            f"{limit:.3g} s; leave it out, or lower it or the safety factor"
        )
    return TimeStep(chosen, limit)


def output_steps(drive: LoadingHistory, time_step: float, settings: ExplicitSettings) -> np.ndarray:
    """Numbers of the time steps that are output steps, from 0 to the last.

    They are at equal distances if every turning point of the drive is then one of them. Otherwise
    they are nearly so between one turning point and the next, and the number of time steps is
    chosen so that the turning points fall on time steps as closely as may be.

    Parameters
    ----------
    drive : the driving displacement
    time_step : the longest, s
    settings : how many outputs there are to be; more where the turning points ask for it

    Raises
    ------
    ConfigurationError
        If there are too many time steps or turning points.
    """
    count = settings.outputs
    wanted = drive.end / time_step
    if not wanted <= MOST_STEPS:
        raise ConfigurationError(
            f"a loading of {drive.end:.3g} s in time steps of {time_step:.3g} s takes "
            f"{wanted:.3g} of them, more than {MOST_STEPS:.0g}; shorten the loading or raise "
            "its speed"
        )
    even = max(1, math.ceil(wanted / count - 1e-9)) * np.arange(count + 1)
    turns = drive.turning_times / drive.end
    if len(turns) > MOST_TURNS:
        raise ConfigurationError(
            f"the load path turns {len(turns):,} times, more than {MOST_TURNS:,}; smooth it"
        )
    if not settings.turning_points or (_off(turns * count) < ON_A_STEP * count).all():
        return even
    fewest = math.ceil(drive.end / time_step - 1e-9)
    candidates = np.arange(fewest, fewest + max(50, min(fewest // 50, 1000)))
    off = np.max([_off(candidates * turn) for turn in turns], axis=0)
    total = candidates[(off <= off.min() + ON_A_STEP * candidates).argmax()]
    ends = np.concatenate([[0.0], turns, [1.0]])
    pieces = [
        np.linspace(
            begin, end, max(1, math.ceil(count * (end - begin) - ON_A_STEP)), endpoint=False
        )
        for begin, end in pairwise(ends)
    ]
    return np.unique(np.round(total * np.append(np.concatenate(pieces), 1.0)).astype(np.int64))


def _off(numbers: Floats) -> Floats:
    """Distance from the nearest whole number."""
    return np.asarray(np.abs(numbers - np.round(numbers)))
