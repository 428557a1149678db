"""Fits that go wrong: what is lost costs most, what is not known is null, no fit is an error."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from made_tests import TRUE_J2, drained, j2, loading_and_unloading

from granbench.cells.contract import Conditions
from granbench.element_test.run import run_test
from granbench.errors import ConfigurationError, ModelError
from granbench.fitting import Effort, FitSettings, fit
from granbench.fitting.curves import TestError
from granbench.fitting.judgement import require_followed
from granbench.fitting.least_squares import LOST, _weighted_errors, shortened
from granbench.fitting.observations import batches_of
from granbench.fitting.report import report_of, write_report
from granbench.fitting.uncertainty import laplace
from granbench.laboratory import LaboratoryTest
from granbench.models import find_model
from granbench.paths.mixed_control import MixedControl


def test_large_errors_grow_smoothly_and_never_beyond_a_lost_point() -> None:
    ranges = torch.linspace(-3.0, 3.0, 601, dtype=torch.float64).requires_grad_()
    short = shortened(ranges)
    (slope,) = torch.autograd.grad(short.sum(), ranges)
    assert bool((slope > 0.0).all()) and bool((slope <= 1.0).all())
    assert float(slope.detach().diff().abs().max()) < 0.02
    inside = ranges.detach().abs() <= 1.0
    torch.testing.assert_close(short[inside], ranges[inside])
    assert float(shortened(torch.tensor(1e12)).abs()) <= LOST


def test_losing_a_point_costs_more_than_missing_it_by_far() -> None:
    test = drained(j2(**TRUE_J2), loading_and_unloading())
    (batch,) = batches_of([test])
    right = batch.observed[None].clone()
    costs = []
    for spoil in (1e6, torch.nan):
        predicted = right.clone()
        predicted[0, 0, -3:] = predicted[0, 0, -3:] + spoil * batch.scale[0]
        costs.append(float((_weighted_errors(predicted, batch) ** 2).sum()))
    assert costs[1] > costs[0] > 0.0
    # The fewer are lost, the better: a search gains by following further.
    further = right.clone()
    further[0, 0, -2:] = torch.nan
    assert float((_weighted_errors(further, batch) ** 2).sum()) < costs[1]


def test_a_model_that_follows_nothing_is_no_fit() -> None:
    lost = TestError("t", "fitted", "mixed", 10, 20.0, {}, 8)
    with pytest.raises(ModelError, match="cannot follow t.* 2 of 10 points"):
        require_followed(j2(), [lost])
    require_followed(j2(), [TestError("t", "fitted", "mixed", 10, 1.0, {}, 2)])


def test_unknown_correlations_are_null(tmp_path: Path) -> None:
    test = drained(j2(**TRUE_J2), loading_and_unloading())
    settings = FitSettings(starts=1, effort=Effort(adam_iterations=0, iterations=1))
    found = fit(j2(), [test], settings)
    found.uncertainty.correlation[0, 1] = np.nan
    path = write_report(report_of(found, settings, [test], []), tmp_path / "fit.json")
    assert json.loads(path.read_text())["uncertainty"]["correlation"][0][1] is None


def test_a_flat_problem_has_no_correlations_and_no_crash() -> None:
    test = drained(j2(**TRUE_J2), loading_and_unloading())
    batches = batches_of([test])
    count = batches[0].observed.numel()
    found = laplace(
        torch.zeros(2).double(), torch.zeros(count), torch.zeros(count, 2).double(), batches
    )
    assert found.correlation.shape == (2, 2)


def test_tests_in_which_nothing_happens_are_refused() -> None:
    test = drained(j2(**TRUE_J2), loading_and_unloading())
    still = LaboratoryTest("t", "t.csv", test.kind, test.strain, 0.0 * test.stress + 1e5)
    with pytest.raises(ConfigurationError, match=r"t\.csv: its stresses stay constant"):
        fit(j2(), [still])
    held = LaboratoryTest("t", "t.csv", test.kind, 0.0 * test.strain, test.stress)
    with pytest.raises(ConfigurationError, match=r"t\.csv: its strains stay constant"):
        fit(j2(), [held])


def oedometer(truth: dict[str, float], loads: np.ndarray, void_ratio: float) -> LaboratoryTest:
    """The response of modified Cam-Clay to axial loads, Pa, without its lateral stress."""
    cell = find_model("modified-cam-clay")(truth, order="principal")
    stress = np.zeros((len(loads), 3))
    stress[:, 0] = loads
    start = torch.tensor([[loads[0], 0.5 * loads[0], 0.5 * loads[0]]], dtype=torch.float64)
    scalars = {
        "initial_mean_stress": start.mean(dim=1),
        "initial_void_ratio": torch.full((1,), void_ratio, dtype=torch.float64),
    }
    control = MixedControl.of_components("principal", ("11",), 0.0 * stress, stress)
    done = run_test(cell, control, Conditions(start, scalars))
    assert not done.failures
    stress[:, 1:] = np.nan
    stress[0, 1:] = 0.5 * loads[0]
    ratio = (1.0 + void_ratio) * np.exp(-done.strain[0].sum(axis=1)) - 1.0
    return LaboratoryTest("oed", "made by the model", "oedometer", done.strain[0], stress, ratio)


def test_lambda_and_kappa_are_recovered_from_an_oedometer_test_without_lateral_stress() -> None:
    truth = {"compression_slope": 0.09, "swelling_slope": 0.015, "compression_intercept": 1.5}
    loads = 1e3 * np.array([25.0, 50.0, 100.0, 200.0, 400.0, 100.0, 25.0])
    test = oedometer(truth, loads, 1.18)
    assert not test.is_complete
    cell = find_model("modified-cam-clay")(order="principal")
    effort = Effort(adam_iterations=0, iterations=6)
    found = fit(cell, [test], FitSettings(free=tuple(truth), starts=1, effort=effort))
    values = found.cell.values()
    # The tolerance of the held stress, 0.03 %, is all that the search may leave.
    assert values["compression_slope"] == pytest.approx(0.09, rel=0.02)
    assert values["swelling_slope"] == pytest.approx(0.015, rel=0.05)
    assert found.error < 0.01
    assert found.errors[0].control == "oedometer"
    with pytest.raises(ConfigurationError, match="lateral stress was not measured"):
        fit(cell, [test], FitSettings(control="strain"))
