"""A model is compared with its budget and its tensors before anything of it is built."""

import json
import time
from collections.abc import Mapping
from pathlib import Path

import pytest
import torch

from granbench.baselines.gru import BASELINE as GRU
from granbench.baselines.gru import GruConfiguration
from granbench.baselines.lstm import BASELINE as LSTM
from granbench.baselines.mlstm import BASELINE as MLSTM
from granbench.baselines.recurrent_network import RecurrentConfiguration
from granbench.baselines.training.model_files import ModelDescription, write_model
from granbench.errors import ModelError, SubmissionError
from granbench.leaderboard.rerun_budget import (
    MOST_SEEDS,
    check_budget,
    time_limit,
)
from granbench.leaderboard.submission import ModelFile, ModelReference


def trained(folder: Path, baseline, configuration, settings: Mapping[str, object]) -> Path:
    """A network's folder whose description claims other settings than its weights have."""
    folder.mkdir(parents=True)
    network = baseline.seeded_network(configuration, 0)
    claimed = configuration.as_dict() | settings
    write_model(folder, network.state_dict(), ModelDescription(baseline.name, claimed, 1, {}))
    return folder


CLAIMS = {
    "a million layers": (GRU, GruConfiguration(order="principal"), {"layers": 1_000_000}),
    "a layer more": (GRU, GruConfiguration(order="principal"), {"layers": 3}),
    "wide": (GRU, GruConfiguration(order="principal"), {"hidden": 11_000}),
    "of another order": (GRU, GruConfiguration(order="principal"), {"order": "full"}),
    "hidden in an LSTM": (LSTM, RecurrentConfiguration(False), {"hidden": 10**9}),
    "read-out": (LSTM, RecurrentConfiguration(False), {"read_out_width": 10**8}),
    "first layer": (MLSTM, RecurrentConfiguration(True), {"initial_width": 10**8}),
    "a digit too many": (MLSTM, RecurrentConfiguration(True), {"hidden": 51}),
}


@pytest.mark.parametrize("case", CLAIMS)
def test_an_architecture_that_its_tensors_do_not_have_is_refused_at_once(records, tmp_path, case):
    baseline, configuration, settings = CLAIMS[case]
    folder = trained(tmp_path / "model", baseline, configuration, settings)
    begun = time.process_time()
    with pytest.raises(ModelError, match=r"model\.(json|safetensors)"):
        baseline.load(folder, records)
    assert time.process_time() - begun < 5.0


def test_a_network_is_loaded_with_the_weights_that_it_has(records, tmp_path):
    folder = trained(tmp_path / "model", MLSTM, RecurrentConfiguration(True), {})
    assert MLSTM.load(folder, records).parameters_count() == 15_194


def reference(folder: Path, seeds: int, size: int | None = None) -> ModelReference:
    """Files of a gated recurrent unit for some seeds, in the folder of `s.json`."""
    files = []
    for seed in range(seeds):
        place = folder / "s.model" / str(seed) / "model.safetensors"
        path = place.relative_to(folder).as_posix()
        bytes_stated = size or place.stat().st_size
        files.append(ModelFile(path=path, seed=seed, sha256="0" * 64, bytes=bytes_stated))
    return ModelReference(baseline="gru", files=tuple(files))


def written(folder: Path, header: bytes, seed: int = 0) -> None:
    place = folder / "s.model" / str(seed) / "model.safetensors"
    place.parent.mkdir(parents=True)
    place.write_bytes(len(header).to_bytes(8, "little") + header)


def declared(shape: object, tensors: int = 1) -> bytes:
    about = {"dtype": "F32", "shape": shape, "data_offsets": [0, 0]}
    return json.dumps({f"t{number}": about for number in range(tensors)}).encode()


HEADERS = {
    "many numbers": declared([100_000, 100_000]),
    "many tensors": declared([1], 5_000),
    "no list": declared("wide"),
    "huge size": declared([10**400]),
    "not JSON": b"{",
    "nested": b"[" * 100_000,
    "a list": b"[]",
}


@pytest.mark.parametrize("case", HEADERS)
def test_a_file_that_declares_too_much_is_refused(tmp_path, case):
    written(tmp_path, HEADERS[case])
    with pytest.raises(SubmissionError, match=r"model\.safetensors"):
        check_budget([0], reference(tmp_path, 1), tmp_path / "s.json")


def test_seeds_files_and_bytes_have_bounds(tmp_path):
    path = tmp_path / "s.json"
    untrained = ModelReference(baseline="persistence")
    check_budget(range(MOST_SEEDS), untrained, path)
    for seeds, complaint in (
        (range(1_000_000), "1000000"),
        ([-1], "seed -1"),
        ([10**23], "seed 1000"),
        ([10**5000], "seed"),
    ):
        with pytest.raises(SubmissionError, match=complaint):
            check_budget(seeds, untrained, path)
    for seed in range(4):
        written(tmp_path, declared([2, 3]), seed)
    check_budget([0, 1, 2, 3], reference(tmp_path, 4), path)
    with pytest.raises(SubmissionError, match="4 files"):
        check_budget([0], reference(tmp_path, 4), path)
    with pytest.raises(SubmissionError, match="MB"):
        check_budget([0, 1, 2, 3], reference(tmp_path, 4, 50_000_000), path)


def test_a_run_that_takes_too_long_is_stopped(tmp_path):
    with pytest.raises(SubmissionError, match="minutes"), time_limit(0.1, tmp_path / "s.json"):
        while True:
            torch.zeros(3).sum()
    with time_limit(60.0, tmp_path / "s.json"):
        pass
