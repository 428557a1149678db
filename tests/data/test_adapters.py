"""Laws of the torch adapters: windows are pieces of paths, from memory or from a file."""

import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

from granbench.data.adapters import (
    SPECIMEN_SCALARS,
    SequenceDataset,
    WindowDataset,
    accumulated_strain,
    conditions_of,
    history_of,
    history_of_batch,
)
from granbench.errors import ConfigurationError
from granbench.records import open_records
from granbench.tensors import mean_stress


def test_accumulated_strain_is_eq_2_2():
    strain = torch.tensor([[0.0], [0.3], [0.1], [0.2]])
    expected = torch.tensor([[0.0], [0.3], [0.5], [0.6]])
    torch.testing.assert_close(accumulated_strain(strain), expected)


@pytest.mark.parametrize("stride", [1, 7])
def test_windows_are_pieces_of_their_paths(records, stride):
    windows = WindowDataset(records, length=20, stride=stride)
    starts = range(0, records.sizes["step"] - 20, stride)
    assert len(windows) == records.sizes["path"] * len(starts)
    for index in (0, len(starts) - 1, len(starts), len(windows) - 1):
        path, start = index // len(starts), starts[index % len(starts)]
        item = windows[index]
        for name in ("strain", "stress", "void_ratio"):
            expected = records[name].values[path, start : start + 21]
            np.testing.assert_array_equal(item[name].numpy(), expected)
        assert item["grading_index"].item() == pytest.approx(records["grading_index"].values[path])
    with pytest.raises(IndexError):
        windows[len(windows)]


def test_a_window_has_the_conditions_of_a_path_that_starts_there(records):
    """Conditions from a batch of windows equal `conditions_of` at the windows' start."""
    windows = WindowDataset(records, dtype=torch.float64)
    start = 13
    rows = [path * len(windows.starts) + start for path in range(records.sizes["path"])]
    history = history_of_batch(windows.batch(rows), windows.order)
    expected = conditions_of(records, start)
    torch.testing.assert_close(history.conditions.stress, expected.stress)
    torch.testing.assert_close(history.conditions.past_strain(), expected.past_strain())
    # Only the oracle may ask where in the dataset it is.
    assert set(expected.scalars) - set(history.conditions.scalars) == {"path_key", "step_index"}
    for name, scalar in history.conditions.scalars.items():
        torch.testing.assert_close(scalar, expected.scalars[name])


def test_conditions_are_those_of_the_start(records):
    conditions = conditions_of(records, 10)
    torch.testing.assert_close(
        conditions.require("initial_void_ratio"),
        torch.tensor(records["void_ratio"].values[:, 10], dtype=torch.float64),
    )
    torch.testing.assert_close(
        conditions.require("initial_mean_stress"), mean_stress(conditions.stress)
    )
    assert (conditions.past_strain() >= 0.0).all()
    assert (conditions_of(records).past_strain() == 0.0).all()
    assert set(SPECIMEN_SCALARS) <= set(conditions.scalars)
    # The programme is seen as strain only.
    assert "intermediate_stress_ratio" not in conditions.scalars


@pytest.mark.parametrize("start", [-1, 40, 41])
def test_prediction_cannot_start_outside_the_record(records, start):
    with pytest.raises(ConfigurationError, match="outside 0 ... 39"):
        conditions_of(records, start)


def test_history_is_the_record(records):
    history = history_of(records)
    np.testing.assert_array_equal(history.stress.numpy(), records["stress"].values)
    np.testing.assert_array_equal(
        history.internals["void_ratio"].numpy(), records["void_ratio"].values
    )


def test_a_path_keeps_its_key_in_every_selection(records):
    keys = conditions_of(records).require("path_key")
    assert len(set(keys.tolist())) == records.sizes["path"]
    assert conditions_of(records.isel(path=[7])).require("path_key").item() == keys[7].item()
    assert (conditions_of(records, 5).require("step_index") == 5.0).all()


def test_sequences_are_whole_paths(records):
    sequences = SequenceDataset(records, dtype=torch.float64)
    assert len(sequences) == records.sizes["path"]
    batch = next(iter(DataLoader(sequences, batch_size=len(sequences))))
    history = history_of_batch(batch, sequences.order)
    torch.testing.assert_close(history.strain, history_of(records).strain)


def test_a_file_larger_than_memory_gives_the_same_windows(records, records_file, monkeypatch):
    """With room for two paths only, everything is read again and nothing differs."""
    one_path = 41 * (3 + 3 + 3 + 1) * 4
    monkeypatch.setattr("granbench.data.adapters.BYTES_IN_MEMORY", 2 * one_path)
    in_memory = WindowDataset(records)
    order = np.random.default_rng(0).permutation(len(in_memory))[:60]
    with open_records(records_file) as ds:
        from_file = WindowDataset(ds)
        for index in order.tolist():
            expected = in_memory[index]
            item = from_file[index]
            assert all(torch.equal(item[name], expected[name]) for name in expected)
            assert len(from_file._paths) <= 2


def test_worker_processes_read_the_file(records_file):
    with open_records(records_file) as ds:
        windows = WindowDataset(ds, stride=10)
        batches = [
            torch.cat([batch["stress"] for batch in DataLoader(windows, 16, num_workers=workers)])
            for workers in (0, 2)
        ]
    torch.testing.assert_close(batches[0], batches[1])


@pytest.mark.parametrize(("length", "stride"), [(0, 1), (20, 0), (41, 1)])
def test_a_window_that_cannot_be_is_refused(records, length, stride):
    with pytest.raises(ConfigurationError, match="window"):
        WindowDataset(records, length, stride)
