"""Diameters of grains: Table 2.1, Algorithm 1, Eq 2.3 and the grading index of Eq 2.1."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from granbench.errors import ConfigurationError
from granbench.generators.dem.diameters import (
    EQUAL_SPHERE_DIAMETER,
    SizeClasses,
    realise_grading,
    smallest_diameter,
)
from granbench.generators.dem.gradings import GRADINGS, GradingSpec

BETAS_RISING = ["fractal-m5.0", *(f"fractal-{b}" for b in ("1.0", "1.5", "2.0", "2.5", "2.9"))]

fractal_specs = st.builds(
    GradingSpec,
    name=st.just("drawn"),
    kind=st.just("fractal"),
    size_ratio=st.floats(1.5, 50.0),
    fractal_dimension=st.floats(-6.0, 4.0),
)


def solid_volume(particle_count):
    return particle_count * math.pi / 6.0 * EQUAL_SPHERE_DIAMETER**3


def realise(name, particle_count=3000, seed=0):
    return realise_grading(GRADINGS[name], particle_count, np.random.default_rng(seed))


@pytest.mark.parametrize("particle_count", [3000, 10_000])
@pytest.mark.parametrize(
    ("name", "reported", "tolerance"),
    [
        ("mono", 1.0, 1e-12),
        ("fractal-m5.0", 1.016, 1e-3),
        ("linear", 1.064, 1e-3),
        ("binary", 1.117, 1e-3),
        ("fractal-1.0", 1.209, 5e-3),
        ("fractal-1.5", 1.290, 5e-3),
        # The thesis drew the few largest grains at random: Table 2.1 has d_max = 9.3 d_min.
        ("fractal-2.9", 1.478, 2.5e-2),
    ],
)
def test_grading_index_is_the_reported_one(name, reported, tolerance, particle_count):
    index = realise(name, particle_count).grading_index
    assert index == pytest.approx(reported, rel=tolerance)


@pytest.mark.parametrize(
    ("name", "d_min", "d_max", "d50"),
    [
        ("bell", 6.0, 17.5, 12.5),
        ("mono", 11.8, 11.8, 11.8),
        ("binary", 9.0, 18.0, 18.0),
        ("linear", 2.2, 18.0, 15.1),
        ("fractal-m5.0", 1.4, 13.9, 12.7),
        ("fractal-1.0", 3.1, 30.8, 21.7),
        ("fractal-2.0", 4.4, 43.3, 23.5),
        ("fractal-2.5", 5.1, 50.2, 21.6),
        ("fractal-2.9", 5.7, 53.2, 18.8),
    ],
)
def test_diameters_are_those_of_table_2_1(name, d_min, d_max, d50):
    """The two digits of the table allow 3 %, and its d_max drawn at random (beta 2.9) 6 %."""
    spec, grading = GRADINGS[name], realise(name, 10_000)
    nominal = 1e3 * smallest_diameter(SizeClasses.of(spec), 10_000, solid_volume(10_000))
    assert nominal == pytest.approx(d_min, rel=0.03)
    assert 1e3 * grading.d_max == pytest.approx(d_max, rel=0.06 if name == "fractal-2.9" else 0.025)
    assert 1e3 * grading.d50 == pytest.approx(d50, rel=0.03)


@pytest.mark.parametrize("name", GRADINGS)
@pytest.mark.parametrize("particle_count", [100, 3000, 10_000])
def test_number_and_solid_volume_are_those_of_the_equal_spheres(name, particle_count):
    grading = realise(name, particle_count)
    assert grading.diameters.shape == (particle_count,)
    assert grading.solid_volume == pytest.approx(solid_volume(particle_count), rel=1e-12)


def test_grading_index_grows_with_the_fractal_dimension():
    # For equal ratios of largest to smallest size; that of beta = 2.9 is smaller (Table 2.1).
    index = [realise(name).grading_index for name in BETAS_RISING[:-1]]
    assert all(a < b for a, b in itertools.pairwise(index))


@pytest.mark.parametrize("name", GRADINGS)
def test_few_grains_represent_the_grading_of_many(name):
    few, many = realise(name, 3000), realise(name, 100_000)
    assert few.grading_index == pytest.approx(many.grading_index, rel=3e-3)
    assert few.d50 == pytest.approx(many.d50, rel=3e-3)
    # For beta = 2.9, only about eight grains of 10,000 are in the top tenth.
    assert few.d_max == pytest.approx(many.d_max, rel=0.04 if name == "fractal-2.9" else 0.02)


@given(fractal_specs, st.integers(100, 3000))
@settings(max_examples=40, deadline=None)
def test_bisection_finds_the_diameter_that_gives_the_number(spec, particle_count):
    classes, volume = SizeClasses.of(spec), solid_volume(particle_count)
    d_min = smallest_diameter(classes, particle_count, volume)
    number = classes.particle_numbers(d_min, volume).sum()
    assert number == pytest.approx(particle_count, rel=2e-9)
    assert classes.particle_numbers(0.99 * d_min, volume).sum() > number
    assert d_min <= EQUAL_SPHERE_DIAMETER <= d_min * spec.size_ratio


@given(fractal_specs)
@settings(max_examples=40, deadline=None)
def test_realised_grains_follow_eq_2_3_at_the_interval_ends(spec):
    """Algorithm 1 differs from Eq 2.3 within an interval, but not at its ends."""
    particle_count = 20_000
    grading = realise_grading(spec, particle_count, np.random.default_rng(0))
    classes = SizeClasses.of(spec)
    d_min = smallest_diameter(classes, particle_count, solid_volume(particle_count))
    ends, beta = classes.upper[:-1], spec.fractal_dimension
    power = 3.0 - beta if abs(3.0 - beta) > 1e-9 else 1e-9
    by_mass = (ends**power - 1.0) / (spec.size_ratio**power - 1.0)
    ordered = np.sort(grading.diameters)
    mass = np.cumsum(ordered**3) / np.sum(ordered**3)
    below = np.interp(ends, ordered / d_min, mass)
    # A grain at the end of an interval changes F by at most its own mass.
    largest_share = 2.0 * ordered[-1] ** 3 / np.sum(ordered**3)
    np.testing.assert_allclose(below, by_mass, atol=largest_share + 1e-6)


@given(fractal_specs, st.integers(100, 2000))
@settings(max_examples=40, deadline=None)
def test_diameters_stay_in_the_range_and_use_it(spec, particle_count):
    grading = realise_grading(spec, particle_count, np.random.default_rng(0))
    d_min = smallest_diameter(SizeClasses.of(spec), particle_count, solid_volume(particle_count))
    assert np.all(np.isfinite(grading.diameters))
    assert grading.d_min >= d_min * (1.0 - 1e-6)
    assert grading.d_max <= d_min * spec.size_ratio * (1.0 + 1e-6)
    assert grading.grading_index <= math.exp(0.25 * math.log(spec.size_ratio) ** 2)


def test_bell_is_normal_by_number():
    diameters = realise("bell", 20_000).diameters
    low, high = diameters.min(), diameters.max()
    middle = 0.5 * (low + high)
    assert diameters.mean() == pytest.approx(middle, rel=5e-3)
    # Range / 6, slightly increased by the uniform spread within the intervals of Algorithm 1.
    assert diameters.std() == pytest.approx((high - low) / 6.0, rel=0.03)


def test_linear_is_even_by_number():
    counts, _ = np.histogram(realise("linear", 10_000).diameters, bins=20)
    np.testing.assert_allclose(counts, 500, rtol=0.03)


def test_binary_has_two_sizes_and_36_percent_of_mass_in_the_small():
    grading = realise("binary", 10_000)
    small, large = np.unique(grading.diameters)
    assert large == pytest.approx(2.0 * small)
    cubes = grading.diameters**3
    assert cubes[grading.diameters == small].sum() / cubes.sum() == pytest.approx(0.36, abs=1e-3)


def test_characteristic_diameters_of_the_mono_grading_are_all_one():
    grading = realise("mono")
    found = [grading.d10, grading.d30, grading.d50, grading.d60, grading.d_min, grading.d_max]
    np.testing.assert_allclose(found, EQUAL_SPHERE_DIAMETER, rtol=1e-12)
    assert grading.coefficient_of_uniformity == pytest.approx(1.0)
    assert grading.coefficient_of_curvature == pytest.approx(1.0)


def test_characteristic_diameters_of_the_linear_grading_follow_its_power_law():
    grading, ratio = realise("linear", 10_000), GRADINGS["linear"].size_ratio
    for fraction, found in ((0.1, grading.d10), (0.3, grading.d30), (0.6, grading.d60)):
        exact = (1.0 + fraction * (ratio**4 - 1.0)) ** 0.25 / ratio * grading.d_max
        assert found == pytest.approx(exact, rel=5e-3)
    assert grading.coefficient_of_uniformity == pytest.approx(grading.d60 / grading.d10)


def test_seed_affects_only_the_order():
    first, again, other = (realise("fractal-1.5", seed=s).diameters for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    np.testing.assert_array_equal(np.sort(first), np.sort(other))


def test_too_few_particles_are_refused():
    with pytest.raises(ConfigurationError, match="particle_count"):
        realise("bell", 99)
