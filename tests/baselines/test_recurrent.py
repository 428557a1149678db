"""The recurrent network and its cell: one set of weights, two ways to run it, one answer."""

import pytest
import torch
import xarray as xr

from granbench.baselines.mlstm import BASELINE as MLSTM
from granbench.baselines.recurrent_cell import RecurrentCell
from granbench.baselines.recurrent_network import (
    INPUTS,
    STATES,
    RecurrentConfiguration,
    RecurrentNetwork,
)
from granbench.baselines.recurrent_records import fit_scaling, tables, window_source
from granbench.cells.contract import Conditions
from granbench.data.adapters import conditions_of, history_of
from granbench.errors import ModelError

MODELS = [
    {"initial_layer": False},
    {"initial_layer": True},
    {"initial_layer": True, "output": "change"},
    {"initial_layer": True, "output": "increment"},
]
CPU = torch.device("cpu")


def network_for(records: xr.Dataset, **settings: object) -> RecurrentNetwork:
    configuration = RecurrentConfiguration(**settings)
    network = MLSTM.seeded_network(configuration, seed=0)
    training = records.isel(path=records["split"].values == "train")
    fit_scaling(network.scaling, training, configuration.change_lag)
    return network


@pytest.mark.parametrize("model", MODELS)
def test_parameter_count_is_that_of_table_2_4(model: dict) -> None:
    inputs, hidden, initial, read_out, outputs, start = 7, 50, 40, 20, 4, 5
    lstm = 4 * (hidden * (inputs + hidden) + 2 * hidden)
    layers = hidden * read_out + read_out + read_out * outputs + outputs
    first = start * initial + initial + initial * hidden + hidden
    expected = lstm + layers + (first if model["initial_layer"] else 0)
    assert RecurrentNetwork(RecurrentConfiguration(**model)).parameters_count() == expected


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("start", [0, 13, 20])
def test_stepping_the_cell_agrees_with_the_fused_network(
    records: xr.Dataset, model: dict, start: int
) -> None:
    network = network_for(records, **model)
    count = records.sizes["step"] - 20
    windows = torch.arange(records.sizes["path"]) * count + start
    inputs, begin, _ = next(
        window_source(records, network.scaling, 20, CPU).batches(windows, len(windows))
    )
    with torch.no_grad():
        fused = network.scaling.raw_states(network(inputs, begin))
    history = history_of(records)
    part = history.strain[:, start : start + 21]
    result = RecurrentCell(network, "x").rollout(
        part - part[:, :1], conditions_of(records, start=start)
    )
    # float32 throughout; 20 recurrent steps lose about one digit of its seven.
    tolerance = 1e-5 * network.scaling.scale[STATES]
    assert (result.stress[:, 1:] - fused[..., :3]).abs().amax((0, 1)).lt(tolerance[:3]).all()
    assert (result.internals["void_ratio"][:, 1:] - fused[..., 3]).abs().max() < tolerance[3]


@pytest.mark.parametrize("model", MODELS)
def test_conditioning_every_step_equals_conditioning_each_alone(
    records: xr.Dataset, model: dict
) -> None:
    cell = RecurrentCell(network_for(records, **model), "x")
    history = history_of(records)
    every = cell.condition_each(history)
    for step in (0, 1, 7, records.sizes["step"] - 1):
        torch.testing.assert_close(every[:, step], cell.condition(history.until(step)))


def test_mlstm_restarts_from_the_true_state(records: xr.Dataset) -> None:
    cell = RecurrentCell(network_for(records, initial_layer=True), "mlstm")
    state = cell.condition(history_of(records).until(9))
    torch.testing.assert_close(state, cell.initial_state(conditions_of(records, start=9)))


def test_lstm_does_not_depend_on_the_initial_stress_and_the_mlstm_does(records: xr.Dataset) -> None:
    known = conditions_of(records)
    other = Conditions(2.0 * known.stress, known.scalars, known.accumulated_strain)
    strain = history_of(records).strain
    for initial_layer in (False, True):
        cell = RecurrentCell(network_for(records, initial_layer=initial_layer), "x")
        same = torch.equal(
            cell.rollout(strain, known).stress[:, 1:], cell.rollout(strain, other).stress[:, 1:]
        )
        assert same is not initial_layer


@pytest.mark.parametrize("output", ["change", "increment"])
def test_zero_output_leaves_the_state_where_it_was(records: xr.Dataset, output: str) -> None:
    network = network_for(records, initial_layer=True, output=output)
    for parameter in network.read_out.parameters():
        torch.nn.init.zeros_(parameter)
    history = history_of(records)
    result = RecurrentCell(network, "x").rollout(history.strain, history.conditions)
    start = history.conditions.stress.to(torch.float32)
    torch.testing.assert_close(result.stress, start[:, None].expand_as(result.stress))


@pytest.mark.parametrize("model", MODELS[1:])
def test_restarting_run_is_a_chain_of_windows(records: xr.Dataset, model: dict) -> None:
    network = network_for(records, **model)
    restarting = RecurrentCell(network_for(records, **model, restart_every=7), "restarting")
    plain = RecurrentCell(network, "plain")
    strain = history_of(records).strain
    whole = restarting.rollout(strain[:, :15], conditions_of(records))
    first = plain.rollout(strain[:, :8], conditions_of(records))
    at_restart = conditions_of(records, start=7)
    scalars = dict(at_restart.scalars) | {
        "initial_void_ratio": first.internals["void_ratio"][:, -1].double()
    }
    begin = Conditions(first.stress[:, -1].double(), scalars, at_restart.accumulated_strain)
    second = plain.rollout(strain[:, 7:15] - strain[:, 7:8], begin)
    chained = torch.cat([first.stress, second.stress[:, 1:]], dim=1)
    torch.testing.assert_close(whole.stress, chained, rtol=1e-4, atol=1.0)


def test_scaling_gives_columns_of_unit_variance(records: xr.Dataset) -> None:
    network = network_for(records, initial_layer=True)
    training = records.isel(path=records["split"].values == "train")
    table = network.scaling.standardise(torch.cat(list(tables(training))))
    for columns in (table[:, 1:, INPUTS], table[..., STATES]):
        rows = columns.flatten(0, 1)
        assert rows.mean(0).abs().max() < 1e-4
        torch.testing.assert_close(rows.std(0), torch.ones(rows.shape[1]), rtol=1e-3, atol=0.0)


def test_tangent_flows_through_a_step(records: xr.Dataset) -> None:
    cell = RecurrentCell(network_for(records, initial_layer=True), "x")
    state = cell.initial_state(conditions_of(records))
    dstrain = torch.zeros(len(state), 3, requires_grad=True)
    stress, _ = cell.step(dstrain, state)
    (gradient,) = torch.autograd.grad(stress.sum(), dstrain)
    assert gradient.abs().min() > 0.0


@pytest.mark.parametrize("missing", ["initial_void_ratio", "grading_index"])
def test_missing_condition_is_named(records: xr.Dataset, missing: str) -> None:
    known = conditions_of(records)
    scalars = {name: values for name, values in known.scalars.items() if name != missing}
    cell = RecurrentCell(network_for(records, initial_layer=True), "x")
    with pytest.raises(ModelError, match=missing):
        cell.initial_state(Conditions(known.stress, scalars))


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"initial_layer": True, "hidden": 0}, "hidden"),
        ({"initial_layer": True, "hidden": "fifty"}, "hidden"),
        ({"initial_layer": True, "output": "rate"}, "output"),
        ({"initial_layer": False, "output": "change"}, "initial_layer"),
        ({"initial_layer": True, "restart_every": 0}, "restart_every"),
        ({"initial_layer": True, "depth": 2}, "depth"),
        ({"hidden": 50}, "initial_layer"),
    ],
)
def test_impossible_architecture_is_refused(wrong: dict, named: str) -> None:
    with pytest.raises(ModelError, match=named):
        RecurrentConfiguration.of(wrong)
