"""A training run continues from a whole checkpoint or not at all."""

from pathlib import Path

import pytest
import torch
import xarray as xr

from granbench.baselines.training.progress import TRAINING_FILE
from granbench.baselines.training.tensor_files import digest_of, read_tensors, write_tensors
from granbench.cells.baseline import TrainingRequest, find_baseline
from granbench.errors import ModelError


@pytest.mark.parametrize("place", [0.02, 0.3, 0.5, 0.7, 0.9, 0.999])
def test_one_flipped_bit_of_a_checkpoint_is_noticed(
    place: float, records: xr.Dataset, tmp_path: Path
) -> None:
    lstm = find_baseline("lstm")
    lstm.train(TrainingRequest(records, tmp_path, epochs=1))
    file = tmp_path / TRAINING_FILE
    content = bytearray(file.read_bytes())
    content[int(place * len(content))] ^= 1
    file.write_bytes(content)
    with pytest.raises(ModelError, match=r"training\.safetensors.*(remove|train)"):
        lstm.train(TrainingRequest(records, tmp_path, epochs=2))


def test_a_checkpoint_without_its_digest_is_refused(records: xr.Dataset, tmp_path: Path) -> None:
    lstm = find_baseline("lstm")
    lstm.train(TrainingRequest(records, tmp_path, epochs=1))
    tensors, description = read_tensors(tmp_path / TRAINING_FILE)
    del description["sha256"]
    write_tensors(tmp_path / TRAINING_FILE, tensors, description)
    with pytest.raises(ModelError, match="train again"):
        lstm.train(TrainingRequest(records, tmp_path, epochs=2))


def test_the_digest_depends_on_names_shapes_types_and_values() -> None:
    tensors = {"a": torch.arange(6.0), "b": torch.zeros(())}
    changed = [
        {"a": torch.arange(6.0).reshape(2, 3), "b": torch.zeros(())},
        {"c": torch.arange(6.0), "b": torch.zeros(())},
        {"a": torch.arange(6.0).double(), "b": torch.zeros(())},
        {"a": torch.arange(6.0) + 1e-6, "b": torch.zeros(())},
    ]
    digests = {digest_of(each, {"epoch": 1}) for each in (tensors, *changed)}
    assert len(digests | {digest_of(tensors, {"epoch": 2})}) == 6
