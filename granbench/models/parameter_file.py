"""Parameters of a classical model in a JSON file that a person can read, write and correct.

    {
      "model": "j2",
      "parameters": {"bulk_modulus": 1.25e6, "shear_modulus": 8.33e5, "yield_stress": 1e5},
      "units": {"bulk_modulus": "Pa", "shear_modulus": "Pa", "yield_stress": "Pa"}
    }

`units` may be left out, but never contradict the model. With `"parameter_set"`, the name of a
published set, `parameters` may hold only those that differ from it. `"about"` is free: where the
values come from.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from granbench.errors import ModelError
from granbench.files.json_reading import parse_json, read_json
from granbench.files.whole_file import whole_file
from granbench.models.catalogue import find_model
from granbench.models.classical import ClassicalCell

REQUIRED = ("model", "parameters")
KEYS = (*REQUIRED, "parameter_set", "units", "about")


@dataclass(frozen=True)
class ParameterFile:
    """What a parameter file says.

    Parameters
    ----------
    model : name in the catalogue
    parameters : values by name, SI units
    parameter_set : published set that the values replace some of; None where all are given
    units : by parameter name
    about : whatever the writer wanted to keep with the values
    """

    model: str
    parameters: Mapping[str, float]
    parameter_set: str | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    about: Mapping[str, Any] = field(default_factory=dict)

    def cell(self, order: str = "plane") -> ClassicalCell:
        """The model with these parameters.

        Raises
        ------
        ModelError
            If the model, a set, a parameter or a unit is unknown, or a value missing or out of
            range.
        """
        model = find_model(self.model)
        for parameter in model.parameter_table:
            unit = self.units.get(parameter.name, parameter.units)
            if unit != parameter.units:
                raise ModelError(
                    f"parameter {parameter.name!r} of {self.model} is given in {unit!r}; convert "
                    f"it to {parameter.units!r}"
                )
        names = [parameter.name for parameter in model.parameter_table]
        missing = [name for name in names if name not in self.parameters]
        cell = model(self.parameters, parameter_set=self.parameter_set, order=order)
        if missing and self.parameter_set is None:
            raise ModelError(
                f"{self.model} also needs {', '.join(missing)}; add them, or name the "
                '"parameter_set" that they are taken from: '
                f"{', '.join(model.parameter_sets)}"
            )
        return cell


def write_parameters(
    cell: ClassicalCell, path: Path, about: Mapping[str, Any] | None = None
) -> Path:
    """Write a model's parameters, whole or not at all.

    Parameters
    ----------
    cell : whose parameters are the same at all points
    path : of the file, which is replaced
    about : kept with the values; what JSON can hold

    Returns
    -------
    path

    Raises
    ------
    ModelError
        If the parameters differ between points, or the file cannot be written.
    """
    content: dict[str, Any] = {
        "model": cell.name,
        "parameters": cell.values(),
        "units": {parameter.name: parameter.units for parameter in cell.parameter_table},
    }
    if about:
        content["about"] = dict(about)
    text = json.dumps(content, indent=2, allow_nan=False) + "\n"
    with whole_file(path, ModelError) as partial:
        partial.write_text(text)
    return path


def read_parameters(path: Path) -> ParameterFile:
    """What a parameter file says; whether the model agrees is for `ParameterFile.cell` to find.

    Raises
    ------
    ModelError
        Naming the file and what is wrong with it.
    """
    content = read_json(path, ModelError, remedy="correct it or write it with `granbench fit`")
    return _described(content, str(path))


def parse_parameters(text: str, source: str) -> ParameterFile:
    """What a text of the form of a parameter file says; see `read_parameters`.

    Parameters
    ----------
    text : the JSON document
    source : what it is, as errors name it

    Raises
    ------
    ModelError
        Naming the source and what is wrong with it.
    """
    return _described(parse_json(text, source, ModelError, remedy="correct it"), source)


def _described(content: Any, source: str) -> ParameterFile:
    _check(content, source)
    parameters = {name: float(value) for name, value in content["parameters"].items()}
    return ParameterFile(**{**content, "parameters": parameters})


def cell_from_file(path: Path, order: str = "plane") -> ClassicalCell:
    """The classical model that a parameter file describes.

    Parameters
    ----------
    path : of the file
    order : component order of the cell

    Raises
    ------
    ModelError
        Naming the file and what is wrong with it.
    """
    described = read_parameters(path)
    try:
        return described.cell(order)
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from error


def _check(content: Any, source: str) -> None:
    """Refuse what is not of the form that the module describes."""
    if not isinstance(content, dict) or any(key not in content for key in REQUIRED):
        raise ModelError(
            f'{source}: is not a parameter file; it needs {{"model": NAME, "parameters": {{...}}}}'
        )
    if unknown := [key for key in content if key not in KEYS]:
        raise ModelError(
            f"{source}: {unknown[0]!r} means nothing in a parameter file, which holds "
            f'{", ".join(KEYS)}; put it into "about" or leave it out'
        )
    for key in ("model", "parameter_set"):
        if not isinstance(content.get(key, ""), str):
            raise ModelError(f"{source}: {key!r} must be a name in quotes")
    for key in ("parameters", "units", "about"):
        if not isinstance(content.get(key, {}), dict):
            raise ModelError(f"{source}: {key!r} must be an object, {{...}}")
    for name, value in content["parameters"].items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ModelError(
                f"{source}: parameter {name!r} is {json.dumps(value)}; give a number in SI units, "
                "without quotes"
            )
    known = content.get("units", {})
    if strange := [name for name in known if name not in content["parameters"]]:
        raise ModelError(f"{source}: gives a unit for {strange[0]!r}, but no value; add it")
    if any(not isinstance(unit, str) for unit in known.values()):
        raise ModelError(f'{source}: every unit must be text in quotes, such as "Pa"')
