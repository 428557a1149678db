"""A small `fem-*` dataset, from its analyses to its file."""

import json
from functools import partial

import numpy as np
import pytest
import torch
import xarray as xr
from fem_records import fem_records

from granbench.cells.contract import ModuleCell
from granbench.data.adapters import conditions_of
from granbench.data.splits import leak_report
from granbench.errors import AnalysisError
from granbench.fem.stated_problem import build_problem
from granbench.generators.fem import generator as generator_module
from granbench.generators.fem import jobs as jobs_module
from granbench.generators.fem.design import DATASETS, PRESETS
from granbench.generators.fem.generator import GENERATOR
from granbench.generators.fem.jobs import different_points, run_analysis
from granbench.generators.fem.plan import planned_analyses
from granbench.generators.rounding import recorded
from granbench.models.ground_truth import ground_truth_cell
from granbench.records import open_records, validate_records, verify

SMOKE = PRESETS["smoke"]


@pytest.fixture(scope="module")
def records() -> xr.Dataset:
    return fem_records()


def analysis(records: xr.Dataset, name: str) -> xr.Dataset:
    return records.isel(path=np.flatnonzero(records["specimen"].values.astype(str) == name))


def test_records_are_valid_and_no_split_leaks(records) -> None:
    validate_records(records)
    report = leak_report(records)
    assert report.clean
    assert min(report.nearest_path_distance.values()) > 0.05
    for name in np.unique(records["specimen"].values.astype(str)):
        of_analysis = analysis(records, name)
        assert len(set(of_analysis["split"].values.astype(str))) == 1
        assert len(set(of_analysis["loading_family"].values.astype(str))) == 1


def test_every_variable_is_rounded_once(records) -> None:
    for name, variable in records.data_vars.items():
        np.testing.assert_array_equal(recorded(str(name), variable.values), variable.values)


def test_a_smooth_specimen_has_the_confining_pressure_on_its_sides(records) -> None:
    """The specimen is uniform, so that sigma_xx = p_c(t), apart from waves due to its mass.

    The pressure changes by half of itself within 33 ms here, of which a wave takes 5 to cross.
    """
    plan = next(
        plan
        for plan in planned_analyses(DATASETS["fem-ime"], SMOKE, 0)
        if plan.name == "biaxial-smooth-monotonic-random-100kpa"
    )
    x, pressure = build_problem(plan).confinement.pressures()
    wanted = np.interp(np.linspace(0.0, 1.0, SMOKE.steps + 1), x, pressure)
    (path,) = analysis(records, plan.name)["stress"].values.astype(float)
    np.testing.assert_allclose(path[:, 0], wanted, rtol=0.12)
    np.testing.assert_allclose(path[:, 2], 0.0, atol=0.05 * wanted[0])
    strain = analysis(records, plan.name)["strain"].values[0, :, 1]
    end = plan.choices["end_strain"]
    np.testing.assert_allclose(strain, np.linspace(0.0, end, SMOKE.steps + 1), atol=0.05 * end)


def test_the_ground_truth_reproduces_the_recorded_stress(records) -> None:
    """Up to the error due to the recorded steps, each of which is about ten time steps."""
    cell = ground_truth_cell(records)
    strain = torch.from_numpy(records["strain"].values.astype(np.float64))
    with torch.no_grad():
        run = cell.rollout(strain, conditions_of(records))
    error = np.abs(run.stress.numpy() - records["stress"].values)
    assert np.median(error.max(axis=(1, 2))) < 2e-3 * float(records["stress"].std())
    assert error.max() < 0.1 * float(records["stress"].std())


def test_points_that_half_a_turn_maps_on_each_other_are_kept_once() -> None:
    truth = DATASETS["fem-ime"]
    for plan in planned_analyses(truth, SMOKE, 0):
        positions = np.array([[0.1, 0.2], [0.4, 0.2], [0.1, 0.8], [0.4, 0.8]])
        kept = different_points(plan, positions)
        assert list(kept) == ([0, 1] if plan.problem == "biaxial" else [0, 1, 2, 3])


def test_a_campaign_writes_the_requested_dataset(tmp_path, monkeypatch) -> None:
    """From the preset to the sealed file, with one analysis; run again it does nothing."""
    monkeypatch.setattr(
        generator_module, "planned_analyses", lambda *asked: planned_analyses(*asked)[6:7]
    )
    generate = partial(GENERATOR.generate, "fem-ime", "smoke", tmp_path, progress="quiet")
    path, _ = generate()
    assert path.name == "fem-ime-0.0.0+smoke.nc"
    with open_records(path) as made:
        verify(made.load(), str(path))
        assert made.sizes["step"] == SMOKE.steps + 1
        assert json.loads(made.attrs["configuration"])["preset"]["name"] == "smoke"
        programme = json.loads(str(made["programme"].values[0]))
        assert programme["choices"]["confinement"]["seed"] == int(made["seed"][0])
        written = made["stress"].values
    again, report = generate()
    assert report.skipped == tuple(report.done)
    with open_records(again) as made:
        np.testing.assert_array_equal(made["stress"].values, written)


class Unstable(torch.nn.Module):
    """Elastic as long as the strain is zero, NaN as soon as it is not."""

    def forward(self, dstrain: torch.Tensor, stress: torch.Tensor) -> torch.Tensor:
        """Stress after an increment."""
        moved = dstrain.abs().sum(dim=1, keepdim=True) > 0.0
        return torch.where(moved, torch.nan, stress + 2e7 * dstrain)


def test_an_analysis_that_fails_leaves_no_result(tmp_path, monkeypatch) -> None:
    job = GENERATOR.planned_jobs("fem-ime", "smoke")[0]
    cell = ModuleCell(Unstable(), name="unstable", order="plane", dtype=torch.float64)
    monkeypatch.setattr(jobs_module, "recording_cell", lambda model, parameters: cell)
    with pytest.raises(AnalysisError, match="unstable"):
        run_analysis(job.configuration, 0, {}, tmp_path)
    assert not list(tmp_path.iterdir())
