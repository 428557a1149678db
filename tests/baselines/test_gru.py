"""The GRU: one set of weights, two ways to run it; and what it can and cannot know."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import xarray as xr
from plane_records import plane_records

from granbench.baselines.gru import BASELINE, GruConfiguration, GruNetwork
from granbench.baselines.training import Recipe
from granbench.baselines.training.history import read_history
from granbench.baselines.whole_paths import PathCell
from granbench.benchmark.axes.along_paths.free_run import rollout
from granbench.benchmark.axes.physics.tangent import in_double_precision
from granbench.cells.baseline import TrainingRequest
from granbench.data.adapters import conditions_of, history_of
from granbench.data.splits import select_split
from granbench.errors import ModelError


@pytest.fixture(scope="module")
def j2() -> xr.Dataset:
    return plane_records("gp-j2")


def network_for(records: xr.Dataset) -> GruNetwork:
    network = BASELINE.seeded_network(BASELINE.fitted_to(GruConfiguration(), records), seed=0)
    BASELINE.scale(network, select_split(records, "train"))
    return network


def test_parameter_count_is_that_of_the_thesis() -> None:
    first = 3 * (30 * 3 + 30 * 30 + 2 * 30)
    second = 3 * (30 * 30 + 30 * 30 + 2 * 30)
    network = GruNetwork(GruConfiguration())
    assert PathCell(network, "gru").parameters_count() == first + second + 3 * 30 + 3 == 8823


def test_stepping_the_cell_agrees_with_the_fused_network(j2: xr.Dataset) -> None:
    network = network_for(j2)
    paths = torch.arange(j2.sizes["path"])
    increments, _ = next(BASELINE.source(network, j2, torch.device("cpu")).batches(paths, 1000))
    with torch.no_grad():
        fused = network(increments) * network.stress_scale + network.stress_mean
    stepped = rollout(PathCell(network, "gru"), j2)["stress"][:, 1:].float()
    # float32: forty recurrent steps lose about one digit of its seven.
    assert (stepped - fused).abs().amax((0, 1)).lt(1e-5 * network.stress_scale).all()


def test_the_stress_is_read_from_the_hidden_state_alone(j2: xr.Dataset) -> None:
    cell = PathCell(network_for(j2), "gru")
    history = history_of(j2, cell.dtype)
    other = replace(history, stress=history.stress + 1e5)
    hidden = cell.layout["hidden"]
    assert torch.equal(cell.condition(history)[:, hidden], cell.condition(other)[:, hidden])


def test_a_gru_works_in_the_components_of_its_records(records: xr.Dataset, tmp_path: Path) -> None:
    folder = BASELINE.train(TrainingRequest(records, tmp_path, epochs=1))
    cell = BASELINE.load(folder, records)
    assert cell.order == "principal"
    assert cell.rollout(history_of(records).strain, conditions_of(records)).stress.isfinite().all()


def test_in_double_precision_all_of_the_cell_is(j2: xr.Dataset) -> None:
    """Else rounding of single precision is all that differences of steps show."""
    cell = PathCell(network_for(j2), "gru")
    state = cell.condition(history_of(j2, cell.dtype))
    increment = torch.full((len(state), 3), 1e-4)
    double = in_double_precision(cell, increment, state)
    assert double is not cell
    increment, state = increment.double(), state.double()
    _, _, tangent = double.tangent(increment, state)
    shift = torch.zeros_like(increment)
    shift[:, 0] = 1e-8
    up, down = (double.step(increment + sign * shift, state)[0] for sign in (1.0, -1.0))
    difference = (up - down) / 2e-8
    assert (tangent[..., 0] - difference).norm() < 1e-6 * difference.norm()


def test_read_as_change_the_stress_moves_with_its_start(j2: xr.Dataset) -> None:
    few = j2.isel(path=slice(0, 3))
    moved = few.assign(stress=few["stress"] + np.array([2e5, 2e5, 0.0]))
    configuration = GruConfiguration(output="change")
    targets = [configuration.target(history_of(records).stress) for records in (few, moved)]
    torch.testing.assert_close(*targets, rtol=0.0, atol=1e-6)
    network = BASELINE.seeded_network(configuration, seed=0)
    BASELINE.scale(network, few)
    cell = PathCell(network, "gru")
    strain = history_of(few).strain
    answers = [cell.rollout(strain, conditions_of(records)).stress for records in (few, moved)]
    shift = (answers[1] - answers[0]).double()
    torch.testing.assert_close(shift, torch.tensor([2e5, 2e5, 0.0]).double().expand_as(shift))


def test_a_gru_learns_a_few_paths(j2: xr.Dataset, tmp_path: Path) -> None:
    few = j2.isel(path=[0, 1, int((j2["split"].values == "validation").argmax())])
    recipe = Recipe(
        batch_size=2, learning_rate=2e-2, schedule="one-cycle", largest_gradient=1.0, epochs=150
    )
    baseline = replace(BASELINE, settings={"tiny": (GruConfiguration(), recipe)})
    losses = read_history(baseline.train(TrainingRequest(few, tmp_path)))
    assert losses[-1].training_loss < 1e-2 * losses[0].training_loss


@pytest.mark.parametrize("preset", ["reference", "change"])
def test_the_trained_cell_has_the_validation_loss_of_its_best_epoch(
    j2: xr.Dataset, tmp_path: Path, preset: str
) -> None:
    folder = BASELINE.train(TrainingRequest(j2, tmp_path, preset=preset, epochs=3))
    cell = BASELINE.load(folder, j2)
    truth = select_split(j2, "validation")
    error = (rollout(cell, truth)["stress"] - history_of(truth).stress)[:, 1:]
    loss = (error / cell.network.stress_scale).square().mean().item()
    best = min(report.validation_loss for report in read_history(folder))
    assert loss == pytest.approx(best, rel=1e-4)  # float32 sums in another order


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"order": "polar"}, "order"),
        ({"hidden": 0}, "hidden"),
        ({"output": "increment"}, "output"),
        ({"depth": 2}, "depth"),
    ],
)
def test_impossible_architecture_is_refused(wrong: dict, named: str) -> None:
    with pytest.raises(ModelError, match=named):
        GruConfiguration.of(wrong)
