"""Settings of the explicit solver, and the time step that follows from them (Eq 5.8)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Integral

import numpy as np

from granbench.errors import ConfigurationError
from granbench.fem.gauss_points import GaussPoints
from granbench.fem.operators import Operators

LARGEST_DAMPING = 1e4
LARGEST_MODULUS = 1e15
"""Of Eq 5.9, Pa."""


def require_whole(settings: object, *names: str) -> None:
    """Refuse settings that count something and are no whole number, or None.

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
    """How an explicit analysis is made.

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
    outputs : number of output steps after the first

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
    chosen : s, what was asked for or follows from Eq 5.8
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
            f"{points.cell.name} has no stiffness at the start from which a time step follows; "
            "give its modulus"
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
