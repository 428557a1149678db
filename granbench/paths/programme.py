"""Base class of loading programmes: prescribed strains and controlled stresses."""

from __future__ import annotations

import abc
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from granbench.errors import ConfigurationError

Floats = NDArray[np.float64]


class LoadingProgramme(BaseModel, abc.ABC):
    """A path in principal strain and stress, parametrised by its driving length s >= 0.

    The principal strain is ``driven_strain(s) + free_directions @ x`` with unknown x (control,);
    the driver finds x such that ``controlled_stresses @ stress = targets(s)``, which has as many
    rows as `free_directions` has columns. Directions are 11 (axial), 22 (intermediate) and
    33 (minor); strain is logarithmic, compression positive. A programme in the `full` order, for
    shear, has six components instead of three.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    loading_family: ClassVar[str]

    order: ClassVar[str] = "principal"
    """Component order of strain and stress, `principal` or `full`."""

    driving_component: ClassVar[str | None] = None
    """The strain component that the driving length is, where the programme may be followed to
    and fro and below zero; None where the length only grows."""

    pressure: float
    """Initial mean stress p0, Pa, of the isotropic state that the path starts from."""

    def model_post_init(self, _context: object) -> None:
        """Raise ConfigurationError for a field that no test can follow."""
        require(self.pressure > 0, self, "pressure", "must be positive (Pa)")

    @property
    @abc.abstractmethod
    def path_length(self) -> float:
        """Driving length of the whole path, strain."""

    @property
    def turning_points(self) -> tuple[float, ...]:
        """Driving lengths at which the prescribed strain rate changes its sign."""
        return ()

    @property
    def intermediate_stress_ratio(self) -> float:
        """Prescribed b = (s22 - s33) / (s11 - s33); NaN where none is held."""
        return float("nan")

    @property
    @abc.abstractmethod
    def free_directions(self) -> Floats:
        """Strain directions that follow the stresses, (3, control)."""

    @property
    @abc.abstractmethod
    def controlled_stresses(self) -> Floats:
        """Rows of the stress combinations that are held, (control, 3)."""

    @abc.abstractmethod
    def driven_strain(self, length: float) -> Floats:
        """Return the prescribed part of the principal strain at a driving length, (3,)."""

    @abc.abstractmethod
    def targets(self, length: float) -> Floats:
        """Return the values of the controlled stresses at a driving length, (control,), Pa."""

    @abc.abstractmethod
    def stress_error(self, stress: Floats, length: float) -> float:
        """Return the relative error of the held stress magnitude for principal stresses (3,)."""

    def stress_ratio_error(self, stress: Floats) -> float:
        """Return measured less prescribed b for principal stresses (3,); NaN where none is held."""
        held, deviator = self.intermediate_stress_ratio, stress[0] - stress[2]
        if np.isnan(held) or deviator == 0:
            return float("nan")
        return float((stress[1] - stress[2]) / deviator - held)


def require(condition: bool, programme: LoadingProgramme, field: str, rule: str) -> None:
    """Raise ConfigurationError naming the programme's field unless `condition` holds."""
    if not condition:
        raise ConfigurationError(
            f"{type(programme).__name__}.{field} = {getattr(programme, field)!r} {rule}"
        )


def held_ratio(b: float) -> list[float]:
    """Row of b s11 + (1 - b) s33 - s22, which is zero where the ratio is b."""
    return [b, -1.0, 1.0 - b]
