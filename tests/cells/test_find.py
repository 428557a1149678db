"""Finding the cells of a model by name: each kind of name, and which has priority."""

from pathlib import Path

import pytest
import xarray as xr

from granbench.baselines.mlstm import BASELINE as MLSTM
from granbench.baselines.recurrent_network import RecurrentConfiguration
from granbench.baselines.training.model_files import ModelDescription, write_model
from granbench.cells.find import DEFAULT_SEEDS, UntrainedBaselineError, find_cells
from granbench.errors import ConfigurationError, GranbenchError, ModelError
from granbench.models import find_model
from granbench.models.parameter_file import write_parameters

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


def test_a_folder_has_priority_over_a_baseline_of_the_same_name(
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
    with pytest.raises(ConfigurationError, match="'persistence'"):
        find_cells("persistence", records, folders=[folder])
    with pytest.raises(UntrainedBaselineError, match="'mlstm'"):
        find_cells("mlstm", records)
    with pytest.raises(ModelError, match="unknown baseline"):
        find_cells(str(folder), records, folders=[folder])


def test_a_classical_model_leaves_its_component_order_open(records: xr.Dataset) -> None:
    found = find_cells("j2", records)
    assert found.order_is_open and found.dimension == 2
    assert found.cell.order == "principal"  # that of the records
    plane = found.in_order("plane")
    assert plane.cell.order == "plane"
    assert list(plane.cells) == list(found.cells)
    assert plane.cell.values() == found.cell.values()
    assert find_cells("j2").cell.order == "plane"
    assert find_cells("j2", order="full").cell.order == "full"


def test_a_baseline_keeps_its_own_component_order(records: xr.Dataset) -> None:
    found = find_cells("persistence", records)
    assert not found.order_is_open
    assert found.in_order("plane") is found


def test_records_are_opened_by_name_where_the_model_needs_them() -> None:
    assert find_cells("linear-elastic", seeds=(0,)).cell.order == "principal"
    assert find_cells("j2", "no-such-dataset").cell.name == "j2"
    with pytest.raises(GranbenchError, match="no-such-dataset"):
        find_cells("linear-elastic", "no-such-dataset")


def test_parameters_are_those_of_the_set_or_file(tmp_path: Path) -> None:
    soft = find_model("j2")({"yield_stress": 5e4})
    file = write_parameters(soft, tmp_path / "soft.json")
    for found in (find_cells("j2", parameter_file=file), find_cells(str(file))):
        assert found.cell.values() == soft.values()
        assert found.in_order("principal").cell.values() == soft.values()
        assert (found.name, found.training_data) == ("soft", None)
    (name,) = list(find_model("j2").parameter_sets)[:1]
    published = find_cells("j2", parameter_set=name)
    assert published.cell.values() == find_model("j2")(parameter_set=name).values()
    assert published.training_data is not None


@pytest.mark.parametrize(
    ("name", "arguments", "named"),
    [
        ("j2", {"parameter_set": "a", "parameter_file": Path("b.json")}, "parameter_set"),
        ("persistence", {"parameter_set": "a"}, "parameter_set"),
        ("persistence", {"parameter_file": Path("b.json")}, "parameter_file"),
        ("j2", {"folders": [Path("run")]}, "folders"),
    ],
)
def test_what_a_model_does_not_take_is_refused(name, arguments, named, records) -> None:
    with pytest.raises(ConfigurationError, match=named):
        find_cells(name, records, **arguments)


def test_parameters_of_another_model_are_refused(tmp_path: Path) -> None:
    file = write_parameters(find_model("j2")(), tmp_path / "j2.json")
    with pytest.raises(ModelError, match=r"j2\.json"):
        find_cells("ime", parameter_file=file)


@pytest.mark.parametrize("name", ["j3", "no-such-model", "absent.json"])
def test_an_unknown_name_is_named(name: str, records: xr.Dataset) -> None:
    with pytest.raises(ModelError, match=name):
        find_cells(name, records)
