"""What a predictions file may hold: the layout that the registered axes declare."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import xarray as xr

from granbench.benchmark.registry import axes, labels, layout, of_every_axis
from granbench.errors import SubmissionError
from granbench.files.json_reading import parse_json_object

PATH_COORDINATES = ("path_id", "specimen", "split", "loading_family")
REMEDY = "run `granbench evaluate` again"
UNKNOWN_REMEDY = "install the package that brings it, or evaluate again without that package"


def check_variables(predictions: xr.Dataset, path: Path) -> None:
    """Check names, dimensions, types and attributes; values are not read.

    Raises
    ------
    SubmissionError
        Naming the file and the first variable, coordinate or attribute that is wrong.
    """
    known = layout()
    for name in map(str, predictions.data_vars):
        if name not in known:
            raise SubmissionError(
                f"{path}: no installed package defines the variable {name!r}; {UNKNOWN_REMEDY}"
            )
    for complaint in _complaints(predictions):
        raise SubmissionError(f"{path}: {complaint}; {REMEDY}")
    for name in (name for axis in axes() for name in axis.json_attributes):
        if name in predictions.attrs:
            text = str(predictions.attrs[name])
            parse_json_object(text, f"{path}: attribute {name!r}", SubmissionError, remedy=REMEDY)


def check_labels(predictions: xr.Dataset, path: Path) -> None:
    """Check the values of the coordinates.

    Raises
    ------
    SubmissionError
        Naming the file and the first coordinate that is wrong.
    """
    for complaint in _label_complaints(predictions):
        raise SubmissionError(f"{path}: {complaint}; {REMEDY}")


def _complaints(predictions: xr.Dataset) -> Iterator[str]:
    variables = layout()
    yield from of_every_axis(lambda axis: axis.file_complaints(predictions))
    for label, variable in predictions.data_vars.items():
        name = str(label)
        if variable.dims != variables[name].dims:
            yield f"{name!r} has dimensions {variable.dims}, expected {variables[name].dims}"
        elif variable.dtype.kind != "f":
            yield f"{name!r} does not hold numbers"
    for label, coordinate in predictions.coords.items():
        if label in variables or coordinate.ndim != 1:
            yield f"{str(label)!r} is not a coordinate"
    for name, value in predictions.attrs.items():
        if not isinstance(value, str) and np.ndim(value) > 0:
            yield f"attribute {name!r} is neither text nor a number"
    for name in sorted({*_labelled(predictions), *PATH_COORDINATES}):
        if name not in predictions.coords:
            yield f"lacks the coordinate {name!r}"
    if predictions["seed"].dtype.kind not in "iu":
        yield "'seed' does not hold integers"
    for name in PATH_COORDINATES:
        if predictions[name].dims != ("path",) or predictions[name].dtype.kind not in "OSU":
            yield f"{name!r} does not hold a label for each path"
    if empty := [str(name) for name, length in predictions.sizes.items() if not length]:
        yield f"dimension {empty[0]!r} has no entry"


def _labelled(predictions: xr.Dataset) -> set[str]:
    """Coordinates whose values are all different."""
    return {"seed", "path_id", *(str(dim) for dim in predictions.dims)} - {"path", "step"}


def _label_complaints(predictions: xr.Dataset) -> Iterator[str]:
    for name in sorted(_labelled(predictions)):
        values, counts = np.unique(predictions[name].values.astype(str), return_counts=True)
        if (counts > 1).any():
            yield f"{name} {values[counts > 1][0]!s} appears more than once"
    seeds = predictions["seed"].values
    if (seeds < 0).any() or (seeds > np.iinfo(np.int64).max).any():
        yield f"a seed is {seeds.min()}; seeds begin at 0"
    yield from of_every_axis(lambda axis: axis.label_complaints(predictions))
    for dim, known in labels().items():
        if dim in predictions.dims and not set(predictions[dim].values) <= set(known):
            found = ", ".join(map(str, predictions[dim].values))
            yield f"{dim} may be {', '.join(known)}, not {found}"
