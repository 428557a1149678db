"""Bounds of material parameters and their unconstrained form."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from granbench.errors import ModelError
from granbench.models import Parameter

BELOW = Parameter("stiffness", "K", "Pa", "bulk modulus")
ABOVE_ONE = Parameter("ratio", "OCR", "1", "overconsolidation ratio", 1.0)
BETWEEN = Parameter("poisson_ratio", "nu", "1", "Poisson's ratio", -1.0, 0.5)
FREE = Parameter("intercept", "N", "1", "intercept", -math.inf)
ALL = (BELOW, ABOVE_ONE, BETWEEN, FREE)
REFERENCE = {BELOW: 1.25e6, ABOVE_ONE: 120.0, BETWEEN: 0.2, FREE: -0.769}

moves = st.floats(-30.0, 30.0)


def constrained(parameter: Parameter, free: float) -> float:
    number = torch.tensor(free, dtype=torch.float64)
    return float(parameter.constrained(number, REFERENCE[parameter]))


@pytest.mark.parametrize("parameter", ALL, ids=lambda parameter: parameter.name)
def test_where_nothing_moved_the_value_is_the_reference(parameter):
    # One rounding where the bound below is neither zero nor infinite.
    assert constrained(parameter, 0.0) == pytest.approx(REFERENCE[parameter], rel=3e-16)


@pytest.mark.parametrize("parameter", ALL, ids=lambda parameter: parameter.name)
@given(first=moves, second=moves)
def test_values_stay_within_their_bounds_and_grow_with_the_free_number(parameter, first, second):
    low, high = sorted([first, second])
    values = constrained(parameter, low), constrained(parameter, high)
    # Thirty is far out: the bound itself is reached in the last bits.
    assert parameter.lower <= values[0] <= values[1] <= parameter.upper


@pytest.mark.parametrize("parameter", ALL, ids=lambda parameter: parameter.name)
def test_the_free_number_is_of_the_size_of_a_relative_change(parameter):
    free = torch.zeros((), dtype=torch.float64, requires_grad=True)
    parameter.constrained(free, REFERENCE[parameter]).backward()
    assert 0.5 < float(free.grad) / abs(REFERENCE[parameter]) < 3.0


def test_a_parameter_that_begins_at_zero_can_leave_it():
    assert float(FREE.constrained(torch.tensor(0.3), 0.0)) == pytest.approx(0.3, rel=1e-6)


@pytest.mark.parametrize(
    ("parameter", "value", "message"),
    [
        (BELOW, 0.0, r"'stiffness' \(K, Pa\) is 0 but must be above 0"),
        (BETWEEN, 0.5, "is 0.5 but must be between -1 and 0.5, both excluded"),
        (FREE, math.inf, "is inf but must be a finite number"),
    ],
)
def test_a_value_out_of_range_is_refused(parameter, value, message):
    with pytest.raises(ModelError, match=message):
        parameter.check(value, "model")
