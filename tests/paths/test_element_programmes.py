"""Laws of the laboratory's element tests as programmes, and of their strain histories."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from granbench.errors import ConfigurationError
from granbench.paths.element_tests import (
    BiaxialCompression,
    DrainedSimpleShear,
    Oedometer,
    SimpleShear,
    UndrainedTriaxial,
)
from granbench.paths.mixed_control import MixedControl, isotropic_stress
from granbench.paths.standard_tests import STANDARD_TESTS, find_test, strain_history
from granbench.tensors import COMPONENT_ORDERS, PRINCIPAL_DIRECTIONS, mean_stress

ELEMENT = (BiaxialCompression, DrainedSimpleShear, Oedometer, SimpleShear, UndrainedTriaxial)
pressures = st.floats(1e3, 1e7)


@settings(deadline=None)
@given(name=st.sampled_from(sorted(STANDARD_TESTS)), pressure=pressures, strain=st.floats(-1, 1))
def test_every_test_starts_from_the_isotropic_state_without_strain(name, pressure, strain):
    programme = find_test(name).programme(pressure, 1.0)
    isotropic = isotropic_stress(pressure, programme.order)
    np.testing.assert_array_equal(programme.driven_strain(0.0), 0.0)
    np.testing.assert_allclose(
        programme.controlled_stresses @ isotropic, programme.targets(strain), rtol=1e-12,
        atol=1e-12 * pressure,
    )  # fmt: skip
    assert programme.stress_error(isotropic, strain) == pytest.approx(0.0, abs=1e-12)
    assert programme.free_directions.shape == programme.controlled_stresses.T.shape


@pytest.mark.parametrize("name", sorted(STANDARD_TESTS))
def test_the_driving_strain_is_the_stated_component(name):
    programme = find_test(name).programme(1e5, 0.3)
    place = COMPONENT_ORDERS[programme.order].index(programme.driving_component)
    for strain in (-0.3, 0.0, 0.1):
        assert programme.driven_strain(strain)[place] == strain
        assert not programme.free_directions[place].any()


@settings(deadline=None)
@given(b=st.floats(0.0, 1.0), strain=st.floats(-0.5, 0.5, allow_subnormal=False))
def test_what_an_undrained_test_drives_and_frees_has_no_volume(b, strain):
    programme = UndrainedTriaxial(pressure=1e5, b=b, largest_strain=0.5)
    assert programme.driven_strain(strain).sum() == 0.0
    assert programme.free_directions.sum() == 0.0
    assert programme.intermediate_stress_ratio == b


def test_held_stresses_are_held_relative_to_p0():
    biaxial = BiaxialCompression(pressure=2e5)
    assert biaxial.stress_error(np.array([9e5, 5e5, 2.2e5]), 0.1) == pytest.approx(0.1)
    sheared = DrainedSimpleShear(pressure=1e5)
    assert sheared.stress_error(np.array([9e4, 1.3e5, 9e4, 0, 0, 5e4]), 0.1) == pytest.approx(0.3)
    assert Oedometer(pressure=1e5).stress_error(np.array([9e5, 4e5, 4e5]), 0.1) == 0.0


@pytest.mark.parametrize("family", ELEMENT)
@pytest.mark.parametrize("wrong", [{"pressure": 0.0}, {"pressure": math.nan},
                                   {"largest_strain": 0.0}, {"largest_strain": 1.5}])  # fmt: skip
def test_impossible_tests_are_refused_by_field(family, wrong):
    with pytest.raises(ConfigurationError, match=rf"{family.__name__}\.{next(iter(wrong))} = "):
        family(**({"pressure": 1e5} | wrong))


@pytest.mark.parametrize("family", ELEMENT)
def test_a_test_is_its_own_plain_configuration(family):
    programme = family(pressure=1e5, largest_strain=0.3)
    assert family.model_validate(programme.model_dump(mode="json")) == programme


def test_directions_keep_the_invariants():
    """A principal stress has the same mean wherever its directions are put."""
    stress = {"11": 5e5, "22": 3e5, "33": 1e5}
    for order in ("principal", "full"):
        named = {PRINCIPAL_DIRECTIONS[order][label]: value for label, value in stress.items()}
        placed = np.array([named.get(label, 0.0) for label in COMPONENT_ORDERS[order]])
        assert mean_stress(placed, order) == pytest.approx(3e5)
    assert "22" not in PRINCIPAL_DIRECTIONS["plane"]  # out of the plane


def test_b_is_given_only_where_it_is_held():
    assert find_test("constant-p").programme(1e5, 0.1, 0.7).intermediate_stress_ratio == 0.7
    assert find_test("constant-p").programme(1e5, 0.1).intermediate_stress_ratio == 0.0
    with pytest.raises(ConfigurationError, match=r"b = 0.5 is given.*does not hold it"):
        find_test("oedometer").programme(1e5, 0.1, 0.5)


def test_an_unknown_test_and_a_strain_in_per_cent_are_named():
    with pytest.raises(ConfigurationError, match="did you mean 'oedometer'"):
        find_test("odometer")
    with pytest.raises(ConfigurationError, match="write 0.2 for 20 %"):
        find_test("oedometer").programme(1e5, 20.0)
    with pytest.raises(ConfigurationError, match="write 0.2 for 20 %"):
        find_test("oedometer").programme(1e5, math.nan)


@settings(deadline=None)
@given(
    corners=st.lists(st.floats(-0.5, 0.5).map(lambda x: round(x, 4)), min_size=1, max_size=8),
    extra=st.integers(0, 60),
)
def test_a_history_is_linear_between_its_turning_points(corners, extra):
    assume(all(a != b for a, b in zip([0.0, *corners], corners, strict=False)))
    history = strain_history(corners, len(corners) + extra)
    assert len(history) == len(corners) + extra + 1
    assert history[0] == 0.0 and history[-1] == corners[-1]
    # What it travels is what the corners demand: it meets each of them and strays nowhere.
    travelled = np.abs(np.diff(history)).sum()
    assert travelled == pytest.approx(np.abs(np.diff([0.0, *corners])).sum(), abs=1e-12)
    assert set(corners) <= set(history.tolist())
    assert (np.diff(history) != 0.0).all()


def test_a_history_of_equal_legs_has_equal_steps():
    steps = np.abs(np.diff(strain_history([0.1, -0.1, 0.2], 60)))
    np.testing.assert_allclose(steps, 0.01, rtol=1e-12)


@pytest.mark.parametrize("corners", [[], [0.0], [0.1, 0.1], [math.nan], [math.inf]])
def test_a_constant_history_is_refused(corners):
    with pytest.raises(ConfigurationError, match="cannot be visited in turn"):
        strain_history(corners, 10)


def test_a_history_needs_a_step_for_each_leg():
    with pytest.raises(ConfigurationError, match="take more steps"):
        strain_history([0.1, -0.1], 1)


def test_the_order_of_a_control_is_the_cells():
    biaxial = BiaxialCompression(pressure=1e5)
    plane = MixedControl.of_programme(biaxial, [0.0, 0.1], "plane")
    np.testing.assert_array_equal(plane.driven[0, 1], [0.0, 0.1, 0.0])
    np.testing.assert_array_equal(plane.held[0], [[1.0, 0.0, 0.0]])
    np.testing.assert_array_equal(plane.free[0].T, [[1.0, 0.0, 0.0]])
    assert plane.targets[0, 1, 0] == 1e5
