"""Laws of element tests: closed forms, held stresses that are held, failures that are named."""

import itertools

import numpy as np
import pytest
import torch
from driven_cells import BULK, CONSTRAINED, POISSON, SHEAR, YOUNG, Limited, elastic, learnt

from granbench.baselines.linear_elastic import LinearElasticCell
from granbench.cells.contract import Conditions
from granbench.element_test.run import run_test
from granbench.element_test.stress_control import IterationLimits
from granbench.errors import ConfigurationError
from granbench.models import find_model
from granbench.models.drucker_prager import DruckerPrager
from granbench.models.j2 import J2
from granbench.paths import ConstantMeanStress, CyclicTriaxial, RandomStrain
from granbench.paths.mixed_control import MixedControl, isotropic_stress
from granbench.paths.standard_tests import STANDARD_TESTS, find_test, strain_history
from granbench.tensors import deviatoric_stress, volumetric_strain

P0 = 1e5
YIELD = 1e5
MET = 1e-9  # the tolerance of held stresses, relative to the largest stress, in float64


def conditions(order="principal", pressures=(P0,), **scalars):
    stress = torch.stack([torch.from_numpy(isotropic_stress(p, order)) for p in pressures])
    known = {name: torch.full_like(stress[:, 0], value) for name, value in scalars.items()}
    return Conditions(stress, known)


def driven(cell, name, corners=(0.1,), steps=20, b=None, pressure=P0, **options):
    """A cell in a standard test; gives strain, stress (step, component) and the whole result."""
    history = strain_history(corners, steps)
    programme = find_test(name).programme(pressure, float(np.abs(history).max()), b)
    control = MixedControl.of_programme(programme, history, cell.order)
    test = run_test(cell, control, conditions(cell.order, (pressure,)), **options)
    assert test.failures == ()
    return test.strain[0], test.stress[0], test


# Elasticity is linear: what is left is the rounding of twenty sums, or the tolerance of the held
# stresses.


def test_oedometer_of_elasticity_has_its_modulus_and_lateral_pressure():
    for order, axial, lateral in (("principal", 0, 2), ("full", 1, 0), ("plane", 1, 0)):
        strain, stress, _ = driven(elastic(order), "oedometer")
        change = stress - stress[0]
        assert strain[-1, axial] == 0.1
        np.testing.assert_allclose(change[:, axial], CONSTRAINED * strain[:, axial], rtol=1e-12)
        np.testing.assert_allclose(
            change[1:, lateral] / change[1:, axial], POISSON / (1.0 - POISSON), rtol=1e-12
        )


@pytest.mark.parametrize("end", [0.1, -0.1])
def test_drained_triaxial_test_of_elasticity_measures_young_and_poisson(end):
    strain, stress, _ = driven(elastic(), "triaxial-drained", (end,))
    np.testing.assert_allclose(stress[:, 0] - P0, YOUNG * strain[:, 0], rtol=1e-8, atol=1e-3)
    np.testing.assert_allclose(strain[:, 1], -POISSON * strain[:, 0], rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(strain[:, 2], -POISSON * strain[:, 0], rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(stress[:, 1:], P0, rtol=MET * YOUNG * 0.1 / P0)


def test_the_linear_elastic_baseline_obeys_the_same_closed_form():
    cell = LinearElasticCell(BULK, SHEAR)
    programme = find_test("triaxial-drained").programme(P0, 0.1)
    control = MixedControl.of_programme(programme, strain_history([0.1], 10), "principal")
    test = run_test(cell, control, conditions(initial_void_ratio=0.6))
    np.testing.assert_allclose(test.stress[0, -1], [P0 + 0.1 * YOUNG, P0, P0], rtol=1e-8)
    volumetric = volumetric_strain(test.strain[0])
    # The void ratio follows the volume: 1 + e = (1 + e0) exp(-eps_v), product by product.
    expected = 1.6 * np.exp(-volumetric) - 1.0
    np.testing.assert_allclose(test.internals["void_ratio"][0], expected, rtol=1e-12)


@pytest.mark.parametrize("name", ["simple-shear", "simple-shear-drained"])
def test_simple_shear_of_elasticity_has_twice_the_shear_modulus(name):
    for order, shear in (("plane", 2), ("full", 5)):
        strain, stress, _ = driven(elastic(order), name)
        np.testing.assert_allclose(stress[:, shear], 2.0 * SHEAR * strain[:, shear], rtol=1e-12)
        np.testing.assert_allclose(stress[:, :2], P0, rtol=1e-12)  # no dilatancy
        assert strain[-1, shear] == 0.1


@pytest.mark.parametrize("b", [0.0, 0.5])
@pytest.mark.parametrize("corners", [(0.1,), (-0.1,), (0.05, -0.05, 0.02)])
@pytest.mark.parametrize("make", [learnt, lambda: J2(order="principal")], ids=["learnt", "j2"])
def test_undrained_tests_keep_their_volume(make, corners, b):
    strain, stress, _ = driven(make(), "triaxial-undrained", corners, b=b)
    assert np.abs(volumetric_strain(strain)).max() <= 1e-12
    held = b * stress[:, 0] + (1.0 - b) * stress[:, 2] - stress[:, 1]
    # 2e-5: float32 of the network, and the two weights of the row.
    assert np.abs(held).max() <= 2e-5 * np.abs(stress).max()


@pytest.mark.parametrize("b", [0.0, 0.3, 1.0])
def test_constant_p_keeps_the_mean_stress_and_b(b):
    for cell in (J2(order="principal"), elastic()):
        _, stress, test = driven(cell, "constant-p", (0.1, 0.02), b=b)
        largest = np.abs(stress).max()
        assert np.abs(stress.mean(axis=1) - P0).max() <= MET * largest
        held = b * stress[:, 0] + (1.0 - b) * stress[:, 2] - stress[:, 1]
        assert np.abs(held).max() <= 2.0 * MET * largest
        assert np.nanmax(test.held_error) <= MET


# The strength of a J2 material is the same in every test: q = sigma_Y.


@pytest.mark.parametrize(
    ("name", "end", "expected"),
    [
        ("triaxial-drained", 0.2, [P0 + YIELD, P0, P0]),
        ("triaxial-drained", -0.2, [P0 - YIELD, P0, P0]),
        ("triaxial-undrained", 0.2, [P0 + 2 / 3 * YIELD, P0 - YIELD / 3, P0 - YIELD / 3]),
        ("constant-p", -0.2, [P0 - 2 / 3 * YIELD, P0 + YIELD / 3, P0 + YIELD / 3]),
    ],
)
def test_j2_reaches_its_strength_in_triaxial_tests(name, end, expected):
    _, stress, _ = driven(J2(order="principal"), name, (end,))
    np.testing.assert_allclose(stress[-1], expected, atol=1e-8 * YIELD)


def test_j2_in_the_oedometer_keeps_its_deviator_and_gains_pressure():
    strain, stress, _ = driven(J2(order="principal"), "oedometer", (0.2,))
    assert stress[-1, 0] - stress[-1, 2] == pytest.approx(YIELD, rel=1e-12)
    assert stress[-1].mean() == pytest.approx(P0 + 1.25e6 * strain[-1].sum(), rel=1e-12)


def test_j2_between_smooth_plates():
    """Plane strain: 2/sqrt(3) sigma_Y at full flow; q/(s1 - s3) = sqrt(1 - nu + nu^2) before."""
    _, stress, _ = driven(J2(order="principal"), "biaxial", (0.2,), steps=60)
    # The out-of-plane stress relaxes elastically: at 20 % strain 7e-5 are missing.
    assert stress[-1, 0] - stress[-1, 2] == pytest.approx(2.0 / 3.0**0.5 * YIELD, rel=2e-4)
    nu = (3.0 * 1.25e6 - 2.0 * 2e6 / 2.4) / (2.0 * (3.0 * 1.25e6 + 2e6 / 2.4))
    before = stress[1:][deviatoric_stress(stress[1:]) < 0.999 * YIELD]
    assert len(before) > 5
    np.testing.assert_allclose(
        deviatoric_stress(before) / (before[:, 0] - before[:, 2]),
        (1.0 - nu + nu**2) ** 0.5, rtol=1e-8,
    )  # fmt: skip


def test_friction_in_triaxial_compression_and_extension():
    """On the cone q = M p and p = p0 +- q/3, so q = M p0/(1 -+ M/3)."""
    cell = DruckerPrager(order="principal")
    slope = cell.values()["friction_slope"]
    for end, sign in ((0.2, 1.0), (-0.2, -1.0)):
        _, stress, _ = driven(cell, "triaxial-drained", (end,))
        q = slope * P0 / (1.0 - sign * slope / 3.0)
        np.testing.assert_allclose(stress[-1], [P0 + sign * q, P0, P0], rtol=1e-8)


def test_friction_between_smooth_plates():
    """Plane-strain flow of a non-associated cone: s1 = s3 (1 + sin phi)/(1 - sin phi), where
    sin phi = 3 a r, r = sqrt(1 - 3 a_d^2)/(1 - 3 a a_d), a = M/(3 sqrt 3)."""
    cell = DruckerPrager(order="principal")
    values = cell.values()
    a, a_d = (values[f"{name}_slope"] / (3.0 * 3.0**0.5) for name in ("friction", "dilation"))
    sine = 3.0 * a * (1.0 - 3.0 * a_d**2) ** 0.5 / (1.0 - 3.0 * a * a_d)
    _, stress, _ = driven(cell, "biaxial", (0.2,))
    # The out-of-plane stress relaxes elastically: at 20 % strain 7e-5 are missing.
    assert stress[-1, 0] == pytest.approx(P0 * (1.0 + sine) / (1.0 - sine), rel=2e-4)


def test_the_plane_model_has_its_own_strength():
    _, stress, _ = driven(J2(order="plane"), "biaxial", (0.2,))
    np.testing.assert_allclose(stress[-1], [P0, P0 + YIELD, 0.0], atol=1e-8 * YIELD)


@pytest.mark.parametrize("name", ["simple-shear", "simple-shear-drained"])
def test_j2_in_simple_shear(name):
    for order, share in (("full", 3.0**-0.5), ("plane", 0.5)):
        _, stress, _ = driven(J2(order=order), name, (0.2, -0.2), steps=30)
        assert stress[:, -1].max() == pytest.approx(share * YIELD, rel=1e-9)
        assert stress[-1, -1] == pytest.approx(-share * YIELD, rel=1e-9)


def test_turning_points_make_a_loop_that_closes():
    """A perfectly plastic material repeats its stresses in a strain cycle."""
    cell = J2(order="principal")
    _, stress, _ = driven(cell, "triaxial-drained", (0.2, -0.1, 0.2), steps=80)
    first, last = stress[20], stress[-1]
    assert first[0] == pytest.approx(P0 + YIELD, rel=1e-8)
    np.testing.assert_allclose(last, first, rtol=1e-8)


def test_a_component_keeps_its_meaning_in_every_order():
    """Axial 11 is y, lateral 33 is x, and 22 points out of the plane."""
    principal = driven(J2(order="principal"), "biaxial")[1]
    full = driven(J2(order="full"), "biaxial")[1]
    np.testing.assert_allclose(full[:, [1, 2, 0]], principal, rtol=1e-12)
    assert (full[:, 3:] == 0.0).all()


def test_programmes_of_particle_tests_drive_any_cell():
    """The programme of a DEM test prescribes an element test as it is."""
    cell = elastic()
    drawn = RandomStrain(pressure=P0, seed=4)
    loops = CyclicTriaxial(
        pressure=P0, unloading_strains=(0.02,), amplitudes=(0.01,), axial_strain=0.05
    )
    for programme in (drawn, loops):
        lengths = np.linspace(0.0, programme.path_length, 30)
        control = MixedControl.of_programme(programme, lengths, "principal")
        test = run_test(cell, control, conditions())
        errors = [
            programme.stress_error(s, x) for s, x in zip(test.stress[0], lengths, strict=True)
        ]
        assert np.abs(errors).max() <= 1e-6  # 1e-9 of stresses that a hundred times exceed p0


# Newton, line search and cutting.


ROUND_TRIPS = [
    (name, order)
    for name in STANDARD_TESTS
    for order in (("full", "plane") if "shear" in name else ("principal", "full"))
]


@pytest.mark.parametrize(("name", "order"), ROUND_TRIPS)
def test_strains_of_a_mixed_test_give_the_same_stress_again(name, order):
    for cell, close in ((J2(order=order), 1e-9), (learnt(order), 1e-4)):
        _, stress, test = driven(cell, name, (0.03, -0.01), steps=12)
        again = run_test(cell, MixedControl.of_strain(order, test.strain), conditions(order))
        # The increments come back from cumulative strain with its rounding, and float32 rounds
        # each of them once more.
        np.testing.assert_allclose(again.stress[0], stress, atol=close * np.abs(stress).max())
        assert np.nanmax(test.increments) == 1.0


def test_strain_control_is_the_rollout_to_the_last_bit():
    for cell in (J2(order="full"), learnt("full")):
        rng = np.random.default_rng(0)
        strain = np.cumsum(rng.normal(0.0, 2e-3, (3, 15, 6)), axis=1)
        strain -= strain[:, :1]
        start = conditions("full", (P0, 2 * P0, 3 * P0))
        test = run_test(cell, MixedControl.of_strain("full", strain), start)
        with torch.no_grad():
            rollout = cell.rollout(torch.from_numpy(strain), start)
        np.testing.assert_array_equal(test.stress, rollout.stress.double().numpy())
        assert (test.held_error == 0.0).all()


def test_elasticity_needs_one_newton_step():
    """The first stress is off, one step of Newton meets a linear target: two calls of the cell."""
    calls = []

    class Counted(LinearElasticCell):
        def tangent(self, dstrain, state):
            calls.append(len(dstrain))
            return super().tangent(dstrain, state)

    cell = Counted(BULK, SHEAR)
    programme = ConstantMeanStress(pressure=P0, b=0.5)
    control = MixedControl.of_programme(programme, np.linspace(0.0, 0.1, 11), "principal")
    run_test(cell, control, conditions(initial_void_ratio=0.6))
    # Later steps begin where the last one went: right at once.
    assert len(calls) <= 2 + 9 * 2


def test_an_increment_that_the_cell_cannot_follow_is_divided():
    cell = Limited(largest_increment=1e-3)
    strain, stress, test = driven(cell, "triaxial-drained", (0.02,), steps=4)
    assert (test.increments[0, 1:] >= 5).all()
    np.testing.assert_allclose(stress[-1], [P0 + 0.02 * YOUNG, P0, P0], rtol=1e-8)
    np.testing.assert_allclose(strain[:, 1], -POISSON * strain[:, 0], rtol=1e-8)


@pytest.mark.parametrize("raises", [False, True])
@pytest.mark.parametrize("name", ["oedometer", "triaxial-drained"])
def test_a_point_that_fails_is_named_and_does_not_affect_the_others(name, raises):
    history = strain_history([0.02], 10)
    ends = (1.0, 0.5, 1.0)  # the second point is driven half as far, and stays within bounds
    controls = [
        MixedControl.of_programme(find_test(name).programme(P0, 0.1), share * history, "principal")
        for share in ends
    ]
    cell = Limited(largest_strain=0.0151, raises=raises)
    test = run_test(cell, MixedControl.together(controls), conditions(pressures=(P0,) * 3))
    assert [(failure.point, failure.step) for failure in test.failures] == [(0, 8), (2, 8)]
    assert all("gives no stress" in failure.reason for failure in test.failures)
    for point in (0, 2):
        assert np.isfinite(test.stress[point, :8]).all()
        assert np.isnan(test.stress[point, 8:]).all() and np.isnan(test.strain[point, 8:]).all()
        assert np.isnan(test.internals["axial"][point, 8:]).all()
    alone = run_test(cell, controls[1], conditions())
    np.testing.assert_array_equal(test.stress[1], alone.stress[0])
    assert torch.isfinite(test.state).all()


def test_a_point_without_stress_is_not_tried_beyond_the_limit():
    strained = []

    class Counted(Limited):
        def step(self, dstrain, state):
            strained.append((dstrain != 0.0).any(dim=1))
            return super().step(dstrain, state)

    history = strain_history([0.02], 10)
    programme = find_test("triaxial-drained").programme(P0, 0.1)
    controls = [
        MixedControl.of_programme(programme, share * history, "principal") for share in (1.0, 0.5)
    ]
    control, start = MixedControl.together(controls), conditions(pressures=(P0,) * 2)

    def calls(limits):
        strained.clear()
        test = run_test(Counted(largest_strain=0.0151), control, start, limits=limits)
        assert [(failure.point, failure.step) for failure in test.failures] == [(0, 8)]
        assert np.isfinite(test.stress[1]).all()
        failing, other = torch.stack(strained).sum(dim=0).tolist()
        return failing, other, test

    failing, other, limited = calls(IterationLimits(failed_calls=2))
    failing_by_default, other_by_default, default = calls(None)
    # Both points need as many calls as long as neither fails.
    assert other == other_by_default
    assert failing <= other < failing_by_default
    np.testing.assert_array_equal(limited.stress, default.stress)


@pytest.mark.parametrize("name", ["csuh", "modified-cam-clay"])
def test_held_stresses_of_a_substepped_model_are_met(name):
    cell = find_model(name)(order="principal")
    _, stress, test = driven(cell, "triaxial-drained", (0.1,), steps=20)
    np.testing.assert_allclose(stress[:, 1:], P0, rtol=2 * MET * stress.max() / P0)
    assert test.held_error.max() <= MET


def test_a_stress_beyond_the_strength_is_reported_as_missed():
    """Perfectly plastic: no strain gives a deviator above sigma_Y."""
    stress = np.full((6, 3), P0)
    stress[:, 0] += np.linspace(0.0, 2.0 * YIELD, 6)
    control = MixedControl.of_components("principal", ("11", "22", "33"), 0.0 * stress, stress)
    test = run_test(J2(order="principal"), control, conditions())
    (failure,) = test.failures
    assert failure.step == 3  # 0.4 and 0.8 sigma_Y are met, 1.2 is not
    # 0.2 sigma_Y too much, over the target of 2.2e5 Pa; increments get within 1/1024.
    assert failure.missed_by == pytest.approx(0.2 * YIELD / 2.2e5, rel=0.01)
    assert "missed by" in failure.reason
    np.testing.assert_allclose(test.stress[0, :3], stress[:3], rtol=1e-8)
    assert np.isnan(test.stress[0, 3:]).all()


def test_stress_control_of_every_component():
    """All stresses held and no strain driven, from no stress at all: Hooke's law inverted."""
    rows = np.linspace(0.0, 1.0, 5)[:, None] * np.array([3e5, 1e5, 2e5, 2e4, 0.0, -5e4])
    # Strains of components whose stress is held are not read.
    control = MixedControl.of_components(
        "full", ("xx", "yy", "zz", "yz", "xz", "xy"), np.ones_like(rows), rows
    )
    test = run_test(elastic("full"), control, conditions("full", (0.0,)))
    stress = test.stress[0, -1]
    np.testing.assert_allclose(stress, rows[-1], atol=MET * 3e5)
    expected = (stress[0] - POISSON * (stress[1] + stress[2])) / YOUNG
    assert test.strain[0, -1, 0] == pytest.approx(expected, rel=1e-8)
    assert test.strain[0, -1, 5] == pytest.approx(stress[5] / (2.0 * SHEAR), rel=1e-8)


def test_a_tighter_tolerance_is_met():
    _, stress, _ = driven(learnt(dtype=torch.float64), "triaxial-drained", tolerance=1e-13)
    assert np.abs(stress[:, 1:] - P0).max() <= 1e-13 * np.abs(stress).max()


def test_tests_run_together_as_they_run_alone():
    pressures, ratios = (5e4, 1e5, 4e5), (0.0, 0.5, 1.0)
    history = strain_history([0.08], 12)
    controls = [
        MixedControl.of_programme(
            find_test("constant-p").programme(p, 0.08, b), history, "principal"
        )
        for p, b in zip(pressures, ratios, strict=True)
    ]
    cell = J2(order="principal")
    test = run_test(cell, MixedControl.together(controls), conditions(pressures=pressures))
    for point, (control, pressure) in enumerate(zip(controls, pressures, strict=True)):
        alone = run_test(cell, control, conditions(pressures=(pressure,)))
        np.testing.assert_allclose(test.stress[point], alone.stress[0], rtol=1e-12)
    with pytest.raises(ConfigurationError, match="component order"):
        MixedControl.together([controls[0], MixedControl.of_strain("plane", np.zeros((1, 13, 3)))])


def test_a_test_continues_from_a_stored_state():
    history = strain_history([0.05, 0.02, 0.08], 22)
    programme = find_test("triaxial-drained").programme(P0, 0.1)
    whole = MixedControl.of_programme(programme, history, "principal")
    first = MixedControl.of_programme(programme, history[:12], "principal")
    second = MixedControl.of_programme(programme, history[11:] - history[11], "principal")
    for cell, close in ((J2(order="principal"), 1e-8), (learnt(), 1e-4)):
        start = conditions()
        undivided = run_test(cell, whole, start)
        half = run_test(cell, first, start)
        stored = half.state.clone()
        rest = run_test(cell, second, half.state)
        assert torch.equal(half.state, stored)
        scale = np.abs(undivided.stress).max()
        np.testing.assert_allclose(rest.stress[0], undivided.stress[0, 11:], atol=close * scale)


def test_every_step_is_reported():
    seen = []
    driven(elastic(), "oedometer", steps=7, on_step=seen.append)
    assert seen == [1, 2, 3, 4, 5, 6, 7]


def test_a_cell_and_a_test_that_do_not_fit_are_refused():
    with pytest.raises(ConfigurationError, match="elastic"):
        run_test(
            elastic("plane"), MixedControl.of_strain("full", np.zeros((1, 2, 6))),
            conditions("plane"),
        )  # fmt: skip
    for name, order in itertools.product(("triaxial-drained", "constant-p"), ("plane",)):
        with pytest.raises(ConfigurationError, match="direction 22"):
            driven(elastic(order), name)
    with pytest.raises(ConfigurationError, match="direction xy"):
        driven(elastic(), "simple-shear")
    drawn = RandomStrain(pressure=P0, seed=1, length=0.05)
    for lengths in ([0.0, 0.06], [0.0, -0.01]):
        with pytest.raises(ConfigurationError, match="random-strain"):
            MixedControl.of_programme(drawn, lengths, "principal")
