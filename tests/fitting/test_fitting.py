"""Fits with a known truth: values, intervals, and what the data cannot tell."""

import dataclasses

import numpy as np
import pytest
from made_tests import TRUE_J2, drained, j2, loading_and_unloading, strained

from granbench.errors import ConfigurationError, ModelError
from granbench.fitting import Effort, FitSettings, fit
from granbench.laboratory import LaboratoryTest
from granbench.models import ClassicalCell, find_model

QUICK = FitSettings(starts=4, effort=Effort(adam_iterations=3, iterations=30))


def noisy(test: LaboratoryTest, share: float, seed: int = 0) -> LaboratoryTest:
    """The test with white noise on axial stress and volume, a share of their ranges."""
    rng = np.random.default_rng(seed)
    stress, strain = test.stress.copy(), test.strain.copy()
    steps = slice(1, None)
    size = test.steps - 1
    stress[steps, 0] += share * np.ptp(stress[:, 0]) * rng.standard_normal(size)
    volume = share * np.ptp(test.volumetric_strain) * rng.standard_normal(size)
    strain[steps, 1:] += 0.5 * volume[:, None]
    return dataclasses.replace(test, stress=stress, strain=strain)


@pytest.mark.parametrize("control", ["strain", "mixed"])
def test_j2_is_recovered_from_its_own_response(control: str) -> None:
    test = drained(j2(**TRUE_J2), loading_and_unloading())
    found = fit(j2(), [test], dataclasses.replace(QUICK, control=control))
    for name, value in TRUE_J2.items():
        assert found.cell.values()[name] == pytest.approx(value, rel=1e-4)
    assert found.error < 1e-6
    assert all(found.identifiability.identifiable.values())
    assert not any("identify" in warning for warning in found.warnings)
    # Zero residuals leave no doubt: the intervals close in on the values.
    for name, (low, high) in found.interval().items():
        assert low <= found.cell.values()[name] <= high
        assert high - low < 1e-3 * TRUE_J2[name]


def test_a_strength_that_is_never_reached_is_not_identified() -> None:
    elastic = drained(j2(**TRUE_J2), loading_and_unloading(reach=0.005))
    found = fit(j2(), [elastic], QUICK)
    assert found.identifiability.identifiable == {
        "bulk_modulus": True,
        "shear_modulus": True,
        "yield_stress": False,
    }
    assert any("do not identify yield_stress" in warning for warning in found.warnings)
    assert set(found.interval()) == {"bulk_modulus", "shear_modulus"}


def test_the_axial_stress_alone_does_not_determine_both_moduli() -> None:
    # Without the volume a drained test knows Young's modulus only, one number for two.
    whole = drained(j2(**TRUE_J2), loading_and_unloading(reach=0.005))
    strain = whole.strain.copy()
    strain[:, 1:] = np.nan
    blind = dataclasses.replace(whole, strain=strain)
    settings = dataclasses.replace(QUICK, free=("bulk_modulus", "shear_modulus"))
    found = fit(j2(), [blind], settings)
    values = found.cell.values()
    young = 9.0 / (3.0 / values["shear_modulus"] + 1.0 / values["bulk_modulus"])
    true = 9.0 / (3.0 / TRUE_J2["shear_modulus"] + 1.0 / TRUE_J2["bulk_modulus"])
    assert young == pytest.approx(true, rel=1e-4)
    assert not all(found.identifiability.identifiable.values())
    assert values["yield_stress"] == j2().values()["yield_stress"]


def test_intervals_of_a_linear_model_are_those_of_linear_regression() -> None:
    # Elastic and strain-driven, p = K e_v + noise: K has the variance s^2/sum(e_v^2).
    volume = np.linspace(0.0, 0.01, 60)
    clean = strained(j2(**TRUE_J2), np.repeat(volume[:, None] / 3.0, 3, axis=1))
    noise = np.zeros_like(clean.stress)
    noise[1:] = 300.0 * np.random.default_rng(3).standard_normal((59, 3))
    test = dataclasses.replace(clean, stress=clean.stress + noise)
    settings = dataclasses.replace(QUICK, free=("bulk_modulus",), points=60, control="strain")
    found = fit(j2(), [test], settings)
    error = test.stress - test.stress[0] - found.cell.values()["bulk_modulus"] * volume[:, None]
    deviation = (error**2).sum() / (3 * 59 - 1) / (3.0 * (volume**2).sum())
    low, high = found.interval()["bulk_modulus"]
    # White noise of 59 points still correlates by chance: the count of independent points, and
    # with it the interval, is off by some 1/sqrt(59).
    assert high - low == pytest.approx(2.0 * 1.96 * deviation**0.5, rel=0.25)
    assert low < TRUE_J2["bulk_modulus"] < high


NEAR = FitSettings(starts=1, effort=Effort(adam_iterations=0, iterations=8))
"""Iterations that start from the truth: only the noise has to be followed."""


def test_intervals_cover_the_truth_at_the_stated_rate() -> None:
    clean = drained(j2(**TRUE_J2), loading_and_unloading(25))
    inside = 0
    for seed in range(10):
        intervals = fit(j2(**TRUE_J2), [noisy(clean, 0.02, seed)], NEAR).interval()
        inside += sum(low < TRUE_J2[name] < high for name, (low, high) in intervals.items())
    # 28.5 of 30 are expected; fewer than 25 come by chance once in a hundred.
    assert inside >= 25


def test_intervals_from_the_bootstrap_are_those_of_the_curvature_and_repeatable() -> None:
    test = noisy(drained(j2(**TRUE_J2), loading_and_unloading(25)), 0.02)
    curvature = fit(j2(**TRUE_J2), [test], NEAR)
    sampled = fit(j2(**TRUE_J2), [test], dataclasses.replace(NEAR, bootstrap=40))
    again = fit(j2(**TRUE_J2), [test], dataclasses.replace(NEAR, bootstrap=40))
    assert sampled.cell.values() == curvature.cell.values()
    assert again.interval() == sampled.interval()
    for name, (low, high) in curvature.interval().items():
        first, last = sampled.interval()[name]
        # Quantiles of 40 samples scatter by a third; a wrong formula is off by the points' root.
        assert 0.4 < (last - first) / (high - low) < 2.5


def test_a_left_out_test_is_predicted_and_not_fitted() -> None:
    weak, strong = j2(**TRUE_J2), j2(**{**TRUE_J2, "yield_stress": 9e4})
    fitted = drained(weak, loading_and_unloading(), name="weak")
    other = drained(strong, loading_and_unloading(), pressure=2e5, name="strong")
    found = fit(j2(), [fitted], QUICK, left_out=[other])
    assert found.cell.values()["yield_stress"] == pytest.approx(6.3e4, rel=1e-4)
    errors = {error.name: error for error in found.errors}
    assert errors["weak"].total < 1e-6
    assert errors["strong"].role == "left out"
    # q stops at 63 instead of 90 kPa for most of the test: an error of some 20 % of the range.
    assert 0.1 < errors["strong"].by_quantity["deviatoric_stress"] < 0.3
    assert found.curves["role"].values.tolist() == ["fitted", "left out"]


def test_weights_decide_between_quantities_that_disagree() -> None:
    # No J2 has the strength of one of the tests and the volume of the other.
    test = drained(j2(**TRUE_J2), loading_and_unloading(9, reach=0.005))
    wrong = dataclasses.replace(test, strain=test.strain * np.array([1.0, 0.7, 0.7]))
    errors = []
    for weight in (0.1, 10.0):
        settings = dataclasses.replace(QUICK, weights={"volumetric_strain": weight})
        found = fit(j2(), [dataclasses.replace(wrong, stress=1.1 * wrong.stress)], settings)
        errors.append(found.errors[0].by_quantity["volumetric_strain"])
    assert errors[1] <= errors[0]


def test_j2_hardening_is_recovered_from_sufficient_data() -> None:
    true = {"hardening_modulus": 4.4e5, "hardening_exponent": 0.4}
    cell = find_model("j2-hardening")
    test = drained(cell(true, order="principal"), loading_and_unloading(reach=0.2))
    found = fit(cell(order="principal"), [test], dataclasses.replace(QUICK, free=tuple(true)))
    for name, value in true.items():
        assert found.cell.values()[name] == pytest.approx(value, rel=1e-3)


TRUE_CSUH = {
    "critical_ratio": 1.35,
    "compression_slope": 0.15,
    "swelling_slope": 0.03,
    "poisson_ratio": 0.25,
    "dilatancy": 1.5,
    "critical_spacing": 0.3,
}


def csuh(**values: float) -> ClassicalCell:
    """CSUH in principal components, with the values of Toyoura sand or others."""
    return find_model("csuh")(values, parameter_set="toyoura", order="principal")


def test_csuh_finds_back_to_the_parameters_that_answered() -> None:
    """From values near by, one dense test alone, three parameters."""
    truth = {"critical_ratio": 1.3, "dilatancy": 1.6, "swelling_slope": 0.03}
    axial = loading_and_unloading(steps=6, reach=0.05)
    test = drained(csuh(**truth), axial, pressure=2e5, void_ratio=0.8)
    effort = Effort(adam_iterations=0, iterations=3)
    found = fit(csuh(), [test], FitSettings(free=tuple(truth), starts=1, effort=effort))
    for name, value in truth.items():
        assert found.cell.values()[name] == pytest.approx(value, rel=1e-2)
    assert found.error < 1e-3


@pytest.mark.slow  # about two minutes
def test_csuh_is_recovered_from_its_own_answer() -> None:
    truth = csuh(**TRUE_CSUH)
    axial = [loading_and_unloading(steps=16, reach=reach) for reach in (0.08, 0.12, 0.12, 0.15)]
    starts = [(5e4, 0.80), (2e5, 0.85), (8e5, 0.75), (1e5, 0.88)]
    tests = [
        drained(truth, path, pressure=p, void_ratio=e, name=f"{p:g} Pa, e0 {e}")
        for path, (p, e) in zip(axial, starts, strict=True)
    ]
    effort = Effort(adam_iterations=3, iterations=40)
    found = fit(csuh(), tests, FitSettings(starts=2, seed=3, effort=effort))
    known = found.identifiability.identifiable
    # Every test states its void ratio, which the overconsolidation ratio would otherwise set.
    assert [name for name, fixed in known.items() if not fixed] == ["overconsolidation_ratio"]
    values, expected = found.cell.values(), truth.values()
    for name in set(known) - {"overconsolidation_ratio"}:
        assert values[name] == pytest.approx(expected[name], rel=1e-2), name
    assert found.error < 1e-3


def test_what_cannot_be_fitted_is_refused() -> None:
    test = drained(j2(**TRUE_J2), loading_and_unloading(6))
    with pytest.raises(ConfigurationError, match="free.*cohesion.*bulk"):
        fit(j2(), [test], dataclasses.replace(QUICK, free=("cohesion",)))
    with pytest.raises(ConfigurationError, match="left_out"):
        fit(j2(), [])
    with pytest.raises(ConfigurationError, match="principal"):
        fit(find_model("j2")(order="full"), [test])
    with pytest.raises(ConfigurationError, match="weights.*stress_11"):
        fit(j2(), [test], dataclasses.replace(QUICK, weights={"stress_11": 2.0}))
    undrained = dataclasses.replace(test, kind="triaxial-undrained")
    with pytest.raises(ConfigurationError, match="triaxial-undrained.*control"):
        fit(j2(), [undrained], dataclasses.replace(QUICK, control="mixed"))
    weightless = {"deviatoric_stress": 0.0, "volumetric_strain": 0.0}
    with pytest.raises(ConfigurationError, match="weights"):
        fit(j2(), [test], dataclasses.replace(QUICK, weights=weightless))
    dry = dataclasses.replace(test, stress=test.stress - test.stress[0])
    with pytest.raises(ModelError):
        fit(find_model("csuh")(order="principal"), [dry], QUICK)


@pytest.mark.parametrize(
    "settings",
    [{"control": "stress"}, {"points": 3}, {"starts": 0}, {"bootstrap": 5}, {"spread": -1.0}],
)
def test_settings_out_of_range_are_refused(settings: dict) -> None:
    with pytest.raises(ConfigurationError, match=next(iter(settings))):
        FitSettings(**settings)
