"""A task in the plane: floors, ceiling and the ground truth itself."""

import json
from collections.abc import Iterable

import numpy as np
import pytest
import torch
import xarray as xr
from plane_records import plane_records

from granbench.baselines.linear_elastic import fitted_moduli
from granbench.benchmark.axes.along_paths.protocols import NOISE_PROTOCOLS, PROTOCOLS
from granbench.benchmark.evaluation import predict
from granbench.benchmark.predictions import evaluated
from granbench.benchmark.registry import axis_names
from granbench.benchmark.scorecard import Scorecard
from granbench.benchmark.scoring import score
from granbench.cells.contract import Conditions, MaterialCell
from granbench.cells.find import find_cells
from granbench.data.adapters import conditions_of
from granbench.data.normalisation import Normalisation
from granbench.generators.classical.design import DATASETS
from granbench.models import find_model


def card(cell: MaterialCell, records: xr.Dataset, axes: Iterable[str] = axis_names()) -> Scorecard:
    scored = evaluated(records)
    return score(predict({0: cell}, scored, axes), scored, Normalisation.from_training(records))


def values(card: Scorecard, metric: str = "stress_mse_mean") -> dict[str, float | None]:
    """Scores of the test split, by protocol."""
    return {name: card.find(name, "test", metric).value for name in PROTOCOLS}


@pytest.mark.parametrize("name", DATASETS)
def test_oracle_scores_exactly_zero_on_every_axis(name: str) -> None:
    records = plane_records(name)
    result = card(find_cells("oracle", records).cell, records)
    assert result.perfect
    scored = {item.protocol for item in result.scores if item.status == "scored"}
    assert scored == {*PROTOCOLS, "cost"}  # it has no parameters
    of_physics = [item for item in result.scores if item.axis == "physics"]
    assert {item.status for item in of_physics} == {"not_applicable"}
    assert all("reads its answers from the records" in item.reason for item in of_physics)


@pytest.mark.parametrize("name", DATASETS)
def test_the_ground_truth_repeats_its_own_paths(name: str) -> None:
    """From the start and from any recorded state.

    A recorded state is off by 8e-6 (16 bits). What was rounded to 16 bits and then to 15 differs
    from what was rounded to 15 at once by 3e-5 at one value in four: some 2e-10 in a squared
    error, and as much again in a step from a recorded state.
    """
    records = plane_records(name)
    truth = json.loads(records.attrs["ground_truth"])
    cell = find_model(truth["model"])(truth["parameters"])
    axes = ("rollout", "window", "single-step")
    scores = values(card(cell, records, axes))
    assert max(scores[axis] for axis in axes) < 1e-9


def test_the_ground_truth_follows_the_noise_as_any_model_does() -> None:
    """It leaves the clean truth, the more the louder the noise, and never the recomputed one."""
    result = card(find_cells("j2", plane_records()).cell, plane_records())
    noised = [values(result)[name] for name in NOISE_PROTOCOLS]
    assert 1e-4 < noised[0] < noised[1] < noised[2]
    assert set(values(result, "failed_share").values()) == {0.0}
    for name in NOISE_PROTOCOLS:
        for metric in ("recomputed_mse_worst", "recomputed_error_point_share"):
            assert result.find(name, "test", metric).value == 0.0


def test_an_elastic_floor_is_off_the_recomputed_truth() -> None:
    records = plane_records()
    result = card(find_cells("linear-elastic", records).cell, records, ["noise"])
    errors = [result.find(name, "test", "recomputed_mse_mean").value for name in NOISE_PROTOCOLS]
    assert all(0.01 < error < 100.0 for error in errors)


def test_the_oracle_has_no_score_against_the_recomputed_truth() -> None:
    records = plane_records()
    result = card(find_cells("oracle", records).cell, records, ["noise"])
    found = result.find("noise-1.0", "test", "recomputed_mse_mean")
    assert found.status == "not_applicable" and "reads its answers" in found.reason
    assert result.find("noise-1.0", "test", "stress_mse_worst").value == 0.0


@pytest.mark.parametrize("floor", ["persistence", "linear-elastic"])
@pytest.mark.parametrize("name", DATASETS)
def test_floors_run_on_every_protocol(name: str, floor: str) -> None:
    records = plane_records(name)
    axes = {spec.axis for spec in PROTOCOLS.values()}
    result = card(find_cells(floor, records).cell, records, axes)
    assert all(value > 0.0 for value in values(result).values())
    assert set(values(result, "failed_share").values()) == {0.0}
    with_voids = "void_ratio" in records
    status = result.find("rollout", "test", "void_ratio_mse_mean").status
    assert status == ("scored" if with_voids else "not_applicable")


def test_persistence_keeps_the_stress_of_the_start() -> None:
    records = plane_records()
    cell = find_cells("persistence", records).cell
    predicted = predict({0: cell}, evaluated(records), ["rollout"])["stress"].values
    assert (predicted == 0.0).all()  # the paths start without stress


def test_moduli_of_elastic_paths_are_those_of_the_model() -> None:
    """J2 with a yield stress that is never met is linear elasticity in the plane."""
    records = plane_records()
    cell = find_model("j2")({"yield_stress": 1e9})
    strain = records["strain"].values.astype(np.float64)
    start = Conditions(torch.zeros(len(strain), 3, dtype=torch.float64))
    with torch.no_grad():
        stress = cell.rollout(torch.from_numpy(strain), start).stress.numpy()
    expected = (cell.values()["bulk_modulus"], cell.values()["shear_modulus"])
    assert fitted_moduli(strain, stress, "plane") == pytest.approx(expected, rel=1e-10)
    elastic = records.assign(stress=(records["stress"].dims, stress.astype(np.float32)))
    floor = find_cells("linear-elastic", elastic).cell
    assert values(card(floor, elastic))["rollout"] < 1e-9  # moduli from single precision


def test_a_window_may_start_at_the_apex() -> None:
    """A record that has lost its pressure goes on from there: no stress, until it is compressed."""
    records = plane_records("gp-dp")
    unscaled = records.isel(path=records["split"].values == "ood-unscaled")
    pressure = unscaled["stress"].values[:, :-1, :2].mean(axis=-1)
    path, step = np.argwhere(pressure == 0.0)[0]
    start = conditions_of(unscaled.isel(path=[int(path)]), int(step))
    cell = find_model("drucker-prager")()
    state = cell.initial_state(start)
    assert (state[:, cell.layout["stress"]] == 0.0).all()
    dilation = torch.tensor([[-1e-3, -1e-3, 0.0]], dtype=torch.float64)
    assert (cell.step(dilation, state)[0] == 0.0).all()
    assert (cell.step(-dilation, state)[0][:, :2] > 0.0).all()
