"""Conventional triaxial tests with loops of unloading and reloading."""

from __future__ import annotations

import itertools
from typing import ClassVar, Self

import numpy as np

from granbench.paths.programme import Floats, LoadingProgramme, require

DRAWN_PATH_LENGTH = 0.10
DRAWN_UNLOADING_STRAINS = (0.008, 0.055)
DRAWN_AMPLITUDES = (0.002, 0.008)
DRAWN_TOTAL_AMPLITUDE = 0.021
"""Most strain that the loops unload, so that the last one ends before the path does."""
DRAWN_LOOPS = (3, 6)


class CyclicTriaxial(LoadingProgramme):
    """Axial compression at s22 = s33 = const with strain-controlled loops (thesis Table 2.2).

    Parameters
    ----------
    pressure : s22 = s33 and the initial mean stress, Pa
    unloading_strains : axial strains, rising, at which the axial rate turns to extension
    amplitudes : axial strain by which each is unloaded before reloading; where it exceeds what
        brings the deviator to zero, s11 becomes the minor stress
    axial_strain : axial strain at the end

    Raises
    ------
    ConfigurationError : a field is outside its range
    """

    loading_family: ClassVar[str] = "cyclic"

    unloading_strains: tuple[float, ...]
    amplitudes: tuple[float, ...]
    axial_strain: float

    def model_post_init(self, _context: object) -> None:
        super().model_post_init(_context)
        ends = (0.0, *self.unloading_strains, self.axial_strain)
        rising = all(a < b for a, b in itertools.pairwise(ends))
        require(rising, self, "unloading_strains", "must rise from above 0 to below axial_strain")
        matched = len(self.amplitudes) == len(self.unloading_strains)
        require(
            matched and all(a > 0 for a in self.amplitudes),
            self, "amplitudes", "must be positive, one for each unloading strain",
        )  # fmt: skip

    @classmethod
    def draw(cls, rng: np.random.Generator, pressure: float) -> Self:
        """Draw the loops at random such that the whole path has a length of 0.10."""
        loops = int(rng.integers(DRAWN_LOOPS[0], DRAWN_LOOPS[1] + 1))
        # One loop in each equal part of the range, so that loops do not run into each other.
        edges = np.linspace(*DRAWN_UNLOADING_STRAINS, loops + 1)
        at = edges[:-1] + np.diff(edges) * rng.uniform(0.1, 0.9, loops)
        least, most = DRAWN_AMPLITUDES
        excess = rng.uniform(0.0, most - least, loops)
        excess *= min(1.0, (DRAWN_TOTAL_AMPLITUDE - least * loops) / excess.sum())
        by = least + excess
        return cls(
            pressure=pressure,
            unloading_strains=tuple(np.round(at, 5).tolist()),
            amplitudes=tuple(np.round(by, 5).tolist()),
            axial_strain=round(DRAWN_PATH_LENGTH - 2 * float(np.round(by, 5).sum()), 5),
        )

    @property
    def path_length(self) -> float:
        return self.axial_strain + 2 * sum(self.amplitudes)

    @property
    def turning_points(self) -> tuple[float, ...]:
        return tuple(self._corners()[0][1:-1].tolist())

    @property
    def free_directions(self) -> Floats:
        return np.eye(3)[:, 1:]

    @property
    def controlled_stresses(self) -> Floats:
        return np.eye(3)[1:]

    def driven_strain(self, length: float) -> Floats:
        return np.array([np.interp(length, *self._corners()), 0.0, 0.0])

    def targets(self, length: float) -> Floats:
        return np.full(2, self.pressure)

    def stress_error(self, stress: Floats, length: float) -> float:
        errors = stress[1:] / self.pressure - 1
        return float(errors[np.argmax(np.abs(errors))])

    def _corners(self) -> tuple[Floats, Floats]:
        """Driving lengths and axial strains of the start, the turning points and the end."""
        strains = [0.0]
        for at, by in zip(self.unloading_strains, self.amplitudes, strict=True):
            strains += [at, at - by]
        strains.append(self.axial_strain)
        lengths = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(strains)))])
        return lengths, np.array(strains)
