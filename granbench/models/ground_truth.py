"""The ground truth of a dataset: the model that made it, rebuilt from the dataset's attributes."""

from collections.abc import Mapping
from typing import Any

import xarray as xr

from granbench.errors import DatasetError, ModelError
from granbench.models.catalogue import find_model
from granbench.models.classical import ClassicalCell
from granbench.models.parameter_file import parse_parameters
from granbench.records.schema import GROUND_TRUTH
from granbench.tensors import component_order


def ground_truth_cell(records: xr.Dataset) -> ClassicalCell | None:
    """The model that made a dataset, with its parameters; None where it was not a model.

    Parameters
    ----------
    records : with or without the attribute `ground_truth`: JSON with `model`, `parameters` and
        their `units`, as in a parameter file

    Raises
    ------
    DatasetError
        If the attribute describes no model that there is. `Task.view` sets the attribute, so that
        the fault may be in the task.
    """
    text = records.attrs.get(GROUND_TRUTH)
    if text is None:
        return None
    try:
        stated = parse_parameters(str(text), f"attribute {GROUND_TRUTH!r}")
        return stated.cell(component_order(records["component"].values))
    except ModelError as error:
        raise DatasetError(
            f"{records.attrs.get('dataset', 'the dataset')}: its attribute {GROUND_TRUTH!r} "
            f"describes no model of this version ({error}); correct ground_truth in the task's "
            "file, or fetch or generate the dataset again"
        ) from error


def described(cell: ClassicalCell) -> dict[str, Any]:
    """A model as the attribute `ground_truth` of a dataset has it; see `ground_truth_cell`."""
    return {
        "model": cell.name,
        "parameters": cell.values(),
        "units": {parameter.name: parameter.units for parameter in cell.parameter_table},
    }


def recording_cell(model: str, parameters: Mapping[str, float]) -> ClassicalCell:
    """The cell that makes records of a model.

    It keeps to torch: the last bits of NumPy's updates differ, which would carry some stresses that
    lie between two that a record can hold to the other one, and a dataset would not come out the
    same again.

    Raises
    ------
    ModelError
        If there is no such model, or a parameter does not fit it.
    """
    cell = find_model(model)(parameters)
    cell.numpy_updates = False
    return cell


def holds_no_tension(records: xr.Dataset) -> bool:
    """Whether the material of a dataset exists under compression only.

    So do a pressure-dependent model, and, where no model made the records, grains with voids
    between them.
    """
    truth = ground_truth_cell(records)
    return "void_ratio" in records if truth is None else truth.pressure_dependent
