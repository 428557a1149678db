"""The formula set of CSUH against its published forms, its derivatives and its limits."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from granbench.models.csuh import formulas

ROUNDING = 1e-12
"""Of a formula with some ten operations, the logarithms and powers of which lose a few digits."""

KPA = 1e3

stresses = st.floats(1.0, 5e3)  # kPa
critical_ratios = st.floats(0.3, 2.5)
shares = st.floats(0.0, 0.95)
"""Of a stress ratio or a parameter, of the range in which it means something."""


def number(value: float) -> Tensor:
    return torch.tensor(value, dtype=torch.float64)


def steepest(critical: float, chi: float) -> float:
    """The cone that yield surfaces lie in: eta^2 < M^2/chi, or five times M where chi is none."""
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
    surface = 1.0 + (1.0 + chi) * eta**2 / (critical**2 - chi * eta**2)
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
    found = formulas.critical_void_ratio(
        number(p * KPA), number(chi), intercept, *slopes, number(p_s)
    )
    return float(found)


def test_without_pressure_the_critical_void_ratio_is_the_one_that_the_source_measured():
    # ln((p + p_s)/p_s) is 5e-10 at 1e-6 kPa.
    assert toyoura_line(1e-6) == pytest.approx(0.934, abs=1e-9)


def test_toyoura_sand_at_a_void_ratio_of_0_833_is_critical_at_977_kpa():
    # Given to the unit; the line falls by 5e-5 a kPa, so that half a unit is 3e-5 in e.
    assert toyoura_line(977.0) == pytest.approx(0.833, abs=3e-5)
    assert pytest.approx(1221.0, abs=0.5) == 1.25 * 977.0


# Forms that are the same.


@given(surface=surfaces())
def test_the_surface_factor_is_the_published_one(surface):
    _, _, eta, critical, chi = surface
    found = formulas.surface_factor(number(eta**2), number(critical**2), number(chi))
    published = 1.0 + (1.0 + chi) * eta**2 / (critical**2 - chi * eta**2)
    assert float(found) == pytest.approx(published, rel=ROUNDING / 0.09)  # M^2 - chi eta^2 cancels


@given(critical=critical_ratios, log_r=st.floats(-40.0, 3.0))
def test_the_failure_ratio_is_the_published_one(critical, log_r):
    found = formulas.failure_ratio(number(critical), number(math.exp(log_r)))
    # 6 (sqrt(k/R (1 + k/R)) - k/R), where k/R is not so large that the difference drowns.
    over = critical**2 / (12.0 * (3.0 - critical)) / math.exp(log_r)
    if over < 1e3:
        published = 6.0 * (math.sqrt(over * (1.0 + over)) - over)
        # The published form loses over^2 of its digits, which is why it is not computed with.
        assert float(found) == pytest.approx(published, rel=1e-14 * (100.0 + over**2))
    assert 0.0 < float(found) <= 3.0


@given(critical=critical_ratios)
def test_at_the_reference_void_ratio_failure_and_dilation_begin_at_the_critical_ratio(critical):
    failure = formulas.failure_ratio(number(critical), number(1.0))
    assert float(failure) == pytest.approx(critical, rel=ROUNDING)
    square = formulas.characteristic_square(number(critical**2), number(1.8), number(0.0))
    assert float(square) == critical**2


@given(critical=critical_ratios, state=st.floats(1e-3, 0.5), m=st.floats(0.1, 30.0))
def test_dense_material_fails_above_the_critical_ratio_and_dilates_below_it(critical, state, m):
    """And loose material the other way round; `state` is |xi|."""
    for xi, above in ((state, True), (-state, False)):
        failure = formulas.failure_ratio(number(critical), number(math.exp(-xi / 0.095)))
        characteristic = formulas.characteristic_square(number(critical**2), number(m), number(-xi))
        assert float(characteristic) == pytest.approx(
            (critical * math.exp(-m * xi)) ** 2, rel=ROUNDING
        )
        assert (float(failure) > critical) is above
        assert (float(characteristic) < critical**2) is above


@given(surface=surfaces(), low=st.floats(-1.0, 2.0))
def test_the_reference_void_ratio_is_the_published_one(surface, low):
    """Sorted by its logarithms, and with Z moved from kPa to Pa."""
    p, p_s, eta, critical, chi = surface
    through = formulas.surface_factor(number(eta**2), number(critical**2), number(chi))
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
    surface = formulas.surface_factor(number(critical**2), number(critical**2), number(chi))
    assert float(surface) == pytest.approx(2.0 / (1.0 - chi), rel=ROUNDING)


@given(compression=critical_ratios)
def test_the_critical_ratio_in_extension_is_three_quarters_of_that_in_compression(compression):
    at = torch.tensor([1.0, 0.0, -1.0], dtype=torch.float64)
    found = formulas.critical_ratio(number(compression), at)
    published = [18.0 / (18.0 + 3.0 * (1.0 - z)) for z in (1.0, 0.0, -1.0)]
    np.testing.assert_allclose(found / compression, published, rtol=ROUNDING)
    assert published[2] == 0.75


# Derivatives.


def excess(p: Tensor, q: Tensor, critical: float, chi: float, p_s: float) -> Tensor:
    """What of f depends on the stress: ln(A p + p_s), Pa."""
    eta2 = (q / p) ** 2
    surface = 1.0 + (1.0 + chi) * eta2 / (critical**2 - chi * eta2)
    return torch.log(surface * p + p_s)


@given(surface=surfaces())
@settings(deadline=None)
def test_the_gradient_of_the_yield_surface_is_that_of_automatic_differentiation(surface):
    p, p_s, eta, critical, chi = surface
    stress = [number(p * KPA).requires_grad_(), number(eta * p * KPA).requires_grad_()]
    expected = torch.autograd.grad(excess(*stress, critical, chi, p_s * KPA), stress)
    numbers = [number(value) for value in (p * KPA, eta, critical, chi, p_s * KPA)]
    found = formulas.yield_gradient(*numbers)
    size = 1.0 / (p * KPA)
    for mine, theirs in zip(found, expected, strict=True):
        # The published form divides twice by M^2 - chi eta^2, down to a tenth of M^2.
        torch.testing.assert_close(mine, theirs, rtol=1e-10, atol=1e-12 * size)


@given(surface=surfaces())
def test_the_gradient_of_the_yield_surface_is_that_of_finite_differences(surface):
    p, p_s, eta, critical, chi = (number(value) for value in surface)
    p, p_s = p * KPA, p_s * KPA
    step = 1e-5 * p
    pressure = [excess(p + sign * step, eta * p, critical, chi, p_s) for sign in (1.0, -1.0)]
    deviator = [excess(p, eta * p + sign * step, critical, chi, p_s) for sign in (1.0, -1.0)]
    for found, (more, less) in zip(
        formulas.yield_gradient(p, eta, critical, chi, p_s), (pressure, deviator), strict=True
    ):
        # Curvature grows towards the cone's edge, at worst as 1/(0.1)^3: 1e-10 of that, and the
        # rounding of ln 1e7 over 1e-5.
        assert float(found * p) == pytest.approx(
            float((more - less) / (2.0 * step) * p), rel=1e-6, abs=1e-7
        )


@given(surface=surfaces())
def test_numerator_and_denominator_make_the_gradient(surface):
    """D of closed_forms: p (M^2 - chi eta^2)(M^2 + eta^2 + (M^2 - chi eta^2) p_s/p)."""
    p, p_s, eta, critical, chi = surface
    cone = critical**2 - chi * eta**2
    published = p * cone * (critical**2 + eta**2 + cone * p_s / p)
    arguments = [number(value) for value in (p, eta**2, critical**2, chi, p_s)]
    denominator = formulas.yield_denominator(*arguments)
    assert float(denominator) == pytest.approx(published, rel=ROUNDING)
    numerator = formulas.yield_numerator(*arguments[1:4])
    expanded = critical**4 - (1.0 + 3.0 * chi) * critical**2 * eta**2 - chi * eta**4
    assert float(numerator) == pytest.approx(expanded, rel=ROUNDING, abs=ROUNDING * critical**4)


def test_nothing_is_singular_where_the_published_forms_are():
    """At eta = 0, at eta = M_c and at xi = 0; and at p_s = 0."""
    zero, one = torch.zeros(1, dtype=torch.float64), torch.ones(1, dtype=torch.float64)
    for eta in (zero, 1.25 * one):
        for p_s in (zero, 2e6 * one):
            values = [
                1e5 * one,
                eta.clone(),
                1.25 * one,
                0.4 * one,
                p_s.clone(),
            ]
            for value in values:
                value.requires_grad_()
            df_dp, df_dq = formulas.yield_gradient(*values)
            gradients = torch.autograd.grad(df_dp.sum() + df_dq.sum(), values)
            assert all(torch.isfinite(gradient).all() for gradient in (df_dp, df_dq, *gradients))
    # On the p axis the surface is met head on.
    df_dp, df_dq = formulas.yield_gradient(1e5 * one, zero, 1.25 * one, 0.4 * one, 2e6 * one)
    assert float(df_dp) == pytest.approx(1.0 / 2.1e6, rel=ROUNDING)
    assert float(df_dq) == 0.0


def test_very_dense_material_has_a_failure_ratio_of_three():
    """R = 0: tension is what fails it; the published form is infinity minus infinity there."""
    r = torch.zeros(1, dtype=torch.float64, requires_grad=True)
    failure = formulas.failure_ratio(number(1.25), r)
    failure.backward()
    assert float(failure.detach()) == 3.0
    assert torch.isfinite(r.grad).all()
