"""Stable time steps: Table 2.3 of the thesis, and the Rayleigh bound."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from granbench.generators.dem.material import RAYLEIGH_FRACTION, ContactMaterial

GRAINS = ContactMaterial()


@pytest.mark.parametrize(
    ("smallest_diameter", "critical"),
    [
        (0.006, 7.34e-6), (0.0118, 2.02e-5), (0.009, 1.34e-5), (0.0022, 1.63e-6),
        (0.0014, 8.28e-7), (0.0031, 2.72e-6), (0.0044, 4.61e-6), (0.0051, 5.75e-6),
        (0.0057, 6.80e-6),
    ],
)  # fmt: skip
def test_critical_time_steps_are_those_of_table_2_3(smallest_diameter, critical):
    # Within the last printed digit, because the table rounds down as well as up.
    last_digit = 10 ** (math.floor(math.log10(critical)) - 2)
    assert GRAINS.critical_time_step(smallest_diameter / 2) == pytest.approx(
        critical, abs=1.01 * last_digit
    )


def test_rayleigh_time_is_the_published_formula():
    shear_modulus = 0.8e9 / 2.24
    time = math.pi * 0.0059 * math.sqrt(2600 / shear_modulus) / (0.163 * 0.12 + 0.8766)
    assert GRAINS.rayleigh_time_step(0.0059) == pytest.approx(time, rel=1e-12)


@given(radius=st.floats(1e-4, 0.1))
def test_time_step_keeps_both_bounds_and_reaches_one(radius):
    bounds = (
        RAYLEIGH_FRACTION * GRAINS.rayleigh_time_step(radius),
        GRAINS.critical_time_step(radius),
    )
    assert GRAINS.time_step(radius) == min(bounds)


def test_critical_step_governs_for_small_grains():
    large, small = 0.0118 / 2, 0.0014 / 2
    assert GRAINS.time_step(large) < GRAINS.critical_time_step(large)
    assert GRAINS.time_step(small) == GRAINS.critical_time_step(small)
