"""The published `fem-*` records: their content, and the mechanics of their Gauss points."""

import json
from functools import cache

import numpy as np
import pytest
import torch
import xarray as xr
from gp_records import principal_stress, series

from granbench.benchmark.axes.embedded.predict import embedded_truth
from granbench.benchmark.scored_task import ScoredTask
from granbench.benchmark.task_registry import registered_task
from granbench.data import entry, load, split_hash
from granbench.data.adapters import conditions_of
from granbench.data.fetch import checkout_datasets
from granbench.data.normalisation import Normalisation
from granbench.data.splits import leak_report, select_split
from granbench.fem.stated_problem import build_problem
from granbench.generators.fem.design import DATASETS, PRESETS
from granbench.generators.fem.plan import planned_analyses
from granbench.generators.find import find_generator
from granbench.models.ground_truth import ground_truth_cell
from granbench.models.isotropic_start import stiffest_normal_modulus
from granbench.paths.drawn import STRAIN_GRID
from granbench.records import open_records, verify
from granbench.tensors import volumetric_strain

NAMES = tuple(DATASETS)
CORE = PRESETS["core"]


@cache
def shipped(name: str) -> xr.Dataset:
    """The whole dataset in memory; only to be read."""
    with load(name) as records:
        return records.load()


def of_analysis(records: xr.Dataset, name: str) -> xr.Dataset:
    return records.isel(path=np.flatnonzero(records["specimen"].values.astype(str) == name))


@pytest.mark.parametrize("name", NAMES)
def test_the_file_is_unchanged_and_small(name: str) -> None:
    records = shipped(name)
    verify(records, name)
    assert records.sizes["step"] == CORE.steps + 1
    folder = checkout_datasets()
    assert folder is not None
    assert (folder / entry(name).file).stat().st_size == entry(name).bytes < 4e6


@pytest.mark.parametrize("name", NAMES)
def test_no_analysis_is_in_two_splits_and_no_path_is_near_another_split(name: str) -> None:
    report = leak_report(shipped(name))
    assert report.clean
    # In standard deviations of strain and stress; the same analysis again would be at 1e-4.
    assert min(report.nearest_path_distance.values()) > 0.03


@pytest.mark.parametrize("name", NAMES)
def test_every_planned_analysis_is_there_with_its_points(name: str) -> None:
    records = shipped(name)
    plans = planned_analyses(DATASETS[name], CORE, 0)
    assert {plan.name for plan in plans} == set(records["specimen"].values.astype(str))
    for plan in plans:
        paths = of_analysis(records, plan.name)
        assert set(paths["split"].values.astype(str)) == {plan.split}
        assert 1 <= paths.sizes["path"] <= plan.points
        places = np.column_stack([paths["position_x"].values, paths["position_y"].values])
        assert len(np.unique(places.round(9), axis=0)) == paths.sizes["path"]


@pytest.mark.parametrize("name", NAMES)
def test_a_smooth_specimen_has_the_confining_pressure_on_its_sides(name: str) -> None:
    """Uniform but for its waves: sigma_xx = p_c(t) and eps_yy = d(t)/H."""
    records = shipped(name)
    for plan in planned_analyses(DATASETS[name], CORE, 0):
        if plan.choices.get("ends") != "smooth":
            continue
        problem, paths = build_problem(plan), of_analysis(records, plan.name)
        x, pressure = problem.confinement.pressures()
        wanted = np.interp(np.linspace(0.0, 1.0, CORE.steps + 1), x, pressure)
        found = series(paths, "stress")[0, :, 0]
        assert np.sqrt(np.mean((found / wanted - 1.0) ** 2)) < 0.02, plan.name
        drive = problem.drive_history()
        wanted = drive.at(drive.end * np.linspace(0.0, 1.0, CORE.steps + 1))
        np.testing.assert_allclose(
            series(paths, "strain")[0, :, 1], wanted, atol=0.03 * plan.choices["end_strain"]
        )


@pytest.mark.parametrize("name", NAMES)
def test_the_ground_truth_reproduces_the_recorded_stress(name: str) -> None:
    """Up to the error due to the recorded steps, each of which is about twenty time steps."""
    records = shipped(name).isel(path=slice(0, None, 8))
    strain = torch.from_numpy(series(records, "strain"))
    with torch.no_grad():
        run = ground_truth_cell(records).rollout(strain, conditions_of(records))
    error = run.stress.numpy() - series(records, "stress")
    error = (error / Normalisation.from_training(shipped(name)).std["stress"]) ** 2
    assert np.median(error.mean(axis=(1, 2))) < 1e-3
    assert error.mean() < 5e-3


def test_ime_stays_within_its_yield_surface() -> None:
    """q <= sigma_0 + A (eps_0 + ||eps_p||)^n, up to the rounding of strains, which n amplifies."""
    records = shipped("fem-ime")
    truth = json.loads(records.attrs["ground_truth"])["parameters"]
    labels = {"xx": 1.0, "yy": 1.0, "zz": 1.0, "xy": 2.0}
    plastic = sum(count * series(records, f"plastic_strain_{label}") ** 2
                  for label, count in labels.items())  # fmt: skip
    s1, s2, s3 = np.moveaxis(principal_stress(records), -1, 0)
    q = np.sqrt(0.5 * ((s1 - s2) ** 2 + (s2 - s3) ** 2 + (s3 - s1) ** 2))
    grown = (truth["hardening_strain"] + np.sqrt(plastic)) ** truth["hardening_exponent"]
    limit = truth["yield_stress"] + truth["hardening_modulus"] * grown
    assert (q <= limit * (1.0 + 1e-3)).all()
    assert (q > 0.99 * limit).mean() > 0.2  # and much of it is on the surface


def test_void_ratio_of_csuh_is_that_of_its_volume() -> None:
    """e = e0 - (1 + e0) eps_v, both on the grid of the strains."""
    records = shipped("fem-csuh")
    start = series(records, "void_ratio")[:, :1]
    wanted = start - (1.0 + start) * volumetric_strain(series(records, "strain"), "plane")
    np.testing.assert_allclose(series(records, "void_ratio"), wanted, atol=4.0 * STRAIN_GRID)


def test_csuh_stays_compressed() -> None:
    records = shipped("fem-csuh")
    assert (principal_stress(records).mean(axis=-1) > 0.0).all()


@pytest.mark.parametrize("name", NAMES)
def test_training_strains_are_large_and_the_other_problems_differ_from_them(name: str) -> None:
    trained = series(select_split(shipped(name), "train"), "strain")
    foundation = series(select_split(shipped(name), "ood-footing"), "strain")
    wall = series(select_split(shipped(name), "ood-wall"), "strain")
    assert 0.01 < trained[..., 1].std() < 0.1
    # Shear is smallest in the compressed specimens and largest under the foundation.
    assert np.abs(foundation[..., 2]).max() > 0.5 * np.abs(trained[..., 2]).max()
    assert wall[:, -1, 0].mean() > 0.0 > trained[:, -1, 0].mean()


@pytest.mark.parametrize("name", NAMES)
def test_the_embedded_analyses_of_the_task_are_analyses_of_the_records(name: str) -> None:
    records = shipped(name)
    listed = registered_task(name).analyses
    assert [analysis.name for analysis in listed] == [
        "biaxial", "biaxial-cyclic", "retaining-wall", "strip-footing",
    ]  # fmt: skip
    programmes = dict(zip(records["specimen"].values, records["programme"].values, strict=True))
    cell = ground_truth_cell(records)
    for analysis in listed:
        recorded = json.loads(str(programmes[analysis.name]))
        stated = analysis.model_dump(mode="json")
        assert {key: stated[key] for key in recorded} == recorded
        assert analysis.modulus == pytest.approx(
            stiffest_normal_modulus(cell, analysis.confinement)
        )


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_the_ground_truth_finishes_every_embedded_analysis(name: str) -> None:
    found = embedded_truth(ScoredTask(shipped(name), registered_task(name).analyses))
    for variable in ("embedded_truth_reaction", "embedded_truth_stress"):
        assert np.isfinite(found[variable].values).all()
    pushed, slow = (found["embedded_truth_reaction"].sel(solver=solver).max("output")
                    for solver in ("explicit", "implicit"))  # fmt: skip
    np.testing.assert_allclose(pushed, slow, rtol=0.1)  # inertia and damping add some


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_the_registered_command_makes_the_committed_file_again(name: str, tmp_path) -> None:
    """Up to the growth of rounding errors in some thousand time steps."""
    assert entry(name).generator == f"granbench generate {name} --preset core --out DIR"
    path, _ = find_generator(name).generate(name, "core", tmp_path, progress="quiet")
    committed = shipped(name)
    with open_records(path) as made:
        assert split_hash(made) == entry(name).split_sha256
        for variable in committed.data_vars:
            again, kept = series(made, str(variable)), series(committed, str(variable))
            np.testing.assert_allclose(again, kept, rtol=0.0, atol=1e-3 * kept.std() + 1e-12)
