"""Model files: whole or refused, and never code."""

import json
import pickle
from pathlib import Path

import pytest
import torch
import xarray as xr

from granbench.baselines.mlstm import BASELINE
from granbench.baselines.recurrent_network import RecurrentConfiguration
from granbench.baselines.training.model_files import (
    DESCRIPTION_FILE,
    WEIGHTS_FILE,
    ModelDescription,
    write_model,
)
from granbench.cells.find import find_cells
from granbench.errors import ModelError

ARCHITECTURE = RecurrentConfiguration(initial_layer=True)


@pytest.fixture
def model(tmp_path: Path) -> Path:
    network = BASELINE.seeded_network(ARCHITECTURE, seed=0)
    description = ModelDescription(
        "mlstm", ARCHITECTURE.as_dict(), network.parameters_count(), training={}
    )
    return write_model(tmp_path, network.state_dict(), description)


def edit(model: Path, **changes: object) -> None:
    path = model / DESCRIPTION_FILE
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def test_weights_come_back_bit_for_bit(model: Path, records: xr.Dataset) -> None:
    cell = find_cells(str(model), records).cell
    assert cell.name == "mlstm"
    for name, tensor in BASELINE.seeded_network(ARCHITECTURE, seed=0).state_dict().items():
        assert torch.equal(tensor, cell.network.state_dict()[name])


class Trap:
    """Leaves a mark when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple:
        return Path.touch, (self.mark,)


def test_loading_a_pickle_executes_nothing(
    model: Path, records: xr.Dataset, tmp_path: Path
) -> None:
    mark = tmp_path / "executed"
    (model / WEIGHTS_FILE).write_bytes(pickle.dumps(Trap(mark)))
    with pytest.raises(ModelError, match=r"model\.safetensors"):
        find_cells(str(model), records)
    torch.save({"weights": Trap(mark)}, model / WEIGHTS_FILE)
    with pytest.raises(ModelError, match=r"model\.safetensors"):
        find_cells(str(model), records)
    assert not mark.exists()


@pytest.mark.parametrize("keep", [0, 7, 100, -1])
def test_truncated_weights_are_refused(model: Path, records: xr.Dataset, keep: int) -> None:
    whole = (model / WEIGHTS_FILE).read_bytes()
    (model / WEIGHTS_FILE).write_bytes(whole[:keep])
    with pytest.raises(ModelError, match=r"model\.safetensors.*damaged"):
        find_cells(str(model), records)


def test_one_flipped_bit_is_noticed(model: Path, records: xr.Dataset) -> None:
    content = bytearray((model / WEIGHTS_FILE).read_bytes())
    content[-3] ^= 1
    (model / WEIGHTS_FILE).write_bytes(content)
    with pytest.raises(ModelError, match=r"model\.safetensors.*SHA-256"):
        find_cells(str(model), records)


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"baseline": "mlstm"}'])
def test_damaged_description_is_refused(model: Path, records: xr.Dataset, text: str) -> None:
    (model / DESCRIPTION_FILE).write_text(text)
    with pytest.raises(ModelError, match=r"model\.json.*(damaged|JSON)"):
        find_cells(str(model), records)


def test_weights_of_another_architecture_are_refused(model: Path, records: xr.Dataset) -> None:
    edit(model, configuration=ARCHITECTURE.as_dict() | {"hidden": 51})
    with pytest.raises(ModelError, match=r"model\.safetensors"):
        find_cells(str(model), records)


def test_unknown_setting_is_refused(model: Path, records: xr.Dataset) -> None:
    edit(model, configuration={"initial_layer": True, "import": "os"})
    with pytest.raises(ModelError, match="import"):
        find_cells(str(model), records)


def test_model_of_an_unregistered_baseline_is_refused(model: Path, records: xr.Dataset) -> None:
    edit(model, baseline="os.system")
    with pytest.raises(ModelError, match="unknown baseline"):
        find_cells(str(model), records)


def test_model_of_another_baseline_is_refused(model: Path, records: xr.Dataset) -> None:
    edit(model, baseline="lstm")
    with pytest.raises(ModelError, match="holds a 'lstm'"):
        BASELINE.load(model, records)


def test_folder_without_a_model_is_refused(tmp_path: Path, records: xr.Dataset) -> None:
    with pytest.raises(ModelError, match=r"model\.json"):
        find_cells(str(tmp_path), records)
    with pytest.raises(ModelError, match=r"model\.json"):
        BASELINE.load(tmp_path, records)


def test_records_without_void_ratio_are_refused(model: Path, records: xr.Dataset) -> None:
    with pytest.raises(ModelError, match="'void_ratio' is missing"):
        find_cells(str(model), records.drop_vars("void_ratio"))
