"""The two roundings: idempotent, exact in single precision, within their error bounds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from granbench.records.rounding import MANTISSA_BITS, keep_mantissa, on_grid

SPACING = 2.0**-20
BITS = 16
FINITE = st.floats(-1e30, 1e30, allow_subnormal=False)


@given(arrays(float, 40, elements=st.floats(-15.0, 15.0)))
def test_multiples_of_a_grid_and_their_differences_are_unchanged(values) -> None:
    gridded = on_grid(values, SPACING)
    assert gridded.dtype == np.float32
    assert np.abs(gridded - values).max() <= SPACING / 2.0
    np.testing.assert_array_equal(on_grid(gridded, SPACING), gridded)
    multiples = gridded.astype(float) / SPACING
    np.testing.assert_array_equal(multiples, np.round(multiples))
    exact = gridded.astype(float)
    near = np.abs(np.diff(exact)) < 16.0
    np.testing.assert_array_equal(np.diff(gridded)[near].astype(float), np.diff(exact)[near])


@given(arrays(float, 40, elements=FINITE), st.integers(8, MANTISSA_BITS - 1))
def test_kept_bits_bound_the_relative_error(values, bits: int) -> None:
    kept = keep_mantissa(values, bits)
    # The first rounding is to single precision, where magnitudes below 1e-38 lose more.
    normal = np.abs(values) > 1e-36
    error = np.abs(kept.astype(float) - values)[normal]
    assert (error <= (2.0 ** -(bits + 1) + 2.0**-24) * np.abs(values)[normal]).all()
    np.testing.assert_array_equal(keep_mantissa(kept, bits), kept)


def test_fewer_bits_follow_from_more_but_for_ties() -> None:
    """Rounding to 16 and then to 15 bits differs from rounding to 15 by at most one step."""
    values = np.random.default_rng(0).standard_normal(10_000)
    at_once = keep_mantissa(values, BITS - 1).astype(float)
    twice = keep_mantissa(keep_mantissa(values, BITS), BITS - 1).astype(float)
    assert (np.abs(twice - at_once) <= 2.0 ** -(BITS - 1) * np.abs(values) * 1.01).all()
    # Half of the values with 16 bits lie halfway between two with 15; of what was rounded to
    # one of those, half came from the side that ties to even do not take.
    assert (twice != at_once).mean() == pytest.approx(0.25, abs=0.02)


def test_signs_and_nan_are_unchanged() -> None:
    special = np.array([0.0, -0.0, np.nan, np.inf, -np.inf, 1e300, -1.5])
    kept = keep_mantissa(special, BITS)
    assert np.signbit(kept[1]) and not np.signbit(kept[0])
    assert np.isnan(kept[2:6]).all()  # float32 cannot hold the others
    assert kept[6] == -1.5
    gridded = on_grid(special[:3], SPACING)
    assert gridded[0] == 0.0 and np.isnan(gridded[2])
