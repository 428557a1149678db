"""Element tests of the laboratory that are driven by one strain, beside those of `triaxial`.

Each may be followed to and fro: a negative axial strain is extension.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from granbench.paths.programme import Floats, LoadingProgramme, held_ratio, require
from granbench.tensors import normal_mask


class _DrivenTest(LoadingProgramme):
    """A test whose strain is the driving strain times a direction, plus what is free.

    Subclasses state the rows below; the held stresses stay what they are at the isotropic start.
    """

    driving_component: ClassVar[str | None] = "11"
    driven: ClassVar[tuple[float, ...]]
    """Strain of every component for a unit of driving strain."""
    free: ClassVar[tuple[tuple[float, ...], ...]] = ()
    """The free strain directions, one a row."""

    largest_strain: float = 0.2
    """Magnitude that the driving strain does not exceed."""

    def model_post_init(self, _context: object) -> None:
        super().model_post_init(_context)
        require(0 < self.largest_strain <= 1, self, "largest_strain", "must lie in (0, 1]")

    @property
    def path_length(self) -> float:
        return self.largest_strain

    @property
    def free_directions(self) -> Floats:
        return np.reshape(np.array(self.free, dtype=float), (-1, len(self.driven))).T

    @property
    def controlled_stresses(self) -> Floats:
        """The stresses along the free directions, unless a subclass holds others."""
        return self.free_directions.T

    def driven_strain(self, length: float) -> Floats:
        return length * np.array(self.driven)

    def targets(self, length: float) -> Floats:
        return self.controlled_stresses @ (self.pressure * np.array(normal_mask(self.order)))

    def stress_error(self, stress: Floats, length: float) -> float:
        error = self.controlled_stresses @ stress - self.targets(length)
        return float(np.max(np.abs(error), initial=0.0) / self.pressure)


class UndrainedTriaxial(_DrivenTest):
    """Triaxial test at constant volume and constant b, at b = 0 the conventional one.

    Parameters
    ----------
    pressure : initial mean effective stress, Pa
    b : intermediate stress ratio, 0 to 1
    largest_strain : of the axial strain, in either sense

    Raises
    ------
    ConfigurationError : a field is outside its range
    """

    loading_family: ClassVar[str] = "triaxial-undrained"
    driven: ClassVar[tuple[float, ...]] = (1.0, -0.5, -0.5)
    # The lateral strains may differ: so s22 = s33 is met by anisotropic cells as well.
    free: ClassVar[tuple[tuple[float, ...], ...]] = ((0.0, 1.0, -1.0),)

    b: float = 0.0

    def model_post_init(self, _context: object) -> None:
        super().model_post_init(_context)
        require(0 <= self.b <= 1, self, "b", "must lie in [0, 1]")

    @property
    def intermediate_stress_ratio(self) -> float:
        return self.b

    @property
    def controlled_stresses(self) -> Floats:
        return np.array([held_ratio(self.b)])


class Oedometer(_DrivenTest):
    """Axial compression without lateral strain.

    Parameters
    ----------
    pressure : of the isotropic state that it starts from, Pa
    largest_strain : of the axial strain, in either sense

    Raises
    ------
    ConfigurationError : a field is outside its range
    """

    loading_family: ClassVar[str] = "oedometer"
    driven: ClassVar[tuple[float, ...]] = (1.0, 0.0, 0.0)


class BiaxialCompression(_DrivenTest):
    """Drained compression in plane strain between smooth plates: e22 = 0 and s33 = p0.

    Parameters
    ----------
    pressure : lateral stress s33, and that of the isotropic start, Pa
    largest_strain : of the axial strain, in either sense

    Raises
    ------
    ConfigurationError : a field is outside its range
    """

    loading_family: ClassVar[str] = "biaxial"
    driven: ClassVar[tuple[float, ...]] = (1.0, 0.0, 0.0)
    free: ClassVar[tuple[tuple[float, ...], ...]] = ((0.0, 0.0, 1.0),)


class SimpleShear(_DrivenTest):
    """Simple shear at constant volume: e_xy is driven, every other strain stays zero.

    The driving strain is the tensor component e_xy, half the engineering shear strain.

    Parameters
    ----------
    pressure : of the isotropic state that it starts from, Pa
    largest_strain : of e_xy, in either sense

    Raises
    ------
    ConfigurationError : a field is outside its range
    """

    loading_family: ClassVar[str] = "simple-shear"
    order: ClassVar[str] = "full"
    driving_component: ClassVar[str | None] = "xy"
    driven: ClassVar[tuple[float, ...]] = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


class DrainedSimpleShear(SimpleShear):
    """Simple shear under a constant vertical stress s_yy = p0; e_yy is free.

    Parameters and errors are those of `SimpleShear`.
    """

    loading_family: ClassVar[str] = "simple-shear-drained"
    free: ClassVar[tuple[tuple[float, ...], ...]] = ((0.0, 1.0, 0.0, 0.0, 0.0, 0.0),)
