"""Violations and scores of the physics axis from given responses to the checks."""

import json
from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from granbench.benchmark.axes.physics.checks import (
    CHECKED_STRAIN,
    CHECKS,
    PHYSICS_OBSTACLES,
    PRINCIPAL,
    STRESS_CHECKS,
    checked_paths,
)
from granbench.benchmark.comparison import CEILING
from granbench.benchmark.predictions import (
    assembled_predictions,
    open_predictions,
    write_predictions,
)
from granbench.benchmark.scoring import score
from granbench.data.normalisation import Normalisation
from granbench.errors import SubmissionError
from granbench.records.schema import GROUND_TRUTH

SEEDS = (0, 1, 2)
ROTATION = {"rotation": PRINCIPAL}


@pytest.fixture
def responded(truth: xr.Dataset) -> Callable[..., xr.Dataset]:
    """Makes predictions of the physics axis alone: zero responses, but those that are given."""
    rows = checked_paths(truth)
    names = truth["path_id"].values[rows]
    shape = (len(SEEDS), len(names))

    def make(obstacles: dict[str, str] = ROTATION, **given: np.ndarray | float) -> xr.Dataset:
        checks = [name for name in STRESS_CHECKS if name not in obstacles]
        changes = np.zeros((len(SEEDS), len(checks), len(names), 3))
        for place, name in enumerate(checks):
            changes[:, place] = given.get(name.replace("-", "_"), 0.0)
        variables = {
            "stress_change": (("seed", "check", "checked_path", "component"), changes),
            **{
                name: (("seed", "checked_path"), np.broadcast_to(given.get(name, 0.0), shape))
                for name in ("tangent_error", "kink_share", "cycle_work", "tension_share")
            },
        }
        responses = xr.Dataset(
            variables,
            {"check": checks, "checked_path": names, "component": truth["component"].values},
            {PHYSICS_OBSTACLES: json.dumps(obstacles)},
        )
        return assembled_predictions(
            [responses], dataset=truth, seeds=SEEDS, attrs={"model": "by-hand"}
        )

    return make


def test_no_response_is_no_violation(responded, truth, normalisation, tmp_path):
    write_predictions(responded(), tmp_path / "p.nc")
    card = score(open_predictions(tmp_path / "p.nc"), truth, normalisation)
    for name in set(CHECKS) - {"rotation"}:
        for metric in ("violation_mean", "violation_worst", "violated_share"):
            assert card.find(name, "test", metric).value == 0.0
    assert card.find("tangent", "ood-psd", "kink_share").value == 0.0
    turned = card.find("rotation", "test", "violation_mean")
    assert (turned.status, turned.reason) == ("not_applicable", ROTATION["rotation"])
    rollout = card.find("rollout", "test", "stress_mse_mean")
    assert rollout.status == "not_run" and "rollout" in rollout.reason
    assert card.curves == ()
    assert not card.perfect  # no law tells the truth from a model


def test_changes_of_stress_count_in_training_deviations(responded, truth, normalisation):
    std = normalisation.std["stress"]
    card = score(responded(zero_increment=std * [0.1, 0.3, 0.2]), truth, normalisation)
    worst = card.find("zero-increment", "test", "violation_worst")
    assert worst.value == pytest.approx(0.3, rel=1e-4)  # stored with 15 bits
    assert card.find("swap", "test", "violation_worst").value == 0.0


def test_substeps_count_by_the_stiffness_of_the_training_data(responded, truth, normalisation):
    """A response as large as one deviation of stress over one of strain would make: 1."""
    std = normalisation.std
    change = std["stress"] / np.linalg.norm(std["strain"]) * CHECKED_STRAIN
    card = score(responded(substeps_10=change), truth, normalisation)
    assert card.find("substeps-10", "test", "violation_mean").value == pytest.approx(1.0, rel=1e-4)
    assert card.find("substeps-100", "test", "violation_mean").value == 0.0


def test_work_that_is_given_away_counts_by_the_length_of_the_cycle(responded, truth, normalisation):
    rows = checked_paths(truth)
    length = 2.0 * np.abs(np.diff(truth["strain"].values[rows].astype(float), axis=1)).sum(axis=1)
    scale = (normalisation.std["stress"] * length).sum(axis=-1)
    card = score(responded(cycle_work=-0.01 * scale), truth, normalisation)
    assert card.find("dissipation", "test", "violation_mean").value == pytest.approx(0.01, rel=1e-4)
    card = score(responded(cycle_work=scale), truth, normalisation)
    assert card.find("dissipation", "test", "violation_worst").value == 0.0


def test_a_breakdown_counts_as_the_largest_violation(responded, truth, normalisation):
    rows = checked_paths(truth)
    inside = np.flatnonzero(truth["split"].values[rows].astype(str) == "test")
    error = np.zeros((len(SEEDS), len(rows)))
    error[0, inside[0]] = np.nan
    card = score(responded(tangent_error=error), truth, normalisation)
    mean = card.find("tangent", "test", "violation_mean")
    assert mean.n == len(inside)
    assert mean.value == pytest.approx(CEILING / len(inside) / len(SEEDS))
    assert card.find("tangent", "test", "violation_worst").value == CEILING
    assert card.find("tangent", "test", "violated_share").by_seed[0] == pytest.approx(
        1.0 / len(inside)
    )
    assert card.find("tangent", "ood-psd", "violation_worst").value == 0.0


@pytest.mark.parametrize("name", CHECKS)
def test_a_path_passes_up_to_the_tolerance(responded, truth, normalisation, name):
    """A hair below and above it, with the unit of each check."""
    check = CHECKS[name]
    rows = checked_paths(truth)
    std = normalisation.std
    length = 2.0 * np.abs(np.diff(truth["strain"].values[rows].astype(float), axis=1)).sum(axis=1)
    stiffness = std["stress"] / np.linalg.norm(std["strain"])
    unit = {
        "tangent": ("tangent_error", 1.0),
        "substeps-10": ("substeps_10", stiffness * CHECKED_STRAIN),
        "substeps-100": ("substeps_100", stiffness * CHECKED_STRAIN),
        "dissipation": ("cycle_work", -(std["stress"] * length).sum(axis=-1)),
        "compression": ("tension_share", 1.0),
    }.get(name, (name.replace("-", "_"), std["stress"]))
    for factor, share in ((0.999, 0.0), (1.001, 1.0)):
        value = factor * check.tolerance if check.tolerance else 0.01 * (factor > 1.0)
        card = score(responded({}, **{unit[0]: value * unit[1]}), truth, normalisation)
        assert card.find(name, "test", "violated_share").value == share


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda p: p.isel(checked_path=slice(1, None)), "not made on the paths"),
        (lambda p: p.isel(checked_path=slice(None, None, -1)), "not made on the paths"),
        (lambda p: p.drop_vars("cycle_work"), "lack the response to the check 'dissipation'"),
        (lambda p: p.isel(check=slice(1, None)), "lack the response to the check 'zero-increment'"),
        (lambda p: p.assign_attrs({PHYSICS_OBSTACLES: "{"}), "does not say why"),
        (lambda p: p.assign_attrs({PHYSICS_OBSTACLES: '{"rotation": " "}'}), "does not say why"),
        (lambda p: p.assign_attrs({PHYSICS_OBSTACLES: '{"beauty": "x"}'}), "does not say why"),
    ],
)
def test_responses_that_are_not_those_of_the_benchmark_are_refused(
    responded, truth, normalisation, change, complaint
):
    with pytest.raises(SubmissionError, match=complaint):
        score(change(responded()), truth, normalisation)


def test_a_file_with_what_no_score_is_made_from_is_refused(responded, tmp_path):
    write_predictions(responded(), tmp_path / "p.nc")
    for change, complaint in (
        (lambda p: p.assign(beauty=p["cycle_work"]), "variable 'beauty'"),
        (lambda p: p.assign(tension_share=p["tension_share"].astype(str)), "hold numbers"),
        (lambda p: p.assign_coords(check=["a", "b", "c", "d"]), "check may be"),
        (lambda p: p.transpose("checked_path", ...), "has dimensions"),
    ):
        with xr.open_dataset(tmp_path / "p.nc") as handle:
            change(handle.load()).to_netcdf(tmp_path / "changed.nc")
        with pytest.raises(SubmissionError, match=complaint):
            open_predictions(tmp_path / "changed.nc")


@pytest.fixture
def noised(truth: xr.Dataset, predicted) -> xr.Dataset:
    """Predictions of records with a ground truth: it is the records wherever there is noise."""
    predictions = predicted(0.0, None)
    names = [name for name in predictions["protocol"].values if name.startswith("noise")]
    stress = predictions["stress"].sel(protocol=names).rename(protocol="noise")
    return predictions.assign(noised_truth=stress.drop_vars("first_predicted_step"))


def with_truth(records: xr.Dataset) -> xr.Dataset:
    return records.assign_attrs({GROUND_TRUTH: "{}"})


def test_noise_is_scored_against_both_truths(noised, truth, normalisation: Normalisation):
    off = normalisation.std["stress"].astype(np.float32)
    clean = score(noised, with_truth(truth), normalisation)
    assert clean.find("noise-0.5", "test", "recomputed_mse_mean").value == 0.0
    moved = noised.assign(noised_truth=noised["noised_truth"] + off)
    card = score(moved, with_truth(truth), normalisation)
    assert card.find("noise-0.5", "test", "stress_mse_mean").value == 0.0
    recomputed = card.find("noise-0.5", "test", "recomputed_mse_mean")
    # Two roundings of 3e-5 relative, at stresses of up to some ten deviations.
    assert recomputed.value == pytest.approx(1.0, rel=1e-3)
    with pytest.raises(KeyError):
        card.find("rollout", "test", "recomputed_mse_mean")  # there is no noise in it


def test_steps_that_the_ground_truth_cannot_follow_are_not_counted(noised, truth, normalisation):
    # A model that breaks down is at the ceiling where there is a truth, and only there.
    noised["noised_truth"][:, :, :, 11:] = np.nan
    noised["stress"][:, :, :, 6:] = np.nan
    card = score(noised, with_truth(truth), normalisation)
    worst = card.find("noise-1.0", "test", "recomputed_mse_worst")
    assert worst.value == pytest.approx(CEILING**2 * 5.0 / 10.0)
    share = card.find("noise-1.0", "test", "recomputed_error_point_share")
    assert share.value == pytest.approx(0.5)


def test_a_ground_truth_may_not_be_left_out(noised, truth, normalisation):
    with pytest.raises(SubmissionError, match=r"lack the ground truth along .* noise-0\.2"):
        score(noised.drop_dims("noise"), with_truth(truth), normalisation)
    with pytest.raises(SubmissionError, match="do not hold a prediction for"):
        score(noised.isel(protocol=[0, 1]), with_truth(truth), normalisation)
    reads = noised.drop_dims("noise").assign_attrs(reads_records=1)
    found = score(reads, with_truth(truth), normalisation).find(
        "noise-0.2", "test", "recomputed_mse_mean"
    )
    assert found.status == "not_applicable" and "from the records" in found.reason
