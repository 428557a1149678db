"""Biaxial compression of a specimen 0.5 m wide and 1 m high (thesis, Sec 4.3.1, 5.3.1, 6.4).

             top platen moves down
           +----------------------+        rough ends: the platens hold the soil in x and y
           |                      |        smooth ends: in y alone; one node of the base is held
        -> |                      | <-     in x
       p_c |                      | p_c
        -> |                      | <-     lateral pressure p_c on both sides
           |                      |
           +----------------------+
             bottom platen at rest

The reaction is the force of the top platen, per metre of thickness.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from granbench.errors import ConfigurationError
from granbench.fem.loading import Loading, LoadingHistory, Prescribed, Pressure
from granbench.fem.mesh import Floats, PlaneMesh, rectangle
from granbench.fem.problems.problem import Problem
from granbench.paths.confining_pressure import RandomConfinement

WIDTH, HEIGHT = 0.5, 1.0

ENDS = ("rough", "smooth")

CYCLES: Mapping[str, tuple[float, ...]] = {
    "monotonic": (),
    "cyclic": (0.05, 0.03, 0.07, 0.04, 0.08, 0.04, 0.09, 0.05),
    "cyclic-8-4": (0.08, 0.04),
    "cyclic-7-5": (0.07, 0.05),
}
"""Axial strains at which each loading turns: unloading, reloading, and so on."""


@dataclass(frozen=True)
class Biaxial(Problem):
    """See the module.

    Parameters
    ----------
    ends : rough or smooth
    cycles : a key of `CYCLES`
    confinement : lateral pressure, Pa, constant or random; the initial stress is its first value
    axial_strain : at the end
    speed : of the top platen, m/s

    Raises
    ------
    ConfigurationError
        If a choice is unknown or a number out of range.
    """

    name: ClassVar[str] = "biaxial"
    title: ClassVar[str] = "Biaxial compression"
    drive: ClassVar[str] = "displacement of the top platen"
    reaction: ClassVar[str] = "force of the top platen"
    meshes: ClassVar[Mapping[str, Callable[[], PlaneMesh]]] = {
        "coarse": partial(rectangle, WIDTH, HEIGHT, 2, 4),
        "medium": partial(rectangle, WIDTH, HEIGHT, 4, 8),
        "fine": partial(rectangle, WIDTH, HEIGHT, 8, 16),
        "table-5.2": partial(rectangle, WIDTH, HEIGHT, 11, 11),  # the table's 484 Gauss points
    }
    default_mesh: ClassVar[str] = "medium"

    ends: str = "rough"
    cycles: str = "monotonic"
    confinement: float | RandomConfinement = 1e5
    axial_strain: float = 0.1
    speed: float = 0.1

    def __post_init__(self) -> None:
        for name, known in (("ends", ENDS), ("cycles", tuple(CYCLES))):
            if getattr(self, name) not in known:
                raise ConfigurationError(
                    f"{self.name}: {name} cannot be {getattr(self, name)!r}; choose "
                    f"{' or '.join(known)}"
                )
        turns = CYCLES[self.cycles]
        if not self.axial_strain > max(turns, default=0.0):
            raise ConfigurationError(
                f"{self.name}: the axial strain ends at {self.axial_strain:g}; let it be above "
                f"{max(turns, default=0.0):g}"
            )
        if not isinstance(self.confinement, RandomConfinement) and not self.confinement >= 0.0:
            raise ConfigurationError(
                f"{self.name}: a confinement of {self.confinement:g} Pa pulls; give 0 or more"
            )

    @property
    def drive_length(self) -> float:
        """See `Problem.drive_length`."""
        return HEIGHT

    @property
    def initial_pressure(self) -> float:
        """Confinement at the start, Pa."""
        if isinstance(self.confinement, RandomConfinement):
            return self.confinement.mean
        return self.confinement

    def loading(self, mesh: PlaneMesh) -> Loading:
        """See `Problem.loading`."""
        turns = (*CYCLES[self.cycles], self.axial_strain)
        drive = LoadingHistory.through([HEIGHT * strain for strain in turns], self.speed)
        held = 0.0 if self.ends == "rough" else None
        platens = [Prescribed("bottom", x=held, y=0.0), Prescribed("top", x=held, y=-1.0)]
        if self.ends == "smooth":
            base = mesh.nodes[mesh.nodes_on("bottom")]
            x, y = base[np.abs(base[:, 0] - 0.5 * WIDTH).argmin()]
            platens.append(Prescribed((float(x), float(y)), x=0.0))
        sides = tuple(Pressure(side, self._pressure(drive.end)) for side in ("left", "right"))
        return Loading(tuple(platens), drive, sides if self.initial_pressure > 0.0 else ())

    def _pressure(self, end: float) -> LoadingHistory:
        if isinstance(self.confinement, RandomConfinement):
            x, pressure = self.confinement.pressures()
            return LoadingHistory(tuple(end * x), tuple(pressure))
        return LoadingHistory.constant(self.confinement)

    def initial_stress(self, positions: Floats) -> Floats:
        """See `Problem.initial_stress`: isotropic."""
        return np.outer((1.0, 1.0, 0.0), np.full(len(positions), self.initial_pressure))
