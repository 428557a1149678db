"""Shapes of the particle size distributions of Table 2.1, without scale.

A shape is a function of the relative diameter x = d / d_min, from 1 to `size_ratio`. The diameters
in metres follow from the number of grains and their solid volume
(`granbench.generators.dem.diameters`).

References
----------
Guan (2023), thesis, Section 2.1.2: Eq 2.3, Table 2.1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from granbench.errors import ConfigurationError

Floats = NDArray[np.float64]
Kind = Literal["bell", "mono", "binary", "linear", "fractal"]

BINARY_SMALL_MASS = 0.36
"""Mass fraction of the smaller size of a binary grading; not in the thesis, derived from Table 2.1
(9 mm and 18 mm) and the reported I_G = 1.117."""

LARGEST_SIZE_RATIO = 100.0
FRACTAL_DIMENSIONS = (-20.0, 6.0)
"""Range of beta; outside it whole size intervals are empty to double precision."""


@dataclass(frozen=True)
class GradingSpec:
    """The shape of a grading, without scale.

    Parameters
    ----------
    name : str
        Name of the grading in datasets.
    kind : {"bell", "mono", "binary", "linear", "fractal"}
        bell: normal by number, centred in the range, standard deviation = range / 6;
        mono: one size; binary: two sizes, `BINARY_SMALL_MASS` of the mass in the smaller;
        linear: uniform by number, so that the mass density grows as d^3; fractal: Eq 2.3, by mass.
    size_ratio : float
        d_max / d_min, dimensionless.
    fractal_dimension : float or None
        beta of Eq 2.3; only for a fractal grading.

    Raises
    ------
    ConfigurationError
        If a field is out of range; the text names it.
    """

    name: str
    kind: Kind
    size_ratio: float
    fractal_dimension: float | None = None

    def __post_init__(self) -> None:
        where = f"grading '{self.name}'"
        if self.kind not in get_args(Kind):
            raise ConfigurationError(
                f"{where}: kind '{self.kind}' is unknown; choose one of {', '.join(get_args(Kind))}"
            )
        self._check_fractal_dimension(where)
        self._check_size_ratio(where)

    def _check_fractal_dimension(self, where: str) -> None:
        beta = self.fractal_dimension
        if self.kind != "fractal":
            if beta is not None:
                raise ConfigurationError(
                    f"{where}: fractal_dimension has no meaning for kind '{self.kind}'; "
                    "leave it out or use kind 'fractal'"
                )
            return
        lowest, highest = FRACTAL_DIMENSIONS
        if beta is None or not lowest <= beta <= highest:
            raise ConfigurationError(
                f"{where}: fractal_dimension is {beta}; kind 'fractal' needs a number from "
                f"{lowest:g} to {highest:g}"
            )
        if beta >= 3.0 and math.isinf(self.size_ratio):
            raise ConfigurationError(
                f"{where}: fractal_dimension {beta:g} >= 3 with d_min = 0 (size_ratio infinite) "
                "puts all mass into grains of size 0 (Eq 2.3 diverges); choose fractal_dimension "
                "below 3 or "
                "a finite size_ratio such as 10"
            )

    def _check_size_ratio(self, where: str) -> None:
        ratio = self.size_ratio
        if math.isnan(ratio) or ratio < 1.0:
            raise ConfigurationError(
                f"{where}: size_ratio d_max/d_min is {ratio:g}; give a ratio of at least 1"
            )
        if ratio > LARGEST_SIZE_RATIO:
            raise ConfigurationError(
                f"{where}: size_ratio d_max/d_min is {ratio:g}; a fixed number of grains cannot "
                f"fill such a range (d_min tends to 0): give at most {LARGEST_SIZE_RATIO:g}"
            )
        if (self.kind == "mono") != (ratio == 1.0):
            raise ConfigurationError(
                f"{where}: size_ratio is {ratio:g}; kind 'mono' needs exactly 1 and every other "
                "kind more than 1"
            )

    def mass_fraction_below(self, relative_diameter: Floats) -> Floats:
        """Cumulative mass fraction F(d) of a continuous grading.

        Parameters
        ----------
        relative_diameter : (...), d / d_min, from 1 to `size_ratio`

        Returns
        -------
        fraction : (...), from 0 to 1

        Raises
        ------
        ConfigurationError
            If the grading is mono or binary, whose F is a step function.

        References
        ----------
        Eq 2.3 for the fractal kind. The linear kind is the same power law with beta = -1.
        """
        x, ratio = relative_diameter, self.size_ratio
        if self.kind == "bell":
            moment = _normal_third_moment(x, 0.5 * (1.0 + ratio), (ratio - 1.0) / 6.0)
            ends = _normal_third_moment(
                np.array([1.0, ratio]), 0.5 * (1.0 + ratio), (ratio - 1.0) / 6.0
            )
            return (moment - ends[0]) / (ends[1] - ends[0])
        if self.kind in ("mono", "binary"):
            raise ConfigurationError(
                f"grading '{self.name}': kind '{self.kind}' has single sizes and no continuous F(d)"
            )
        beta = -1.0 if self.fractal_dimension is None else self.fractal_dimension
        power = 3.0 - beta
        if power == 0.0:
            return np.log(x) / math.log(ratio)
        return np.expm1(power * np.log(x)) / math.expm1(power * math.log(ratio))


def _normal_third_moment(x: Floats, mean: float, deviation: float) -> Floats:
    """Integral of t^3 times the normal density from minus infinity to x, up to a constant."""
    m, s, z = mean, deviation, (x - mean) / deviation
    density = np.exp(-0.5 * z**2) / math.sqrt(2.0 * math.pi)
    return (m**3 + 3.0 * m * s**2) * ndtr(z) - (
        3.0 * m**2 * s + 3.0 * m * s**2 * z + s**3 * (z**2 + 2.0)
    ) * density


def _fractal(beta: float) -> GradingSpec:
    name = "fractal-m5.0" if beta == -5.0 else f"fractal-{beta:.1f}"
    # Table 2.1 has 5.7 and 53.2 mm at beta = 2.9, a ratio below 10.
    size_ratio = 53.2 / 5.7 if beta == 2.9 else 10.0
    return GradingSpec(name, "fractal", size_ratio=size_ratio, fractal_dimension=beta)


GRADINGS: dict[str, GradingSpec] = {
    spec.name: spec
    for spec in (
        GradingSpec("bell", "bell", size_ratio=17.5 / 6.0),
        GradingSpec("mono", "mono", size_ratio=1.0),
        GradingSpec("binary", "binary", size_ratio=2.0),
        GradingSpec("linear", "linear", size_ratio=18.0 / 2.2),
        *(_fractal(beta) for beta in (-5.0, 1.0, 1.5, 2.0, 2.5, 2.9)),
    )
}
"""Gradings of Table 2.1 by name, and fractal-1.5, which the thesis does not use for training."""
