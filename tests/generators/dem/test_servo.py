"""The servo reaches its targets on elastic and on plastic bodies, within its limits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from granbench.generators.dem.servo import (
    SHEAR_OVER_BULK,
    ServoGains,
    StressServo,
    isotropic_stiffness,
)
from granbench.paths import ConstantMeanStress, ConstantMinorStress

BULK, DURATION, DRIVE = 2e7, 1e-3, 0.5
STIFFNESS = isotropic_stiffness(BULK, SHEAR_OVER_BULK * BULK)
ratios = st.floats(0.0, 1.0)
families = st.sampled_from([ConstantMeanStress, ConstantMinorStress])


def servo_of(programme, gains=None):
    return StressServo(
        programme.free_directions, programme.controlled_stresses, gains or ServoGains()
    )


@given(bulk=st.floats(1e5, 1e9), shear=st.floats(1e5, 1e9))
def test_isotropic_stiffness_is_bulk_modulus_in_volume_and_twice_the_shear_modulus_in_shape(
    bulk, shear
):
    stiffness = isotropic_stiffness(bulk, shear)
    np.testing.assert_allclose(stiffness @ np.full(3, 1 / 3), bulk, rtol=1e-12)
    shape = np.array([1.0, -1.0, 0.0])
    np.testing.assert_allclose(stiffness @ shape, 2 * shear * shape, atol=1e-9 * (bulk + shear))


@given(family=families, b=ratios)
def test_rates_are_zero_without_error_and_change_of_target(family, b):
    servo = servo_of(family(pressure=5e5, b=b))
    np.testing.assert_array_equal(servo.rates(np.zeros(2), np.zeros(2), BULK, DURATION, DRIVE), 0)


@given(family=families, b=ratios, change=st.tuples(*[st.floats(-2e3, 2e3)] * 2))
def test_change_of_target_is_fully_fed_forward(family, b, change):
    programme = family(pressure=5e5, b=b)
    gains = ServoGains(rate_limit=1e6)
    rates = servo_of(programme, gains).rates(np.zeros(2), np.array(change), BULK, DURATION, DRIVE)
    gained = programme.controlled_stresses @ STIFFNESS @ programme.free_directions @ rates
    np.testing.assert_allclose(gained * DURATION, change, atol=1e-6)


@given(family=families, b=ratios, error=st.tuples(*[st.floats(-1e9, 1e9)] * 2))
def test_rates_stay_within_their_limit(family, b, error):
    servo = servo_of(family(pressure=5e5, b=b))
    for _ in range(5):
        rates = servo.rates(np.array(error), np.zeros(2), BULK, DURATION, DRIVE)
        assert np.all(np.abs(rates) <= ServoGains().rate_limit * DRIVE * (1 + 1e-12))


def remaining_error(programme, stiffness, drift, chunks=200):
    """Largest relative error in the last ten chunks on an elastic body that dilates steadily."""
    servo, stress = servo_of(programme), np.full(3, programme.pressure)
    rates, errors = np.zeros(2), []
    for chunk in range(chunks):
        strain = np.array([DRIVE, 0.0, 0.0]) + programme.free_directions @ rates
        stress = stress + stiffness @ (strain - drift) * DURATION
        error = programme.targets(0.0) - programme.controlled_stresses @ stress
        rates = servo.rates(error, np.zeros(2), BULK, DURATION, DRIVE)
        if chunk >= chunks - 10:
            errors.append(np.abs(error).max() / programme.pressure)
    return max(errors)


@given(family=families, b=ratios, softer=st.floats(0.5, 1.5))
@settings(max_examples=25, deadline=None)
def test_servo_finds_the_steady_rate_that_dilatancy_needs(family, b, softer):
    """The plastic flow changes no stress, so that only the integral part can find it."""
    programme = family(pressure=5e5, b=b)
    flow = DRIVE * np.array([1.0, -0.55, -0.65])
    assert remaining_error(programme, softer * STIFFNESS, flow) < 1e-3


@pytest.mark.parametrize("family", [ConstantMeanStress, ConstantMinorStress])
def test_steady_rate_is_reversed_with_the_driving_rate(family):
    servo = servo_of(family(pressure=5e5, b=0.5))
    error = np.array([3e3, -1e3])
    servo.rates(error, np.zeros(2), BULK, DURATION, DRIVE)
    learnt = servo.rates(np.zeros(2), np.zeros(2), BULK, DURATION, DRIVE)
    servo.rescale(-1.0)
    turned = servo.rates(np.zeros(2), np.zeros(2), BULK, DURATION, DRIVE)
    assert np.all(learnt != 0)
    np.testing.assert_array_equal(turned, -learnt)
