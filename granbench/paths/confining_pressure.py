r"""Random confining pressures for biaxial tests (thesis, Sec 4.2.2).

A Gaussian process over x = t/end in [0, 1] with the mean p0 and the covariance

    C(x, x') = s^2 theta(x) theta(x') exp(-v_c (x - x')^2),   theta(x) = min(1, x/0.2).

The kernel of Eq 4.21 is printed with theta_k inside the exponent, which would leave the variance
at 1 Pa^2 and the start free; the text has theta_k(0) = 0 let paths start from p0 and a larger
theta_k mean a larger variance, which is what a factor in front does. How large it gets is not
said: s = 20 kPa keeps p0 = 100 kPa five standard deviations from zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granbench.errors import ConfigurationError
from granbench.paths.programme import Floats

STEPS = 100
"""Points of x at which the thesis gives pressures; they are linear in between."""

LARGEST_CURVATURE = 100.0
"""Beyond it the pressure turns between the points that it is given at."""

RAMP = 0.2
"""Share of the path over which the variance grows to its full size."""


ROUNDING = 1e-6
"""Share of its absolute sum below which an eigenvector's sum is rounding."""
ODD_SIGNS = {
    1.0: (-1, 1, -1, 1, -1),
    2.0: (-1, 1, -1),
    3.0: (-1, 1, -1, -1),
    4.0: (-1, -1, -1, -1, 1, -1),
    5.0: (1, 1, 1, -1, -1, -1),
}
"""Signs of the odd eigenvectors, largest first, in `fem-ime` and `fem-csuh` 1.0.0, by v_c.

They were left to rounding when those were made, and were found by making the records again. Other
values of v_c, and further eigenvectors, have 1."""


@dataclass(frozen=True)
class RandomConfinement:
    """A random confining pressure.

    Parameters
    ----------
    curvature : v_c of Eq 4.21; the thesis has 1 to 5
    seed : of the random numbers; the thesis has two paths for each v_c
    mean : p0, Pa, the value at the start
    deviation : s, Pa

    Raises
    ------
    ConfigurationError
        If a number is out of range.
    """

    curvature: float = 1.0
    seed: int = 0
    mean: float = 1e5
    deviation: float = 2e4

    def __post_init__(self) -> None:
        if not 0.0 < self.curvature <= LARGEST_CURVATURE:
            raise ConfigurationError(
                f"a random confinement with v_c = {self.curvature:g} cannot be drawn; v_c and "
                f"mean are above 0, and v_c is at most {LARGEST_CURVATURE:g}"
            )
        if not (0.0 < self.mean < math.inf and 0.0 <= self.deviation < math.inf):
            raise ConfigurationError(
                f"a random confinement with mean {self.mean:g} Pa and deviation "
                f"{self.deviation:g} Pa cannot be drawn; v_c and mean are above 0, and the "
                "deviation is not below it"
            )

    def pressures(self) -> tuple[Floats, Floats]:
        """X from 0 to 1, and the pressure there, Pa; (STEPS + 1,) each.

        Raises
        ------
        ConfigurationError
            If the pressure becomes negative somewhere.
        """
        x = np.linspace(0.0, 1.0, STEPS + 1)
        kernel = np.exp(-self.curvature * (x[:, None] - x) ** 2)
        # Its eigenvalues fall to rounding after some ten: a Cholesky factor does not exist.
        values, vectors = np.linalg.eigh(kernel)
        values, vectors = values[::-1].clip(0.0), vectors[:, ::-1]
        vectors = vectors * _signs(vectors, self.curvature)
        kept = values > 1e-12 * values[0]
        normals = np.random.default_rng(self.seed).standard_normal(len(x))[kept]
        process = (vectors[:, kept] * np.sqrt(values[kept])) @ normals
        pressure = self.mean + self.deviation * np.minimum(1.0, x / RAMP) * process
        if not (pressure > 0.0).all():
            raise ConfigurationError(
                f"the random confinement with v_c = {self.curvature:g} and seed {self.seed} falls "
                f"to {pressure.min():.3g} Pa; take another seed or a smaller deviation"
            )
        return x, pressure


def _signs(vectors: Floats, curvature: float) -> Floats:
    """Signs of eigenvectors (point, mode) that do not depend on the library or the processor.

    A vector that is even about the middle gets a positive sum. The sum of an odd one vanishes but
    for rounding: its first half is made positive, and then multiplied by `ODD_SIGNS`.
    """
    total, first_half = vectors.sum(axis=0), vectors[: len(vectors) // 2].sum(axis=0)
    odd = np.abs(total) < ROUNDING * np.abs(vectors).sum(axis=0)
    signs = np.where(np.where(odd, first_half, total) < 0.0, -1.0, 1.0)
    known = np.array(ODD_SIGNS.get(curvature, ()), dtype=float)
    places = np.flatnonzero(odd)[: len(known)]
    signs[places] *= known[: len(places)]
    return signs
