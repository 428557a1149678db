"""Monotonic true-triaxial compression at a constant intermediate stress ratio b."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from granbench.paths.programme import Floats, LoadingProgramme, held_ratio, require


class _ConstantRatio(LoadingProgramme):
    """Axial compression while b = (s22 - s33) / (s11 - s33) is held."""

    driving_component: ClassVar[str | None] = "11"

    b: float
    axial_strain: float = 0.4

    def model_post_init(self, _context: object) -> None:
        super().model_post_init(_context)
        require(0 <= self.b <= 1, self, "b", "must lie in [0, 1]")
        require(0 < self.axial_strain <= 1, self, "axial_strain", "must lie in (0, 1]")

    @property
    def intermediate_stress_ratio(self) -> float:
        return self.b

    @property
    def path_length(self) -> float:
        return self.axial_strain

    @property
    def free_directions(self) -> Floats:
        return np.eye(3)[:, 1:]

    def driven_strain(self, length: float) -> Floats:
        return np.array([length, 0.0, 0.0])


class ConstantMeanStress(_ConstantRatio):
    """Axial compression at constant mean stress and constant b (thesis Table 2.2).

    Parameters
    ----------
    pressure : p, Pa
    b : intermediate stress ratio, 0 (compression) to 1 (extension)
    axial_strain : logarithmic strain in direction 11 at the end

    Raises
    ------
    ConfigurationError : a field is outside its range
    """

    loading_family: ClassVar[str] = "constant-p"

    @property
    def controlled_stresses(self) -> Floats:
        return np.array([[1.0, 1.0, 1.0], held_ratio(self.b)])

    def targets(self, length: float) -> Floats:
        return np.array([3 * self.pressure, 0.0])

    def stress_error(self, stress: Floats, length: float) -> float:
        return float(stress.mean() / self.pressure - 1)


class ConstantMinorStress(_ConstantRatio):
    """Axial compression at constant minor stress s33 and constant b (thesis Table 2.2).

    Parameters
    ----------
    pressure : s33 and the initial mean stress, Pa
    b : intermediate stress ratio, 0 (compression) to 1 (extension)
    axial_strain : logarithmic strain in direction 11 at the end

    Raises
    ------
    ConfigurationError : a field is outside its range
    """

    loading_family: ClassVar[str] = "constant-sigma3"

    @property
    def controlled_stresses(self) -> Floats:
        return np.array([[0.0, 0.0, 1.0], held_ratio(self.b)])

    def targets(self, length: float) -> Floats:
        return np.array([self.pressure, 0.0])

    def stress_error(self, stress: Floats, length: float) -> float:
        return float(stress[2] / self.pressure - 1)
