"""Smooth random principal strain paths whose mean stress follows a smooth random target."""

from __future__ import annotations

import functools
import math
from typing import ClassVar, Self

import numpy as np

from granbench.paths.programme import Floats, LoadingProgramme, require

STRAIN_MODES = 5
PRESSURE_MODES = 2
PRESSURE_GAIN = 1.5
"""Spread of the random ln(p) within its bounds. With the modes it sets how steep p may be: the
volumetric rate that p needs must stay within a few times the deviatoric one to be quasi-static."""

HIGHEST_DRAWN_PRESSURE = 8e6
"""Pa; above it the contacts of these soft grains overlap too far for Hertz's law."""

TABLE_POINTS = 4001
TABLE_END = 1.02
"""The path goes on smoothly beyond its end, for a driver that looks ahead."""


class RandomStrain(LoadingProgramme):
    """A random deviatoric strain path with a random mean stress (the thesis' random loading).

    The deviatoric strain is a truncated Gaussian process (a few random Fourier modes) in the two
    coordinates of the deviatoric plane, and is prescribed in all three directions. Only the
    volumetric strain is free: it follows a random ln(p), smooth too, that starts at p0 and stays
    in [p0 / 2, 3 p0]. A fully prescribed random strain would either unload the packing to zero
    stress or crush it within a per cent of volumetric strain; with a prescribed p > 0 the
    stresses stay compressive, as the thesis demands, because friction bounds q / p.

    Parameters
    ----------
    pressure : initial mean stress p0, Pa
    seed : of the modes
    length : integral of sqrt(2/3 de:de) along the path, strain
    lowest_pressure, highest_pressure : bounds of p / p0

    Raises
    ------
    ConfigurationError : a field is outside its range
    """

    loading_family: ClassVar[str] = "random-strain"

    seed: int
    length: float = 0.08
    lowest_pressure: float = 0.5
    highest_pressure: float = 3.0

    def model_post_init(self, _context: object) -> None:
        super().model_post_init(_context)
        require(self.seed >= 0, self, "seed", "must not be negative")
        require(0 < self.length <= 1, self, "length", "must lie in (0, 1]")
        require(0 < self.lowest_pressure < 1, self, "lowest_pressure", "must lie in (0, 1)")
        require(self.highest_pressure > 1, self, "highest_pressure", "must exceed 1")

    @classmethod
    def draw(cls, rng: np.random.Generator, pressure: float) -> Self:
        """Draw a path at random from `rng`."""
        return cls(
            pressure=pressure,
            seed=int(rng.integers(2**31)),
            highest_pressure=min(3.0, HIGHEST_DRAWN_PRESSURE / pressure),
        )

    @property
    def path_length(self) -> float:
        return self.length

    @property
    def free_directions(self) -> Floats:
        return np.full((3, 1), 1 / 3)

    @property
    def controlled_stresses(self) -> Floats:
        return np.full((1, 3), 1 / 3)

    def driven_strain(self, length: float) -> Floats:
        lengths, strain, _ = self._table()
        return np.array([np.interp(length, lengths, component) for component in strain.T])

    def targets(self, length: float) -> Floats:
        lengths, _, log_ratio = self._table()
        return np.array([self.pressure * math.exp(np.interp(length, lengths, log_ratio))])

    def stress_error(self, stress: Floats, length: float) -> float:
        return float(stress.mean() / self.targets(length)[0] - 1)

    def _table(self) -> tuple[Floats, Floats, Floats]:
        """Driving length (point,), deviatoric strain (point, 3) and ln(p / p0) (point,)."""
        bounds = (math.log(self.lowest_pressure), math.log(self.highest_pressure))
        return _tabulate(self.seed, self.length, bounds)


@functools.lru_cache(maxsize=16)
def _tabulate(
    seed: int, length: float, log_bounds: tuple[float, float]
) -> tuple[Floats, Floats, Floats]:
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, TABLE_END, TABLE_POINTS)
    plane = np.stack([_smooth(t, STRAIN_MODES, rng) for _ in range(2)], axis=1)
    # Orthonormal axes of the deviatoric plane: 11 against the others, and 22 against 33.
    axes = np.array([[2.0, -1.0, -1.0] / np.sqrt(6.0), [0.0, 1.0, -1.0] / np.sqrt(2.0)])
    strain = plane @ axes
    pieces = np.sqrt(2 / 3) * np.linalg.norm(np.diff(strain, axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(pieces)])
    scale = length / np.interp(1.0, t, travelled)
    low, high = log_bounds
    start = -low / (high - low)
    offset = math.log(start / (1 - start))
    # Smooth in the driven length: where the strain path turns, t runs on but the test does not.
    spread = PRESSURE_GAIN * _smooth(travelled * scale / length, PRESSURE_MODES, rng)
    log_ratio = low + (high - low) / (1 + np.exp(-offset - spread))
    return travelled * scale, strain * scale, log_ratio


def _smooth(t: Floats, modes: int, rng: np.random.Generator) -> Floats:
    """Random sum of slow harmonics, zero at t = 0; the spectrum is that of an RBF kernel."""
    k = np.arange(1, modes + 1)
    deviation = np.exp(-0.5 * (k / (0.5 * modes)) ** 2)
    a, b = rng.normal(size=(2, modes)) * deviation / np.linalg.norm(deviation)
    angle = np.pi * np.outer(t, k)
    return (np.sin(angle) @ a) + (np.cos(angle) - 1) @ b
