"""Void ratios and intercepts of CSUH against their published forms."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from textbook_csuh import surface_factor
from torch import Tensor

from granbench.models.csuh import formulas

ROUNDING = 1e-12
"""Tolerance of about ten operations, whose logarithms and powers lose a few digits."""

KPA = 1e3

stresses = st.floats(1.0, 5e3)  # kPa
critical_ratios = st.floats(0.3, 2.5)
shares = st.floats(0.0, 0.95)
"""Shares of the meaningful range of a stress ratio or a parameter."""


def number(value: float) -> Tensor:
    return torch.tensor(value, dtype=torch.float64)


def steepest(critical: float, chi: float) -> float:
    """Slope of the cone of all yield surfaces, M/sqrt(chi), or 5 M if chi is not positive."""
    return critical / math.sqrt(chi) if chi > 0.0 else 5.0 * critical


@st.composite
def surfaces(draw) -> tuple[float, float, float, float, float]:
    """p and p_s in kPa, eta, M and chi of a yield surface."""
    critical, chi = draw(critical_ratios), draw(st.floats(-0.5, 0.9))
    eta = draw(shares) * min(steepest(critical, chi), 3.0 * critical)
    return draw(stresses), draw(st.floats(0.0, 3e3)), eta, critical, chi


# Numbers that the sources print.


def test_toyoura_sand_has_the_published_inflection_pressure():
    low = formulas.low_pressure_intercept(1.973, 0.934, 0.135)
    p_s = formulas.inflection_pressure(number(1.973), number(low), number(0.135))
    # The 2201 kPa that the source prints to the unit is exp((N - Z)/lambda) = 1 + p_s.
    assert 1.0 + float(p_s) / KPA == pytest.approx(2201.0, abs=0.5)


def test_inflection_pressure_has_two_forms():
    # p_s = exp((N - Z)/lambda) - 1 = exp((N - e_c0)/lambda) with Z = N - lambda ln(1 + p_s), kPa.
    low = formulas.low_pressure_intercept(1.973, 0.934, 0.135)
    p_s = math.exp((1.973 - 0.934) / 0.135)
    assert low == pytest.approx(1.973 - 0.135 * math.log(1.0 + p_s), rel=ROUNDING)
    by_intercepts = formulas.inflection_pressure(number(1.973), number(low), number(0.135))
    assert float(by_intercepts) / KPA == pytest.approx(p_s, rel=ROUNDING)


def test_one_line_of_compression_has_no_inflection():
    """N = Z is clay; a fit may overshoot to Z > N, and stays there."""
    for low in (1.9, 2.0):
        assert float(formulas.inflection_pressure(number(1.9), number(low), number(0.1))) == 0.0


def line(p: float, eta: float, critical: float, chi: float, low: float, p_s: float) -> float:
    """e_eta as published, kPa, for lambda = 0.135 and kappa = 0.04."""
    surface = surface_factor(eta, critical, chi)
    return (
        low
        - 0.135 * math.log((p + p_s) / (1.0 + p_s))
        - (0.135 - 0.04) * math.log((surface * p + p_s) / (p + p_s))
    )


def toyoura_line(p: float, chi: float = 0.4) -> float:
    """e_cs of Toyoura sand by the module, p in kPa."""
    low, p_s = formulas.low_pressure_intercept(1.973, 0.934, 0.135), 1e3 * math.exp(1.039 / 0.135)
    intercept = formulas.intercept_in_pascal(number(low), number(0.135), number(p_s))
    slopes = (number(0.04), number(0.095))
    surface = number(2.0 / (1.0 - chi) * p * KPA + p_s)  # at eta = M
    found = formulas.reference_void_ratio(number(p * KPA), surface, intercept, *slopes, number(p_s))
    return float(found)


def test_without_pressure_the_critical_void_ratio_is_the_one_that_the_source_measured():
    # ln((p + p_s)/p_s) is 5e-10 at 1e-6 kPa.
    assert toyoura_line(1e-6) == pytest.approx(0.934, abs=1e-9)


def test_toyoura_sand_at_a_void_ratio_of_0_833_is_critical_at_977_kpa():
    # Given to the unit; the line falls by 5e-5 a kPa, so that half a unit is 3e-5 in e.
    assert toyoura_line(977.0) == pytest.approx(0.833, abs=3e-5)
    assert pytest.approx(1221.0, abs=0.5) == 1.25 * 977.0


# Forms that are the same.


@given(surface=surfaces(), low=st.floats(-1.0, 2.0))
def test_the_reference_void_ratio_is_the_published_one(surface, low):
    """Sorted by its logarithms, and with Z moved from kPa to Pa."""
    p, p_s, eta, critical, chi = surface
    through = surface_factor(number(eta), critical, chi)
    found = formulas.reference_void_ratio(
        number(p * KPA),
        through * p * KPA + p_s * KPA,
        formulas.intercept_in_pascal(number(low), number(0.135), number(p_s * KPA)),
        number(0.04),
        number(0.095),
        number(p_s * KPA),
    )
    # Terms of up to some 2 are subtracted.
    assert float(found) == pytest.approx(line(p, eta, critical, chi, low, p_s), abs=1e-12)


@given(p=stresses, chi=st.floats(-0.5, 0.9), critical=critical_ratios)
def test_the_critical_state_line_is_the_line_of_the_critical_ratio(p, chi, critical):
    low, p_s = formulas.low_pressure_intercept(1.973, 0.934, 0.135), math.exp(1.039 / 0.135)
    assert toyoura_line(p, chi) == pytest.approx(
        line(p, critical, critical, chi, low, p_s), abs=1e-12
    )
    # There A = 2/(1 - chi).
    surface = surface_factor(critical, critical, chi)
    assert surface == pytest.approx(2.0 / (1.0 - chi), rel=ROUNDING)
