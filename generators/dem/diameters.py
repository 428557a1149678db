"""Diameters of grains that follow a grading (Algorithm 1), and their grading index (Eq 2.1).

Every grading has the same number of grains and the same solid volume, that of N equal spheres of
11.8 mm; the smallest and the largest diameter follow from them.

References
----------
Guan (2023), thesis, Section 2.1.2: Eq 2.1, Algorithm 1, Table 2.1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granbench.errors import ConfigurationError
from granbench.generators.dem.gradings import BINARY_SMALL_MASS, GradingSpec

Floats = NDArray[np.float64]

EQUAL_SPHERE_DIAMETER = 0.0118
"""Diameter of the equal spheres that have the solid volume of every grading, m."""

INTERVALS = 15
"""Number n + 1 of equidistant size intervals in Algorithm 1, which the thesis does not give. It
affects the result: within an interval the grains are spread evenly *by number*, which for beta > -1
puts less of the mass into its lower part than Eq 2.3. With 15, every d_min of Table 2.1 is met
within 2 % and the reported I_G of beta = 1 and 1.5 within 0.4 %; infinitely many would give
d_min = 6.0 mm instead of 5.7 mm and I_G = 1.55 instead of 1.48 at beta = 2.9."""

BISECTION_TOLERANCE = 1e-9
"""Relative error of the particle number at which the bisection stops. Algorithm 1 has 5e-4; the
smaller value takes twenty more cheap iterations and makes the solid volumes equal to rounding."""

FEWEST_PARTICLES = 100


@dataclass(frozen=True)
class SizeClasses:
    """Size classes, within each of which the grains are spread evenly by number.

    Parameters
    ----------
    lower, upper : (class,), relative diameters d / d_min; equal for a class of one size
    mass_fraction : (class,), sums to 1
    """

    lower: Floats
    upper: Floats
    mass_fraction: Floats

    @classmethod
    def of(cls, spec: GradingSpec) -> SizeClasses:
        """Classes of a grading: single sizes of a mono or binary one, else equal intervals."""
        if spec.kind in ("mono", "binary"):
            sizes = np.array([1.0] if spec.kind == "mono" else [1.0, spec.size_ratio])
            small = 1.0 if spec.kind == "mono" else BINARY_SMALL_MASS
            return cls(sizes, sizes, np.array([small, 1.0 - small])[: sizes.size])
        edges = np.linspace(1.0, spec.size_ratio, INTERVALS + 1)
        return cls(edges[:-1], edges[1:], np.diff(spec.mass_fraction_below(edges)))

    def mean_cube(self, fraction: Floats | float = 1.0) -> Floats:
        """Integral of x^3 over the smallest grains of each class, per grain of the class, (class,).

        For fraction = 1 it is v_i of Algorithm 1, times 6 / (pi d_min^3), for M to infinity.

        Parameters
        ----------
        fraction : (class,) or scalar, share of the grains of a class
        """
        a, h, t = self.lower, self.upper - self.lower, np.asarray(fraction)
        return t * (a**3 + t * (1.5 * a**2 * h + t * (a * h**2 + t * 0.25 * h**3)))

    def particle_numbers(self, smallest_diameter: float, solid_volume: float) -> Floats:
        """Number of particles N_i, (class,), that gives each class its share of the solid volume.

        Parameters
        ----------
        smallest_diameter : m
        solid_volume : of all grains, m3
        """
        grain_volume = math.pi / 6.0 * smallest_diameter**3 * self.mean_cube()
        return solid_volume * self.mass_fraction / grain_volume


def smallest_diameter(classes: SizeClasses, particle_count: int, solid_volume: float) -> float:
    """Find the d_min (m) at which N grains fill the solid volume, by bisection (Algorithm 1).

    Parameters
    ----------
    classes : SizeClasses
    particle_count : int, N
    solid_volume : float, V_s in m3

    Returns
    -------
    d_min : float, m
    """
    # No grain is larger than d_max or smaller than d_min, so d_min lies between these two.
    equal = (6.0 * solid_volume / (math.pi * particle_count)) ** (1.0 / 3.0)
    left, right = 0.99 * equal / classes.upper[-1], 1.01 * equal
    error = 1.0
    while error > BISECTION_TOLERANCE:
        middle = 0.5 * (left + right)
        number = classes.particle_numbers(middle, solid_volume).sum()
        # More grains than N: they are too small. (Algorithm 1 prints the branches swapped.)
        if number < particle_count:
            right = middle
        else:
            left = middle
        error = abs(number - particle_count) / particle_count
    return middle


@dataclass(frozen=True)
class Grading:
    """The grains of a specimen.

    Parameters
    ----------
    spec : GradingSpec
    diameters : (grain,), m, in random order
    """

    spec: GradingSpec
    diameters: Floats

    @property
    def solid_volume(self) -> float:
        """Volume of all grains, m3."""
        return float(math.pi / 6.0 * (self.diameters**3).sum())

    @property
    def d_min(self) -> float:
        """Smallest diameter, m."""
        return float(self.diameters.min())

    @property
    def d_max(self) -> float:
        """Largest diameter, m."""
        return float(self.diameters.max())

    @property
    def grading_index(self) -> float:
        """I_G = exp(sum w ln^2(d / dbar)), ln dbar = sum w ln d, w the mass fraction of a grain.

        Eq 2.1 has a square root over the sum; the values that the thesis reports are without it.
        """
        mass = self.diameters**3 / (self.diameters**3).sum()
        logarithm = np.log(self.diameters / self.d_min)
        return float(np.exp((mass * (logarithm - (mass * logarithm).sum()) ** 2).sum()))

    def diameter_at(self, mass_fraction: float) -> float:
        """Diameter (m) below which `mass_fraction` of the solid mass lies."""
        ordered = np.sort(self.diameters)
        mass = ordered**3 / (ordered**3).sum()
        return float(np.interp(mass_fraction, np.cumsum(mass) - 0.5 * mass, ordered))

    @property
    def d10(self) -> float:
        """Diameter (m) at 10 % by mass."""
        return self.diameter_at(0.10)

    @property
    def d30(self) -> float:
        """Diameter (m) at 30 % by mass."""
        return self.diameter_at(0.30)

    @property
    def d50(self) -> float:
        """Diameter (m) at 50 % by mass, the "average diameter" of Table 2.1."""
        return self.diameter_at(0.50)

    @property
    def d60(self) -> float:
        """Diameter (m) at 60 % by mass."""
        return self.diameter_at(0.60)

    @property
    def coefficient_of_uniformity(self) -> float:
        """C_u = d60 / d10."""
        return self.d60 / self.d10

    @property
    def coefficient_of_curvature(self) -> float:
        """C_c = d30^2 / (d10 d60)."""
        return self.d30**2 / (self.d10 * self.d60)


def realise_grading(spec: GradingSpec, particle_count: int, rng: np.random.Generator) -> Grading:
    """Choose the diameters of exactly N grains that follow a grading.

    A continuous grading is divided into N strata of equal number, and each grain has the mean
    volume of its stratum. The volume is therefore exact, and the few large grains, which have
    most of the mass of a wide grading, are not random.

    Parameters
    ----------
    spec : GradingSpec
    particle_count : int, N, at least 100
    rng : numpy.random.Generator
        Orders the grains, so that the number of a grain does not depend on its size.

    Returns
    -------
    grading : Grading, with the solid volume of N spheres of 11.8 mm

    Raises
    ------
    ConfigurationError
        If there are too few particles.
    """
    if particle_count < FEWEST_PARTICLES:
        raise ConfigurationError(
            f"particle_count is {particle_count}; grading '{spec.name}' needs at least "
            f"{FEWEST_PARTICLES} grains to be represented"
        )
    solid_volume = particle_count * math.pi / 6.0 * EQUAL_SPHERE_DIAMETER**3
    classes = SizeClasses.of(spec)
    d_min = smallest_diameter(classes, particle_count, solid_volume)
    numbers = classes.particle_numbers(d_min, solid_volume)
    if spec.kind in ("mono", "binary"):
        small = round(float(numbers[0]))
        cubes = np.where(np.arange(particle_count) < small, 1.0, spec.size_ratio**3)
    else:
        cubes = _stratum_mean_cubes(classes, numbers, particle_count)
    # Whole grains of a binary grading miss the volume by up to half a grain: scaled to fit.
    diameters = np.cbrt(cubes * 6.0 * solid_volume / (math.pi * cubes.sum()))
    return Grading(spec, rng.permutation(diameters))


def _stratum_mean_cubes(classes: SizeClasses, numbers: Floats, particle_count: int) -> Floats:
    """Mean cube of the relative diameter in N strata of equal number, (grain,)."""
    numbers = numbers * particle_count / numbers.sum()
    below = np.concatenate([[0.0], np.cumsum(numbers)])
    rank = np.arange(particle_count + 1, dtype=float)
    index = np.clip(np.searchsorted(below, rank, side="right") - 1, 0, numbers.size - 1)
    inside = np.clip((rank - below[index]) / numbers[index], 0.0, 1.0)
    chosen = SizeClasses(classes.lower[index], classes.upper[index], classes.mass_fraction[index])
    cubes_below = np.concatenate([[0.0], np.cumsum(numbers * classes.mean_cube())])[index]
    return np.diff(cubes_below + numbers[index] * chosen.mean_cube(inside))
