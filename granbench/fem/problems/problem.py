"""Base class of boundary-value problems: their choices, meshes, loading and defaults."""

from __future__ import annotations

import abc
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from granbench.cells.contract import MaterialCell
from granbench.errors import ConfigurationError, alternatives
from granbench.fem.implicit_settings import ImplicitSettings
from granbench.fem.loading import Loading, LoadingHistory, Pressure
from granbench.fem.mesh import Floats, PlaneMesh
from granbench.fem.mesh_file import is_mesh_file, read_mesh
from granbench.fem.operators import ORDER
from granbench.fem.problems.body import require_body, with_boundaries_of
from granbench.fem.time_step import ExplicitSettings
from granbench.paths.confining_pressure import RandomConfinement
from granbench.tensors import normal_mask
from granbench.units.plausible import LARGEST_STRESS, SMALLEST_STRESS

CYCLES: Mapping[str, tuple[float, ...]] = {
    "monotonic": (),
    "cyclic": (0.5, 0.3, 0.7, 0.4, 0.8, 0.4, 0.9, 0.5),
    "cyclic-8-4": (0.8, 0.4),
    "cyclic-7-5": (0.7, 0.5),
}
"""Turning points of each loading - unloading, reloading, and so on - as shares of the final strain.
With the 10 % of the thesis they are its turning points (Sec 6.4)."""

LARGEST_DRIVE = 0.5
"""Largest driving strain, far beyond the range of small-strain theory."""

FASTEST = 10.0
"""m/s; a hundred times the thesis' speed. Inertia dominates there."""

CONFINEMENT = 1e5
"""Pa; the thesis' confinement of the models that are defined under compression only."""


@dataclass(frozen=True, kw_only=True)
class Problem(abc.ABC):
    """A boundary-value problem, with the choices that every problem has.

    Parameters
    ----------
    cycles : a key of `CYCLES`
    confinement : pressure on the free boundaries, Pa, constant or random; its first value is the
        isotropic stress at the start. By default 100 kPa for a model that is defined under
        compression only, and none for any other, as in the thesis.
    end_strain : driving strain at the end
    speed : of the drive, m/s
    load_path : the driving displacement, m, in place of cycles, end_strain and speed

    Attributes
    ----------
    name : in the registry and in files
    title : full name, in figures and tables
    drive : what the driving displacement is
    reaction : what the force conjugate to it is
    length : what the driving displacement is divided by to be the driving strain
    meshes : makers of its meshes by name
    default_mesh : a key of `meshes`
    b_bar : whether volumetric strains are averaged over elements
    choices : allowed words of each field of its own that holds a word

    Each field is a choice; its metadata say under `meaning` what it is, for the documentation.

    Raises
    ------
    ConfigurationError
        If a choice is unknown or a number out of range.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    drive: ClassVar[str]
    reaction: ClassVar[str]
    length: ClassVar[str]
    meshes: ClassVar[Mapping[str, Callable[[], PlaneMesh]]]
    default_mesh: ClassVar[str] = "medium"
    b_bar: ClassVar[bool] = False
    choices: ClassVar[Mapping[str, tuple[str, ...]]] = {}

    cycles: str = field(
        default="monotonic",
        metadata={"meaning": f"turning points: {', '.join(f'`{name}`' for name in CYCLES)}"},
    )
    confinement: float | RandomConfinement | None = field(
        default=None, metadata={"meaning": "on free boundaries, Pa, or `random:V_C:SEED` (Eq 4.21)"}
    )
    end_strain: float = field(default=0.1, metadata={"meaning": "driving strain at the end"})
    speed: float = field(default=0.1, metadata={"meaning": "of the drive, m/s"})
    load_path: LoadingHistory | None = field(
        default=None,
        metadata={
            "meaning": "CSV file of the drive, in place of `cycles`, `end_strain` and `speed`"
        },
    )

    def __post_init__(self) -> None:
        for name, known in {"cycles": tuple(CYCLES), **self.choices}.items():
            if getattr(self, name) not in known:
                raise ConfigurationError(
                    f"{self.name}: {name} cannot be {getattr(self, name)!r}; choose "
                    f"{' or '.join(known)}"
                )
        if not 0.0 < self.end_strain <= LARGEST_DRIVE:
            share = f"; {0.01 * self.end_strain:g} is {self.end_strain:g} %"
            raise ConfigurationError(
                f"{self.name}: end_strain is {self.end_strain:g}; give one above 0 and up to "
                f"{LARGEST_DRIVE:g}, the limit of this program"
                + (share if LARGEST_DRIVE < self.end_strain <= 100.0 * LARGEST_DRIVE else "")
            )
        if not 0.0 < self.speed <= FASTEST:
            raise ConfigurationError(
                f"{self.name}: speed is {self.speed:g} m/s; give one above 0 and up to "
                f"{FASTEST:g}, in m/s (100 mm/s is 0.1)"
            )
        if self.load_path is not None:
            farthest = max(map(abs, self.load_path.values))
            if not farthest <= LARGEST_DRIVE * self.drive_length:
                raise ConfigurationError(
                    f"{self.name}: the load path goes as far as {farthest:g} m, which over the "
                    f"{self.length} of {self.drive_length:g} m is more than {LARGEST_DRIVE:g}: is "
                    "it in millimetres? State the unit in the file's header, as displacement [mm]"
                )
        given = 0.0 if isinstance(self.confinement, RandomConfinement) else self.confinement
        if given and not SMALLEST_STRESS <= given <= LARGEST_STRESS:
            raise ConfigurationError(
                f"{self.name}: confinement is {given:g} Pa; give a pressure in Pa, 0 for none, or "
                f"from {SMALLEST_STRESS:g} to {LARGEST_STRESS:g}: 1e5 is 100 kPa"
            )

    @property
    @abc.abstractmethod
    def drive_length(self) -> float:
        """Length, m, over which the driving displacement is the driving strain."""

    @abc.abstractmethod
    def loading(self, mesh: PlaneMesh) -> Loading:
        """Loading of the body, in terms of the mesh's named boundaries."""

    def initial_stress(self, positions: Floats, density: float) -> Floats:
        """Stress (3, point), Pa, at the start; in equilibrium with the loads at time 0.

        Parameters
        ----------
        positions : (point, direction), m
        density : kg/m3, of the weight
        """
        return np.outer(normal_mask(ORDER), np.full(len(positions), self.initial_pressure))

    def confined_for(self, cell: MaterialCell) -> Self:
        """The problem with the confinement that it has by default for a cell, if none is chosen."""
        if self.confinement is not None:
            return self
        return replace(self, confinement=CONFINEMENT if cell.pressure_dependent else 0.0)

    @property
    def initial_pressure(self) -> float:
        """Confinement at the start, Pa."""
        if isinstance(self.confinement, RandomConfinement):
            return self.confinement.mean
        return self.confinement or 0.0

    def drive_history(self) -> LoadingHistory:
        """The driving displacement, m."""
        if self.load_path is not None:
            return self.load_path
        end = self.drive_length * self.end_strain
        turns = [end * share for share in (*CYCLES[self.cycles], 1.0)]
        return LoadingHistory.through(turns, self.speed)

    def pressures(self, *boundaries: str) -> tuple[Pressure, ...]:
        """The confinement on some boundaries; nothing where it is zero."""
        if self.initial_pressure == 0.0:
            return ()
        if isinstance(self.confinement, RandomConfinement):
            x, pressure = self.confinement.pressures()
            history = LoadingHistory(tuple(self.drive_history().end * x), tuple(pressure))
        else:
            history = LoadingHistory.constant(self.initial_pressure)
        return tuple(Pressure(boundary, history) for boundary in boundaries)

    def mesh(self, name: str | None = None) -> PlaneMesh:
        """A mesh by name, or the default one; or that of a file, see `read_mesh`.

        Raises
        ------
        ConfigurationError
            If there is none of this name, or the file cannot be read, lacks a boundary of the
            problem, or is of another body.
        """
        name = name or self.default_mesh
        if is_mesh_file(name):
            return self._mesh_of_file(name)
        if name not in self.meshes:
            raise ConfigurationError(
                f"{self.name} has no mesh {name!r}: {alternatives(name, self.meshes)}"
            )
        return self.meshes[name]()

    def _mesh_of_file(self, file: str) -> PlaneMesh:
        mesh = read_mesh(file)
        # Some boundaries depend on choices that say nothing about the body, as the surcharge does.
        own = self.meshes.get("fine", self.meshes[self.default_mesh])()
        try:
            require_body(mesh, own)
            mesh = with_boundaries_of(mesh, own)
            require_body(mesh, own, self.loading(mesh).boundaries)
        except ConfigurationError as error:
            raise ConfigurationError(f"mesh {file}, for {self.name}: {error}") from error
        return mesh

    def explicit(self) -> ExplicitSettings:
        """Default settings of the explicit solver."""
        return ExplicitSettings()

    def implicit(self) -> ImplicitSettings:
        """Default settings of the implicit solver."""
        return ImplicitSettings()

    def configuration(self) -> dict[str, object]:
        """The choices, for a file's attributes."""
        return asdict(self)
