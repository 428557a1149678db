"""Parameter files: what is written is read, and what is wrong is named."""

import json
from pathlib import Path

import pytest
import torch

from granbench.errors import ModelError
from granbench.models import MODELS
from granbench.models.j2 import J2
from granbench.models.parameter_file import cell_from_file, read_parameters, write_parameters

J2_VALUES = {"bulk_modulus": 1e6, "shear_modulus": 5e5, "yield_stress": 2e4}


def written(path: Path, content: object) -> Path:
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


@pytest.mark.parametrize("name", MODELS)
def test_a_model_comes_back_to_the_last_bit(name, tmp_path):
    cell = MODELS[name]()
    with torch.no_grad():
        for number in cell.free.values():
            number.fill_(0.1)
    path = write_parameters(cell, tmp_path / "deep" / "parameters.json", {"fitted to": ["a.csv"]})
    back = cell_from_file(path, "principal")
    assert type(back) is type(cell)
    assert back.order == "principal"
    # One rounding where the bound below is not zero.
    assert back.values() == pytest.approx(cell.values(), rel=3e-16)
    described = read_parameters(path)
    assert described.about == {"fitted to": ["a.csv"]}
    assert described.units[cell.parameter_table[0].name] == cell.parameter_table[0].units


def test_a_set_gives_what_the_file_leaves_out(tmp_path):
    content = {
        "model": "ime",
        "parameter_set": "guan2023-tab7.1",
        "parameters": {"young_modulus": 1e7},
    }
    values = cell_from_file(written(tmp_path / "p.json", content)).values()
    assert values["young_modulus"] == 1e7
    assert values["yield_stress"] == 1e5


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", r"is not JSON \(line 1, column 2"),
        ("[]", "object"),
        ({"model": "j2"}, "'parameters' is missing"),
        ({"model": "csuhh", "parameters": {}}, "unknown classical model 'csuhh'"),
        ({"model": 2, "parameters": {}}, "'model' is 2"),
        ({"model": "j2", "parameters": []}, r"'parameters' is \[\]"),
        ({"model": "j2", "parameters": {"bulk_modulus": 1e6}},
         "shear_modulus, yield_stress.*parameter_set"),
        ({"model": "j2", "parameters": {**J2_VALUES, "bulk": 1.0}}, "has no parameter 'bulk'"),
        ({"model": "j2", "parameters": {**J2_VALUES, "yield_stress": "20 kPa"}},
         "'parameters.yield_stress' is \"20 kPa\".*number"),
        ({"model": "j2", "parameters": {**J2_VALUES, "yield_stress": True}},
         "'parameters.yield_stress' is true"),
        ({"model": "j2", "parameters": {**J2_VALUES, "yield_stress": -1}}, "must be above 0"),
        ('{"model": "j2", "parameters": {"bulk_modulus": NaN, "shear_modulus": 1, '
         '"yield_stress": 1}}', "holds NaN"),
        ({"model": "j2", "parameters": J2_VALUES, "units": {"yield_stress": "kPa"}},
         "'yield_stress' of j2 .*'kPa'.*'Pa'"),
        ({"model": "j2", "parameters": J2_VALUES, "units": {"cohesion": "Pa"}},
         "units.*'cohesion'"),
        ({"model": "j2", "parameters": J2_VALUES, "units": {"yield_stress": 1}},
         "'units.yield_stress' is 1"),
        ({"model": "j2", "parameters": J2_VALUES, "parameter_set": "x"}, "no parameter set 'x'"),
        ({"model": "j2", "parameters": J2_VALUES, "note": "mine"},
         "'note'.*about"),
        ('{"model": "j2", "model": "ime", "parameters": {}}', "'model' twice"),
    ],
)  # fmt: skip
def test_a_mistake_is_named_with_its_file(content, message, tmp_path):
    path = written(tmp_path / "mine.json", content)
    with pytest.raises(ModelError, match=message) as caught:
        cell_from_file(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_an_absent_file_and_a_folder_are_named(tmp_path):
    with pytest.raises(ModelError, match="there is no such file"):
        cell_from_file(tmp_path / "none.json")
    with pytest.raises(ModelError, match="cannot be read"):
        cell_from_file(tmp_path)


def test_parameters_that_differ_between_points_are_not_written(tmp_path):
    cell = J2()
    cell.free["yield_stress"] = torch.nn.Parameter(torch.zeros(2, dtype=torch.float64))
    with pytest.raises(ModelError, match="differ from point to point"):
        write_parameters(cell, tmp_path / "parameters.json")
    assert not list(tmp_path.iterdir())
