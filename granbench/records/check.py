"""The check of a dataset against the schema: the error names the first fault and its remedy.

Values are read a block of paths at a time, so that a file larger than memory can be checked.
"""

import numpy as np
import xarray as xr

from granbench.errors import ConfigurationError, DatasetError
from granbench.records.schema import (
    ANY,
    POSITIVE,
    REQUIRED_ATTRIBUTES,
    SCHEMA,
    SPLIT_PATTERN,
    TEXT_ATTRIBUTES,
    VariableSpec,
    path_blocks,
)
from granbench.tensors import component_order

LARGEST_LABELS = 2**27
"""Largest size of the labels of one variable in memory, bytes; all are as long as the longest."""


def validate_records(ds: xr.Dataset, source: str = "the dataset") -> None:
    """Check a dataset against the schema.

    Parameters
    ----------
    ds : stress-strain records
    source : file name for the error text

    Raises
    ------
    DatasetError
        Naming the file, the variable and the remedy: a missing variable, wrong dimensions,
        units or type, a value that is not finite or out of range, strain that is not zero at
        step 0, two paths with one name, an unknown split, a specimen in two splits, or a missing
        attribute.
    """
    for name, spec in SCHEMA.items():
        if name in ds.variables:
            _check_form(ds[name], name, spec, source)
        elif spec.required:
            raise DatasetError(
                f"{source}: variable {name!r} ({spec.long_name}) is missing; "
                f"add it with dimensions {_tuple(spec.dims)}"
                + (f" and units {spec.units!r}" if spec.units else "")
            )
    for name in map(str, ds.variables):
        if name not in SCHEMA and not {"units", "long_name"} <= set(ds[name].attrs):
            raise DatasetError(
                f"{source}: variable {name!r} is not part of the schema and has no units and "
                "long_name; give it both attributes or remove it"
            )
    _check_attributes(ds, source)
    _check_components(ds, source)
    _check_labels(ds, source)
    _check_values(ds, source)


def _tuple(dims: tuple[object, ...]) -> str:
    return f"({', '.join(map(str, dims))})"


def _check_form(variable: xr.DataArray, name: str, spec: VariableSpec, source: str) -> None:
    if variable.dims != spec.dims:
        raise DatasetError(
            f"{source}: variable {name!r} has dimensions {_tuple(variable.dims)} instead of "
            f"{_tuple(spec.dims)}; transpose or rename its dimensions"
        )
    found = {"f": "floating", "i": "integer", "u": "integer"}.get(variable.dtype.kind, "text")
    if found != spec.kind:
        raise DatasetError(
            f"{source}: variable {name!r} holds {found} values instead of {spec.kind} ones; "
            f"store it as {spec.dtype}"
        )
    units = variable.attrs.get("units", "")
    if units != spec.units:
        raise DatasetError(
            f"{source}: variable {name!r} has units {units!r} instead of {spec.units!r}; "
            f"convert its values and set its attribute 'units' to {spec.units!r}"
        )


def _check_attributes(ds: xr.Dataset, source: str) -> None:
    if missing := [name for name in REQUIRED_ATTRIBUTES if name not in ds.attrs]:
        raise DatasetError(
            f"{source}: global attribute {missing[0]!r} is missing; set it before writing "
            f"(a dataset needs {', '.join(REQUIRED_ATTRIBUTES)})"
        )
    for name in (*REQUIRED_ATTRIBUTES, *TEXT_ATTRIBUTES):
        if not isinstance(ds.attrs.get(name, ""), str):
            raise DatasetError(f"{source}: global attribute {name!r} is not text; write it as text")


def _check_components(ds: xr.Dataset, source: str) -> None:
    labels = tuple(str(label) for label in ds["component"].values)
    try:
        component_order(labels)
    except ConfigurationError as error:
        raise DatasetError(f"{source}: variable 'component': {error}") from error


def _check_labels(ds: xr.Dataset, source: str) -> None:
    if ds.sizes["path"] == 0 or ds.sizes["step"] < 2:
        raise DatasetError(
            f"{source}: dimensions path and step have {ds.sizes['path']} and {ds.sizes['step']} "
            "entries; a dataset needs at least one path of two steps"
        )
    for name, variable in ds.variables.items():
        if variable.dtype.kind in "OSU" and variable.size:
            _check_length(variable, str(name), source)
    identifiers, first_rows = np.unique(ds["path_id"].values.astype(str), return_index=True)
    if len(identifiers) < ds.sizes["path"]:
        repeated = min(set(range(ds.sizes["path"])) - set(first_rows.tolist()))
        raise DatasetError(
            f"{source}: variable 'path_id' holds {ds['path_id'].values[repeated]!r} more than "
            "once; give every path a different name"
        )
    split_of: dict[str, str] = {}
    for specimen, split in zip(ds["specimen"].values, ds["split"].values, strict=True):
        if not SPLIT_PATTERN.fullmatch(str(split)):
            raise DatasetError(
                f"{source}: variable 'split' holds {str(split)!r}; use train, validation, test "
                "or ood-NAME"
            )
        if split_of.setdefault(str(specimen), str(split)) != str(split):
            raise DatasetError(
                f"{source}: variable 'split' puts specimen {str(specimen)!r} in both "
                f"{split_of[str(specimen)]!r} and {str(split)!r}; split by specimen"
            )


def _check_length(variable: xr.Variable, name: str, source: str) -> None:
    longest = max(len(str(label)) for label in variable.values.reshape(-1))
    if 4 * longest * variable.size > LARGEST_LABELS:
        raise DatasetError(
            f"{source}: variable {name!r} has {variable.size} labels, one of them with {longest} "
            f"characters; shorten them to {LARGEST_LABELS // (4 * variable.size)} characters"
        )


def _check_values(ds: xr.Dataset, source: str) -> None:
    for name in map(str, ds.variables):
        if name in SCHEMA and SCHEMA[name].kind != "text":
            _check_range(ds, name, SCHEMA[name], source)
            _check_order(ds, name, SCHEMA[name], source)
    start = np.abs(ds["strain"].isel(step=0).values).max(axis=-1)
    if (start > 0.0).any():
        path = _path(ds, start > 0.0)
        raise DatasetError(
            f"{source}: variable 'strain' is not zero at step 0 of path {path!r}; measure "
            "strain from the state that step 0 records"
        )


def _check_range(ds: xr.Dataset, name: str, spec: VariableSpec, source: str) -> None:
    beside = next((other for other in spec.positive_with if other in ds.variables), None)
    limits = POSITIVE if beside else spec.limits
    if limits == ANY and (spec.nullable or spec.kind == "integer"):
        return
    row = 0
    for block in path_blocks(ds[name]):
        values = block.reshape(len(block), -1)
        finite = np.isfinite(values).all(axis=1)
        if not (spec.nullable or finite.all()):
            raise DatasetError(
                f"{source}: variable {name!r} has values that are NaN or infinite in "
                f"path {_path(ds, ~finite, row)!r}; remove the path or correct its source"
            )
        if limits != ANY and (out := ~(limits.holds(values) | np.isnan(values))).any():
            reason = f" in a dataset with {beside!r}" if beside else ""
            raise DatasetError(
                f"{source}: variable {name!r} ({spec.long_name}) is "
                f"{_quantity(values[out][0], spec)} in path "
                f"{_path(ds, out.any(axis=1), row)!r}, but must be {limits}{reason}; remove the "
                "path or correct its source"
            )
        row += len(block)


def _check_order(ds: xr.Dataset, name: str, spec: VariableSpec, source: str) -> None:
    if spec.not_below is None or spec.not_below not in ds.variables:
        return
    row = 0
    blocks = (path_blocks(ds[name]), path_blocks(ds[spec.not_below]))
    for large, small in zip(*blocks, strict=True):
        if (out := large < small).any():
            raise DatasetError(
                f"{source}: variable {name!r} ({spec.long_name}) is "
                f"{_quantity(large[out][0], spec)} in path {_path(ds, out, row)!r}, less than its "
                f"{spec.not_below!r}, {_quantity(small[out][0], spec)}; remove the path or "
                "correct its source"
            )
        row += len(large)


def _path(ds: xr.Dataset, bad: np.ndarray, row: int = 0) -> str:
    """Name of the first path that is `bad`, in a block that begins at `row`."""
    return str(ds["path_id"].values[row + int(np.argmax(bad))])


def _quantity(value: np.generic, spec: VariableSpec) -> str:
    return f"{value} {spec.units}" if spec.units != "1" else str(value)
