"""Proportional strain paths: a fixed direction, followed at a constant rate."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from granbench.paths.drawn import DrawnPaths, PathFamily, directions, require_range, uniform


class ProportionalStrain(PathFamily):
    """Straight strain paths in directions uniform over (xx, yy, xy).

    Parameters
    ----------
    amplitude : range of the Frobenius norm of the strain at the end

    Raises
    ------
    ConfigurationError : the range does not rise or is not positive
    """

    loading_family: ClassVar[str] = "proportional"

    amplitude: tuple[float, float] = (0.08, 0.25)

    def model_post_init(self, _context: object) -> None:
        """Raise ConfigurationError for a range that nothing can be drawn from."""
        require_range(self, "amplitude", 0.0)

    def draw(self, rng: np.random.Generator, count: int, steps: int) -> DrawnPaths:
        """See `PathFamily.draw`."""
        of_paths, of_directions = rng.spawn(2)
        (amplitude,) = uniform(of_paths, count, self.amplitude)
        end = amplitude[:, None] * directions(of_directions, count)
        time = np.linspace(0.0, 1.0, steps + 1)
        return DrawnPaths(time[:, None] * end[:, None, :], {"strain_amplitude": amplitude})
