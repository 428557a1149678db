"""The one way from a model's name to its cells: each kind of name, and which of them goes first."""

from pathlib import Path

import pytest
import xarray as xr

from granbench.baselines.mlstm import BASELINE as MLSTM
from granbench.baselines.recurrent_network import RecurrentConfiguration
from granbench.baselines.training.model_files import ModelDescription, write_model
from granbench.cells.find import DEFAULT_SEEDS, find_cells
from granbench.errors import ConfigurationError, ModelError

FACTORY = """
from small_cells import secant

def cell(seed):
    return secant(f"secant {seed}")
"""


def trained_model(folder: Path, seed: int) -> Path:
    architecture = RecurrentConfiguration(initial_layer=True)
    network = MLSTM.seeded_network(architecture, seed)
    description = ModelDescription(
        "mlstm", architecture.as_dict(), network.parameters_count(), training={"seed": seed}
    )
    folder.mkdir()
    return write_model(folder, network.state_dict(), description)


def test_untrained_baseline_is_one_cell_for_every_seed(records: xr.Dataset) -> None:
    found = find_cells("persistence", records)
    assert tuple(found.cells) == DEFAULT_SEEDS
    assert set(found.cells.values()) == {found.cell}
    assert found.baseline is not None
    assert not found.trained
    assert found.floor
    assert tuple(find_cells("persistence", records, seeds=(4, 7)).cells) == (4, 7)


def test_folder_by_its_name_or_with_its_baseline_is_the_same_model(
    records: xr.Dataset, tmp_path: Path
) -> None:
    folder = trained_model(tmp_path / "run", seed=5)
    named = find_cells(str(folder), records)
    given = find_cells("mlstm", records, folders=[folder])
    assert named.name == given.name == "mlstm"
    assert tuple(named.cells) == tuple(given.cells) == (5,)
    assert named.trained
    assert not named.floor
    assert named.parameters == given.parameters > 1000


def test_every_seed_has_the_cell_that_the_factory_makes_for_it(
    records: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cells_of_a_user.py").write_text(FACTORY)
    monkeypatch.syspath_prepend(tmp_path)
    found = find_cells("cells_of_a_user:cell", records, seeds=(2, 3))
    assert [cell.name for cell in found.cells.values()] == ["secant 2", "secant 3"]
    assert found.name == "secant 2"
    assert found.baseline is None
    assert found.trained


def test_folder_goes_before_a_baseline_of_its_name(
    records: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    trained_model(tmp_path / "persistence", seed=1)
    assert find_cells("persistence", records).name == "mlstm"
    (tmp_path / "oracle").mkdir()
    with pytest.raises(ModelError, match=r"oracle: holds no model\.json"):
        find_cells("oracle", records)


def test_folder_of_several_seeds_names_those_that_can_be_given(
    records: xr.Dataset, tmp_path: Path
) -> None:
    for seed in (1, 0):
        trained_model(tmp_path / f"{seed}", seed=seed)
    (tmp_path / "notes").mkdir()
    with pytest.raises(ModelError, match=r"but its folders 0, 1 do; give one of them, as .*/0$"):
        find_cells(str(tmp_path), records)


def test_folders_are_for_what_is_trained(records: xr.Dataset, tmp_path: Path) -> None:
    folder = trained_model(tmp_path / "run", seed=0)
    with pytest.raises(ConfigurationError, match="needs no training; leave out --model-dir"):
        find_cells("persistence", records, folders=[folder])
    with pytest.raises(ModelError, match="run `granbench train mlstm --out DIR`"):
        find_cells("mlstm", records)
    with pytest.raises(ModelError, match="unknown baseline"):
        find_cells(str(folder), records, folders=[folder])
