"""What a boundary-value problem states; what the solvers make of it is the same for all."""

from __future__ import annotations

import abc
from collections.abc import Callable, Mapping
from dataclasses import asdict
from difflib import get_close_matches
from typing import ClassVar

from granbench.errors import ConfigurationError
from granbench.fem.iteration import ImplicitSettings
from granbench.fem.loading import Loading
from granbench.fem.mesh import Floats, PlaneMesh
from granbench.fem.time_step import ExplicitSettings


class Problem(abc.ABC):
    """A boundary-value problem; a frozen dataclass of what may be chosen in it.

    Attributes
    ----------
    name : in the registry and in files
    title : for people
    drive : what the driving displacement is
    reaction : what the force conjugate to it is
    meshes : makers of its meshes by name
    default_mesh : a key of `meshes`
    b_bar : whether volumetric strains are averaged over elements
    """

    name: ClassVar[str]
    title: ClassVar[str]
    drive: ClassVar[str]
    reaction: ClassVar[str]
    meshes: ClassVar[Mapping[str, Callable[[], PlaneMesh]]]
    default_mesh: ClassVar[str]
    b_bar: ClassVar[bool] = False

    @property
    @abc.abstractmethod
    def drive_length(self) -> float:
        """Length, m, over which the driving displacement is the driving strain."""

    @abc.abstractmethod
    def loading(self, mesh: PlaneMesh) -> Loading:
        """What is done to the body, by the names of the mesh's boundaries."""

    @abc.abstractmethod
    def initial_stress(self, positions: Floats) -> Floats:
        """Stress (3, point), Pa, at the start; in equilibrium with the loads at time 0.

        Parameters
        ----------
        positions : (point, direction), m
        """

    def mesh(self, name: str | None = None) -> PlaneMesh:
        """A mesh by name, or the default one.

        Raises
        ------
        ConfigurationError
            If there is none of this name.
        """
        name = name or self.default_mesh
        if name not in self.meshes:
            near = get_close_matches(name, self.meshes, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise ConfigurationError(
                f"{self.name} has no mesh {name!r}: {hint}there are {', '.join(self.meshes)}"
            )
        return self.meshes[name]()

    def explicit(self) -> ExplicitSettings:
        """How the explicit solver is set by default."""
        return ExplicitSettings()

    def implicit(self) -> ImplicitSettings:
        """How the implicit solver is set by default."""
        return ImplicitSettings()

    def configuration(self) -> dict[str, object]:
        """What was chosen, for a file's attributes."""
        return asdict(self)  # type: ignore[call-overload]  # the subclasses are dataclasses
