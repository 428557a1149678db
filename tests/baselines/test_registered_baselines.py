"""Laws of every registered baseline, found by its registration."""

import json
from pathlib import Path

import pytest
import torch
import xarray as xr

from granbench.cells.baseline import BASELINES, EpochReport, TrainingRequest, find_baseline
from granbench.data.adapters import conditions_of, history_of
from granbench.errors import ModelError

TRAINED = [name for name in BASELINES if find_baseline(name).presets]
UNTRAINED = [name for name in BASELINES if name not in TRAINED]
VOLATILE = ("seconds",)
"""Keys of `model.json` that depend on the clock."""


@pytest.fixture(scope="module")
def few(_records: xr.Dataset) -> xr.Dataset:
    """Two paths of each split."""
    splits = _records["split"].values
    rows = [
        row for name in ("train", "validation", "test") for row in (splits == name).nonzero()[0][:2]
    ]
    return _records.isel(path=sorted(rows))


def trained(name: str, records: xr.Dataset, folder: Path, **request: object) -> Path:
    return find_baseline(name).train(TrainingRequest(records, folder, seed=3, epochs=2, **request))


def content(folder: Path) -> dict[str, object]:
    """Weights and description of a model, without what depends on the clock."""
    description = json.loads((folder / "model.json").read_text())
    for key in VOLATILE:
        description["training"].pop(key)
    return {"weights": (folder / "model.safetensors").read_bytes(), "description": description}


def stresses(name: str, folder: Path | None, records: xr.Dataset) -> torch.Tensor:
    cell = find_baseline(name).load(folder, records)
    return cell.rollout(history_of(records).strain, conditions_of(records)).stress


@pytest.mark.parametrize("name", TRAINED)
def test_the_same_seed_gives_the_same_files_and_stresses(
    name: str, few: xr.Dataset, tmp_path: Path
) -> None:
    folders = [trained(name, few, tmp_path / run) for run in ("first", "second")]
    assert content(folders[0]) == content(folders[1])
    first, second = (stresses(name, folder, few) for folder in folders)
    assert torch.equal(first, second)
    assert first.isfinite().any()


@pytest.mark.parametrize("name", TRAINED)
def test_a_run_that_was_interrupted_ends_like_one_that_was_not(
    name: str, few: xr.Dataset, tmp_path: Path
) -> None:
    def interrupt(report: EpochReport) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        trained(name, few, tmp_path / "interrupted", on_epoch=interrupt)
    continued = trained(name, few, tmp_path / "interrupted")
    assert content(continued) == content(trained(name, few, tmp_path / "whole"))


@pytest.mark.parametrize("name", TRAINED)
def test_a_trained_baseline_is_not_loaded_without_its_folder(name: str, few: xr.Dataset) -> None:
    with pytest.raises(ModelError, match=name):
        find_baseline(name).load(None, few)


@pytest.mark.parametrize("name", UNTRAINED)
def test_a_baseline_without_training_is_ready_at_once(
    name: str, few: xr.Dataset, tmp_path: Path
) -> None:
    with pytest.raises(ModelError, match=name):
        find_baseline(name).train(TrainingRequest(few, tmp_path / "model"))
    assert torch.equal(stresses(name, None, few), stresses(name, None, few))
