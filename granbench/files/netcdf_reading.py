"""Opening of netCDF files: declared sizes are checked first, and values are read as stored.

A file of a few kilobytes can declare gigabytes of values, in chunks that were never written or that
compress to nothing; and attributes such as `scale_factor` make a library change values while it
reads them, or fail. The declarations are checked for both before any value is read.
"""

import math
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray as xr
from xarray.backends import NetCDF4BackendEntrypoint

from granbench.errors import GranbenchError
from granbench.files.bounded_reading import prepare_server

LARGEST_EXPANSION = 100
"""Largest declared size of the values over the size of the file; records have about 3."""
SMALL = 2**26
"""Size of the values in bytes that a file of any size may declare."""
LARGEST_CHUNK = 2**28
"""Largest size of a chunk in bytes; a chunk is always read completely."""
MOST_VARIABLES = 500
MOST_DIMENSIONS = 1000
LARGEST_ATTRIBUTES = 2**24
"""Largest size of all attributes together, characters and bytes."""
TEXT_BYTES = 64
"""Smallest size of a text in memory, bytes."""
CHANGING_ATTRIBUTES = ("scale_factor", "add_offset", "_Unsigned", "missing_value", "dtype")
"""Attributes of a variable by which libraries change values as they read them."""
INTERPRETED_ATTRIBUTES = ("units", "long_name", "coordinates", "content_sha256")
"""Attributes of a variable that must be text, because they are compared with text."""

_SIGNATURES = (b"\x89HDF\r\n\x1a\n", b"CDF\x01", b"CDF\x02", b"CDF\x05")

# The first conversion makes xarray import dask, where it is installed: a second of computation.
prepare_server(lambda: xr.Variable("path", np.zeros(1)).astype(np.float32))


def require_netcdf(path: Path, error: type[GranbenchError], remedy: str) -> None:
    """Check the first bytes of a file.

    Parameters
    ----------
    path : the file
    error : type of the error
    remedy : what the user can do, the end of every error text

    Raises
    ------
    GranbenchError
        The given one: there is no such file, it is a device or a pipe, it cannot be read, or it
        does not begin like a netCDF file.
    """
    if not path.exists():
        raise error(f"{path}: there is no such file; check the name")
    if not path.is_file():
        raise error(f"{path}: is not a regular file; {remedy}")
    try:
        with path.open("rb") as file:
            head = file.read(8)
    except OSError as problem:
        raise error(
            f"{path}: cannot be read ({problem.strerror or problem}); {remedy}"
        ) from problem
    if not head.startswith(_SIGNATURES):
        what = f"it begins with {head!r}" if head else "it is empty"
        raise error(f"{path}: is not a netCDF file ({what}); {remedy}")


def open_netcdf(
    path: Path,
    error: type[GranbenchError],
    remedy: str,
    *,
    largest: int | None = None,
    chunks: int | dict[str, int] | str | None = None,
) -> xr.Dataset:
    """Open a netCDF file lazily after checking its declared sizes and attributes.

    Values are as stored: nothing is masked, scaled or converted to a date.

    Parameters
    ----------
    path : the file; a file from outside is opened within `read_bounded`
    error : type of the error
    remedy : what the user can do, the end of every error text
    largest : size of the values in bytes that the file may declare, if it is read completely
    chunks : as in `xarray.open_dataset`; needs dask

    Raises
    ------
    GranbenchError
        The given one: see `require_netcdf`; the file is damaged; it declares more than
        `LARGEST_EXPANSION` times its own size or than `largest`; it has groups, user-defined types
        or values in big-endian order; an attribute would change values.
    """
    require_netcdf(path, error, remedy)
    try:
        with netCDF4.Dataset(path) as file:
            fault = _fault(file, path.stat().st_size, largest)
        if fault is None:
            ds = xr.open_dataset(
                path,
                # Not by name: xarray would look for other engines first, which takes a second.
                engine=NetCDF4BackendEntrypoint,
                chunks=chunks,
                mask_and_scale=False,
                decode_times=False,
                decode_timedelta=False,
            )
            for variable in ds.variables.values():
                variable.attrs.pop("_FillValue", None)  # NaN; it belongs to the storage
            return ds
    except Exception as problem:  # of a damaged file the libraries raise anything
        reason = " ".join(str(problem).split()) or type(problem).__name__
        raise error(
            f"{path}: cannot be read as netCDF ({reason}); the file is damaged, {remedy}"
        ) from problem
    raise error(f"{path}: {fault}; {remedy}")


def _fault(file: netCDF4.Dataset, size: int, largest: int | None) -> str | None:
    """The first forbidden declaration of a file; None if there is none."""
    if file.groups:
        return f"has the group {next(iter(file.groups))!r}; groups are not read"
    if len(file.variables) > MOST_VARIABLES or len(file.dimensions) > MOST_DIMENSIONS:
        return (
            f"declares {len(file.variables)} variables and {len(file.dimensions)} dimensions, "
            f"more than {MOST_VARIABLES} and {MOST_DIMENSIONS}"
        )
    allowed = max(SMALL, LARGEST_EXPANSION * size)
    allowed = allowed if largest is None else min(allowed, largest)
    declared = attributes = 0
    for name, variable in file.variables.items():
        if fault := _storage_fault(name, variable):
            return fault
        declared += _declared_bytes(variable)
        if declared > allowed:
            return (
                f"declares {declared / 1e6:.0f} MB of values or more (up to variable {name!r}) in "
                f"a file of {size / 1e6:.3g} MB, where {allowed / 1e6:.0f} MB are allowed"
            )
    parts: list[tuple[str, Any]] = [("", file), *file.variables.items()]
    for name, described in parts:
        for attribute in described.ncattrs():
            value = described.getncattr(attribute)
            attributes += len(value) if isinstance(value, str | list) else np.asarray(value).nbytes
            if attributes > LARGEST_ATTRIBUTES:
                return f"has more than {LARGEST_ATTRIBUTES / 1e6:.0f} MB of attributes"
            if name and (fault := _attribute_fault(attribute, value, described)):
                return f"variable {name!r} {fault}"
    return None


def _declared_bytes(variable: netCDF4.Variable) -> int:
    # Empty dimensions count as 1: a loop over the others could be endless.
    shape = tuple(max(1, int(length)) for length in variable.shape)
    characters = _item_bytes(variable) * math.prod(shape)
    if variable.dtype is not str and np.dtype(variable.dtype).kind == "S":
        return max(characters, TEXT_BYTES * math.prod(shape[:-1]))  # the last one is within a text
    return characters


def _item_bytes(variable: netCDF4.Variable) -> int:
    return TEXT_BYTES if variable.dtype is str else int(np.dtype(variable.dtype).itemsize)


def _storage_fault(name: str, variable: netCDF4.Variable) -> str | None:
    if variable.dtype is not str:
        if isinstance(
            variable.datatype, netCDF4.VLType | netCDF4.CompoundType | netCDF4.EnumType
        ) or np.dtype(variable.dtype).kind not in ("f", "i", "u", "S"):
            return f"variable {name!r} has an unsupported type; store numbers or text"
        if np.dtype(variable.dtype).byteorder == ">":
            return f"variable {name!r} is stored in big-endian order; store it in little-endian"
    chunk = variable.chunking()
    if isinstance(chunk, list | tuple) and (
        _item_bytes(variable) * math.prod(map(int, chunk)) > LARGEST_CHUNK
    ):
        return (
            f"variable {name!r} is stored in chunks of more than {LARGEST_CHUNK / 1e6:.0f} MB; "
            "store it in smaller ones"
        )
    return None


def _attribute_fault(attribute: str, value: object, variable: netCDF4.Variable) -> str | None:
    if attribute in CHANGING_ATTRIBUTES:
        return f"has the attribute {attribute!r}; store its values as they are, without it"
    if attribute in INTERPRETED_ATTRIBUTES and not isinstance(value, str):
        return f"has an attribute {attribute!r} that is not text; write text or leave it out"
    if attribute == "_Encoding" and not (
        isinstance(value, str) and value.lower() in ("utf-8", "ascii")
    ):
        return "is stored in another encoding than UTF-8; store it in UTF-8"
    if attribute == "_FillValue" and not _harmless_fill(value, variable):
        return (
            f"marks missing values by {value!r}; store NaN in their place, without the attribute "
            "'_FillValue'"
        )
    return None


def _harmless_fill(value: object, variable: netCDF4.Variable) -> bool:
    """Whether no value of a variable can be mistaken for a missing one."""
    if variable.dtype is str or np.dtype(variable.dtype).kind == "S":
        return True
    return np.dtype(variable.dtype).kind == "f" and bool(np.isnan(np.asarray(value)).all())
