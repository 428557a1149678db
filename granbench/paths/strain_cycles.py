"""Strain cycles: loading and unloading to and fro along a fixed direction."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from granbench.errors import ConfigurationError
from granbench.paths.drawn import DrawnPaths, PathFamily, directions, require_range, uniform
from granbench.paths.programme import Floats


class StrainCycles(PathFamily):
    """Triangular cycles between an upper and a lower strain, at a constant rate.

    The path goes from zero to the upper turning point and from there n times to the lower one
    and back. Directions are uniform over (xx, yy, xy). Turning points fall between the recorded
    steps, so that a record misses them by less than an increment.

    Parameters
    ----------
    amplitude : range of the Frobenius norm of the strain at the upper turning points
    ratio : range of the strain at the lower turning points over that at the upper; -1 is
        two-way loading
    cycles : smallest and largest number of cycles n

    Raises
    ------
    ConfigurationError : a range does not rise or is out of bounds
    """

    loading_family: ClassVar[str] = "strain-cycles"

    amplitude: tuple[float, float] = (0.02, 0.06)
    ratio: tuple[float, float] = (-1.0, 0.5)
    cycles: tuple[int, int] = (2, 5)

    def model_post_init(self, _context: object) -> None:
        """Raise ConfigurationError for ranges that nothing can be drawn from."""
        require_range(self, "amplitude", 0.0)
        require_range(self, "ratio", -1.0, 1.0)
        require_range(self, "cycles", 1.0)
        if self.ratio[1] == 1.0:
            raise ConfigurationError(
                f"StrainCycles.ratio = {self.ratio!r} must stay below 1, where cycles vanish"
            )

    def draw(self, rng: np.random.Generator, count: int, steps: int) -> DrawnPaths:
        """See `PathFamily.draw`."""
        of_paths, of_directions = rng.spawn(2)
        first, last = self.cycles
        amplitude, ratio, drawn = uniform(
            of_paths, count, self.amplitude, self.ratio, (first, last + 1)
        )
        cycles = np.minimum(np.floor(drawn), last)
        time = np.linspace(0.0, 1.0, steps + 1)
        course = amplitude[:, None] * unit_cycles(ratio, cycles, time)
        return DrawnPaths(
            course[..., None] * directions(of_directions, count)[:, None, :],
            {"strain_amplitude": amplitude, "strain_ratio": ratio, "strain_cycles": cycles},
        )


def unit_cycles(ratio: Floats, cycles: Floats, time: Floats) -> Floats:
    """Triangular cycles between `ratio` and 1 that start at 0.

    Parameters
    ----------
    ratio : (path,), lower turning point
    cycles : (path,), number of cycles after the first loading
    time : (point,), pseudo-time from 0 to 1

    Returns
    -------
    (path, point)
    """
    swing = (1.0 - ratio)[:, None]
    travelled = time * (1.0 + 2.0 * cycles[:, None] * swing)
    # From the upper turning point on, the distance to the lower one is a triangular wave.
    wave = ratio[:, None] + np.abs((travelled - 1.0) % (2.0 * swing) - swing)
    return np.where(travelled < 1.0, travelled, wave)
