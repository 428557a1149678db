"""Parameters of a classical model in a JSON file.

    {
      "model": "j2",
      "parameters": {"bulk_modulus": 1.25e6, "shear_modulus": 8.33e5, "yield_stress": 1e5},
      "units": {"bulk_modulus": "Pa", "shear_modulus": "Pa", "yield_stress": "Pa"}
    }

`units` may be left out, but must not contradict the model. With `"parameter_set"`, the name of a
published set, `parameters` may hold only those that differ from it. `"about"` is free text, such as
where the values come from.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, FiniteFloat, ValidationError, model_validator

from granbench.errors import ModelError
from granbench.files.json_reading import parse_json, read_json
from granbench.files.whole_file import whole_file
from granbench.models.catalogue import find_model
from granbench.models.classical import ClassicalCell

EXPECTED = {
    "string_type": "text in quotes",
    "float_type": "a number in SI units, without quotes",
    "finite_number": "a finite number",
    "mapping_type": "an object {...}",
    "dict_type": "an object {...}",
}
"""Expected values by the type of pydantic's error."""


class ParameterFile(BaseModel):
    """Content of a parameter file.

    Parameters
    ----------
    model : name in the catalogue
    parameters : values by name, SI units
    parameter_set : published set that the values replace some of; None where all are given
    units : by parameter name
    about : anything that is worth keeping with the values, such as where they come from
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    model: str
    parameters: Mapping[str, FiniteFloat]
    parameter_set: str | None = None
    units: Mapping[str, str] = {}
    about: Mapping[str, Any] = {}

    @model_validator(mode="after")
    def _every_unit_has_a_value(self) -> Self:
        for name in self.units:
            if name not in self.parameters:
                raise ValueError(f"units has {name!r}, but parameters has no value for it")
        return self

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
    """Content of a parameter file; `ParameterFile.cell` checks it against the model.

    Raises
    ------
    ModelError
        Naming the file and what is wrong with it.
    """
    content = read_json(path, ModelError, remedy="correct it or write it with `granbench fit`")
    return _described(content, str(path))


def parse_parameters(text: str, source: str) -> ParameterFile:
    """Content of a text in the form of a parameter file; see `read_parameters`.

    Parameters
    ----------
    text : the JSON document
    source : name of the text in errors

    Raises
    ------
    ModelError
        Naming the source and what is wrong with it.
    """
    return _described(parse_json(text, source, ModelError, remedy="correct it"), source)


def _described(content: Any, source: str) -> ParameterFile:
    try:
        return ParameterFile.model_validate(content)
    except ValidationError as error:
        raise ModelError(f"{source}: {_complaint(error)}") from error


def _complaint(error: ValidationError) -> str:
    """The first thing that is wrong with a parameter file, and what to do."""
    first = error.errors()[0]
    field = ".".join(map(str, first["loc"]))
    if first["type"] == "model_type":
        return 'must be a JSON object {"model": NAME, "parameters": {...}}'
    if first["type"] == "missing":
        return f"{field!r} is missing; add it"
    if first["type"] == "extra_forbidden":
        known = ", ".join(ParameterFile.model_fields)
        return f'unknown key {field!r}; a parameter file has {known}; put notes under "about"'
    if first["type"] == "value_error":
        return f"{first['ctx']['error']}; add it"
    given = json.dumps(first["input"])
    return f"{field!r} is {given[:60]} but must be {EXPECTED.get(first['type'], 'valid')}"


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
