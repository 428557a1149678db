"""One small `gp-*` campaign from end to end: its data, its continuation, and its errors."""

import json
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
import xarray as xr
from plane_records import plane_records

from granbench.data.adapters import conditions_of
from granbench.data.splits import leak_report
from granbench.errors import ConfigurationError, ModelError
from granbench.generators.classical.design import DATASETS, ClassicalDataset
from granbench.generators.classical.generator import GENERATOR
from granbench.generators.rounding import STRESS_BITS, recorded
from granbench.models import find_model
from granbench.models.ground_truth import recording_cell
from granbench.paths.drawn import STRAIN_GRID
from granbench.records import content_hashes, open_records, validate_records, verify

DATASET = "gp-j2"
generate = partial(GENERATOR.generate, DATASET, "smoke", progress="quiet")


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Folder of a finished smoke campaign, its file and its report; tests must not change them."""
    out = tmp_path_factory.mktemp("gp")
    path, report = generate(out)
    return out, path, report


@pytest.fixture
def dataset(finished) -> xr.Dataset:
    with open_records(finished[1]) as ds:
        return ds.load()


def test_dataset_is_valid_sealed_and_states_how_it_was_made(finished, dataset) -> None:
    _, path, report = finished
    assert path.name == "gp-j2-0.0.0+smoke.nc"
    assert list(report.done) == [DATASET]
    validate_records(dataset, str(path))
    verify(dataset, str(path))
    assert dict(dataset.sizes) == {"path": 56, "step": 41, "component": 3, "strain_component": 3}
    truth = json.loads(dataset.attrs["ground_truth"])
    cell = recording_cell(truth["model"], truth["parameters"])
    assert cell.values() == find_model("j2")().values()
    configuration = json.loads(dataset.attrs["configuration"])
    assert configuration["splits"]["ood-rougher"]["family"]["l"] == [0.04, 0.08]


@pytest.mark.parametrize("name", DATASETS)
def test_a_fresh_rollout_of_the_cell_is_what_was_recorded(name: str) -> None:
    """The run depends only on the strain and the start in the file.

    With gradients some models go through other instructions, whose last bit of double precision
    may differ; that moves one value in a million to the next one that a record can hold.
    """
    ds = plane_records(name)
    truth = json.loads(ds.attrs["ground_truth"])
    cell = recording_cell(truth["model"], truth["parameters"])
    strain = torch.from_numpy(ds["strain"].values.astype(np.float64))
    with torch.no_grad():
        run = cell.rollout(strain, conditions_of(ds))
    assert set(run.internals) == set(cell.internals) <= set(ds.data_vars)
    for variable, values in {"stress": run.stress, **run.internals}.items():
        again, kept = recorded(variable, values), ds[variable].values
        assert (again != kept).mean() < 1e-4, variable
        step = {"rtol": 2.0**-STRESS_BITS, "atol": 1e-9 * np.abs(kept).max()}
        if ds[variable].attrs["units"] == "1":
            step = {"rtol": 0.0, "atol": STRAIN_GRID}
        np.testing.assert_allclose(again, kept, **step, err_msg=variable)


def test_every_variable_states_its_rounding_and_rounding_again_changes_nothing() -> None:
    ds = plane_records("gp-csuh")
    for name, variable in ds.data_vars.items():
        np.testing.assert_array_equal(recorded(str(name), variable.values), variable.values)
        key = "grid_spacing" if variable.attrs["units"] == "1" else "keep_bits"
        assert variable.attrs[key] == {"grid_spacing": STRAIN_GRID, "keep_bits": STRESS_BITS}[key]
    assert "2^-20" in ds.attrs["rounding"] and "16 bits" in ds.attrs["rounding"]


@pytest.mark.parametrize("name", DATASETS)
def test_tangents_are_slopes_of_the_step_from_the_recorded_state(name: str) -> None:
    """Compared with central differences, in the median over the training paths at one step.

    Tolerance: the state is known as a record keeps it and a model with substeps answers a nudge
    of 1e-5 with its tolerance; paths at a kink of the response are in the minority.
    """
    step, size = 17, 1e-5
    ds = plane_records(name).isel(path=slice(0, 24))
    truth = json.loads(ds.attrs["ground_truth"])
    cell = recording_cell(truth["model"], truth["parameters"])
    state = cell.initial_state(conditions_of(ds, step - 1))
    strain = torch.from_numpy(ds["strain"].values.astype(np.float64))
    increment = strain[:, step] - strain[:, step - 1]
    columns = []
    with torch.no_grad():
        for nudge in size * torch.eye(3, dtype=torch.float64):
            forward, _ = cell.step(increment + nudge, state)
            backward, _ = cell.step(increment - nudge, state)
            columns.append((forward - backward) / (2.0 * size))
    slopes = torch.stack(columns, dim=-1).numpy()
    difference = np.linalg.norm(slopes - ds["tangent"].values[:, step], axis=(1, 2))
    assert np.median(difference / np.linalg.norm(slopes, axis=(1, 2))) < 1e-3


def test_paths_start_at_zero_on_the_strain_grid(dataset) -> None:
    strain = dataset["strain"].values.astype(float)
    assert (strain[:, 0] == 0.0).all()
    assert (dataset["stress"].values[:, 0] == 0.0).all()
    np.testing.assert_array_equal(strain, np.round(strain / STRAIN_GRID) * STRAIN_GRID)


def test_every_path_is_a_specimen_and_no_split_shares_one(dataset) -> None:
    np.testing.assert_array_equal(dataset["specimen"].values, dataset["path_id"].values)
    report = leak_report(dataset)
    assert report.clean
    assert set(report.nearest_path_distance) >= {"train-test", "train-validation"}
    # Paths with few degrees of freedom may be near each other; none repeats another.
    assert min(report.nearest_path_distance.values()) > 0.01


def test_the_same_seed_gives_the_same_bits_in_another_process(dataset) -> None:
    assert content_hashes(plane_records(DATASET)) == content_hashes(dataset)


def test_another_seed_gives_other_paths() -> None:
    first, second = (plane_records(DATASET, seed)["strain"].values for seed in (0, 1))
    assert (first[:, 1:] != second[:, 1:]).any(axis=(1, 2)).all()


def test_shear_strains_are_the_same_for_every_model() -> None:
    """Pressure-dependent models differ in the volume change only."""
    plain, scaled = plane_records("gp-j2"), plane_records("gp-dp")
    same = scaled.isel(path=slice(0, plain.sizes["path"]))
    np.testing.assert_array_equal(plain["path_id"].values, same["path_id"].values)
    for part in (lambda e: e[..., 2], lambda e: e[..., 0] - e[..., 1]):
        np.testing.assert_allclose(
            part(plain["strain"].values.astype(float)),
            part(same["strain"].values.astype(float)),
            atol=2.0 * STRAIN_GRID,
        )


def test_the_file_of_a_frictional_model_explains_its_scaling() -> None:
    ds = plane_records("gp-dp")
    split = ds["split"].values.astype(str)
    factor = ds["volumetric_factor"].values
    assert "mean stress stays between 0.1 and 50" in ds.attrs["admissible_scaling"]
    assert (factor[split == "ood-unscaled"] == 1.0).all()
    assert 0.0 < factor[split == "train"].min() < 1.0
    pressure = ds["stress"].values[..., :2].mean(-1)
    held = pressure[split != "ood-unscaled"]
    assert held.min() >= 0.1 * 1e5 * (1.0 - 2.0**-STRESS_BITS)  # rounding of the record
    assert pressure[split == "ood-unscaled"].min() < 1.0  # Pa: the apex


def test_running_again_continues_without_a_job_and_gives_the_same_file(finished, tmp_path) -> None:
    own = Path(shutil.copytree(finished[0], tmp_path / "own"))
    path, again = generate(own)
    assert again.skipped == (DATASET,)
    with open_records(finished[1]) as first, open_records(path) as second:
        assert first.attrs["content_sha256"] == second.attrs["content_sha256"]


def test_other_settings_in_the_same_folder_are_refused(finished, tmp_path) -> None:
    own = Path(shutil.copytree(finished[0], tmp_path / "own"))
    with pytest.raises(ConfigurationError, match="seed.*0.*1"):
        generate(own, seed=1)


def test_an_unknown_model_is_named(tmp_path) -> None:
    unknown = ClassicalDataset(dataset=DATASET, model="j3", thesis_section="6.6.2")
    generator = replace(GENERATOR, datasets={DATASET: unknown})
    with pytest.raises(ModelError, match="j3"):
        generator.generate(DATASET, "smoke", tmp_path, progress="quiet")
