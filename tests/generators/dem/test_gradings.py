"""Shapes of gradings: Eq 2.3, its limits, and invalid gradings."""

import dataclasses
import math

import numpy as np
import pytest

from granbench.errors import ConfigurationError
from granbench.generators.dem.gradings import GRADINGS, GradingSpec


@pytest.mark.parametrize("name", ["bell", "linear", "fractal-2.0"])
def test_mass_fraction_rises_from_zero_to_one(name):
    spec = GRADINGS[name]
    fraction = spec.mass_fraction_below(np.linspace(1.0, spec.size_ratio, 200))
    assert fraction[0] == pytest.approx(0.0, abs=1e-12)
    assert fraction[-1] == pytest.approx(1.0)
    assert np.all(np.diff(fraction) > 0.0)


def test_logarithmic_fractal_is_the_limit_of_its_neighbours():
    x = np.linspace(1.0, 10.0, 7)
    exact = GradingSpec("log", "fractal", 10.0, 3.0).mass_fraction_below(x)
    near = GradingSpec("near", "fractal", 10.0, 3.0 - 1e-7).mass_fraction_below(x)
    np.testing.assert_allclose(exact, near, rtol=1e-6)
    np.testing.assert_allclose(exact, np.log10(x), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(
    ("fields", "named"),
    [
        ({"size_ratio": math.inf, "fractal_dimension": 3.0}, "d_min = 0"),
        ({"size_ratio": math.inf, "fractal_dimension": 2.0}, "size_ratio"),
        ({"size_ratio": 0.5}, "size_ratio"),
        ({"size_ratio": math.nan}, "size_ratio"),
        ({"size_ratio": 1.0}, "size_ratio"),
        ({"size_ratio": 1e4}, "size_ratio"),
        ({"fractal_dimension": None}, "fractal_dimension"),
        ({"fractal_dimension": math.nan}, "fractal_dimension"),
        ({"fractal_dimension": 40.0}, "fractal_dimension"),
        ({"kind": "linear"}, "fractal_dimension"),
        ({"kind": "mono", "fractal_dimension": None}, "size_ratio"),
        ({"kind": "gap"}, "kind"),
    ],
)
def test_impossible_grading_is_refused_by_field(fields, named):
    with pytest.raises(ConfigurationError, match=named):
        dataclasses.replace(GRADINGS["fractal-2.0"], **fields)


def test_single_sizes_have_no_continuous_distribution():
    with pytest.raises(ConfigurationError, match="binary"):
        GRADINGS["binary"].mass_fraction_below(np.array([1.5]))
