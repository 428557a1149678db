"""Classical models fitted to a dataset: the parameters that made it come back."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from plane_records import plane_records

from granbench.baselines.fitted import (
    CSUH_FITTED,
    IME_FITTED,
    J2_FITTED,
    PARAMETERS_FILE,
    FittedBaseline,
)
from granbench.benchmark.axes.along_paths.free_run import rollout
from granbench.cells.baseline import TrainingRequest
from granbench.errors import ConfigurationError, ModelError
from granbench.fitting import Effort
from granbench.models import find_model


def quick(baseline: FittedBaseline, **settings: object) -> FittedBaseline:
    """Fewer paths and starts; the search is the same."""
    effort = Effort(adam_iterations=2, iterations=30)
    recipe = replace(
        baseline.settings["reference"], **({"paths": 6, "starts": 2, "effort": effort} | settings)
    )
    return replace(baseline, settings={"reference": recipe})


def fitted(baseline: FittedBaseline, dataset: str, folder: Path) -> dict[str, float]:
    baseline.train(TrainingRequest(plane_records(dataset), folder))
    return json.loads((folder / PARAMETERS_FILE).read_text())["parameters"]


def test_the_parameters_that_made_the_data_come_back(tmp_path: Path) -> None:
    found = fitted(quick(J2_FITTED), "gp-j2", tmp_path)
    for name, value in find_model("j2")().values().items():
        # Records keep 16 bits of the stress.
        assert found[name] == pytest.approx(value, rel=1e-4), name


def test_the_hardening_curve_that_made_the_data_comes_back(tmp_path: Path) -> None:
    """Not each of its four numbers: sigma0 is 1 kPa of 138, within what the others make up for."""
    found = fitted(quick(IME_FITTED, paths=4, starts=1), "gp-ime", tmp_path)
    truth = find_model("ime")().values()

    def strength(c: dict[str, float], plastic: float) -> float:
        grown = (c["hardening_strain"] + plastic) ** c["hardening_exponent"]
        return c["yield_stress"] + c["hardening_modulus"] * grown

    for plastic in (0.0, 0.01, 0.1, 0.5):
        assert strength(found, plastic) == pytest.approx(strength(truth, plastic), rel=1e-2)
    for name in ("young_modulus", "poisson_ratio"):
        assert found[name] == pytest.approx(truth[name], rel=1e-2)


def test_a_model_of_another_form_is_fitted_approximately(tmp_path: Path) -> None:
    """J2 cannot harden: its error on hardening data is not small, but far below no model's."""
    folder = tmp_path / "j2"
    baseline = quick(J2_FITTED)
    baseline.train(TrainingRequest(plane_records("gp-j2-hardening"), folder))
    truth = plane_records("gp-j2-hardening")
    stress = torch.from_numpy(truth["stress"].values).double()
    error = (rollout(baseline.load(folder, truth), truth)["stress"] - stress).square().mean()
    assert 1e-4 < error / stress.square().mean() < 0.2


def test_a_finished_fit_is_not_repeated_and_another_is_refused(tmp_path: Path) -> None:
    baseline = quick(J2_FITTED, paths=3)
    fitted(baseline, "gp-j2", tmp_path)
    before = (tmp_path / PARAMETERS_FILE).stat().st_mtime_ns
    fitted(baseline, "gp-j2", tmp_path)
    assert (tmp_path / PARAMETERS_FILE).stat().st_mtime_ns == before
    with pytest.raises(ConfigurationError, match="out"):
        baseline.train(TrainingRequest(plane_records("gp-j2"), tmp_path, seed=1))


def test_time_that_is_over_ends_the_search(tmp_path: Path) -> None:
    request = TrainingRequest(plane_records("gp-j2"), tmp_path, seconds=1e-9)
    quick(J2_FITTED, paths=3).train(request)
    about = json.loads((tmp_path / PARAMETERS_FILE).read_text())["about"]
    assert about["ended_by"] == "budget"


def test_a_model_that_cannot_start_gives_the_reason(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="compression"):
        quick(CSUH_FITTED).train(TrainingRequest(plane_records("gp-j2"), tmp_path))
    with pytest.raises(ModelError, match="csuh-fitted|j2-fitted|ime-fitted"):
        J2_FITTED.load(None, plane_records("gp-j2"))
