"""Files of stress-strain records: written whole or not at all, sealed by a content hash.

The hash covers values, not file bytes, so that it survives another compression or another
netCDF library. Each variable carries its own, so that a difference can be named.
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from granbench.errors import DatasetError
from granbench.files.bounded_reading import read_bounded
from granbench.files.netcdf_reading import open_netcdf, require_netcdf
from granbench.files.whole_file import whole_file
from granbench.records.check import validate_records
from granbench.records.schema import (
    describe,
    path_blocks,
)

CHUNK_BYTES = 2**18
"""Of one component over some paths, before compression: long runs of like bytes compress well,
and one path is still read without most of the others."""
INFORMATIVE_ATTRIBUTES = (
    "title",
    "generator_version",
    "engine_version",
    "rounding",
    "thinning",
    "tangents",
    "admissible_scaling",
)
"""Global attributes that are there for people, or that name the release which wrote the file:
another release that makes the same values makes the same dataset."""
HASHES = ("content_sha256", "configuration_sha256", "sealed_variables")
_REMEDY = "give a file of stress-strain records, or fetch it again"

_checked: set[tuple[str, int, int, int]] = set()
"""Files as they were when they were found to be records; see `mark_as_checked`."""


def content_hashes(ds: xr.Dataset) -> dict[str, str]:
    """SHA-256 over the values of every variable and coordinate, by name.

    The digest covers dimension names, type, shape and the little-endian bytes in C order;
    text goes in as UTF-8 JSON. NaN counts as one value whatever its bits.
    """
    return {str(name): _content_hash(ds[name]) for name in sorted(map(str, ds.variables))}


def _content_hash(variable: xr.DataArray) -> str:
    textual = variable.dtype.kind not in "fiub"
    dtype = "text" if textual else variable.dtype.newbyteorder("<").str
    header = json.dumps([list(map(str, variable.dims)), dtype, list(variable.shape)])
    digest = hashlib.sha256(header.encode())
    for block in path_blocks(variable):
        if textual:
            texts = np.vectorize(str, otypes=[object])(block) if block.size else block
            digest.update(json.dumps(texts.tolist(), ensure_ascii=False).encode())
            continue
        if block.dtype.kind == "f":
            block = np.where(np.isnan(block), block.dtype.type(np.nan), block)
        digest.update(np.ascontiguousarray(block, block.dtype.newbyteorder("<")).tobytes())
    return digest.hexdigest()


def dataset_hash(hashes: Mapping[str, str]) -> str:
    """One SHA-256 over the hashes of all variables, whatever their order."""
    lines = "".join(f"{name} {hashes[name]}\n" for name in sorted(hashes))
    return hashlib.sha256(lines.encode()).hexdigest()


def attributes_hash(ds: xr.Dataset) -> str:
    """One SHA-256 over what a dataset says of itself, apart from its values.

    It covers every global attribute but `INFORMATIVE_ATTRIBUTES` and the `HASHES`: name, version,
    licence, generator, engine, configuration, thesis section, conventions, and, where they stand,
    `ground_truth`, `embedded_analyses` and whatever else is there, so that an attribute that was
    added is found too; and every attribute of every variable, such as `units` and `long_name`, but
    its hash. Names of attributes and variables may come in any order.
    """
    covered = {
        "global": {
            name: _plain(value)
            for name, value in ds.attrs.items()
            if name not in (*INFORMATIVE_ATTRIBUTES, *HASHES)
        },
        "variables": {
            str(name): {
                attribute: _plain(value)
                for attribute, value in variable.attrs.items()
                if attribute not in HASHES
            }
            for name, variable in ds.variables.items()
        },
    }
    text = json.dumps(covered, sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(text.encode(errors="backslashreplace")).hexdigest()


def _plain(value: Any) -> Any:
    """An attribute as JSON can hold it, whatever type of number a file or a program made of it."""
    return value if isinstance(value, str) else np.asarray(value).tolist()


def _configuration_hash(ds: xr.Dataset) -> str:
    return hashlib.sha256(str(ds.attrs["configuration"]).encode()).hexdigest()


def seal(ds: xr.Dataset) -> xr.Dataset:
    """The dataset with its hashes in the attributes: per variable, as a whole, configuration."""
    sealed = ds.copy()
    hashes = content_hashes(ds)
    for name, value in hashes.items():
        sealed[name].attrs["content_sha256"] = value
    sealed.attrs["sealed_variables"] = " ".join(sorted(hashes))
    sealed.attrs["content_sha256"] = dataset_hash(hashes)
    sealed.attrs["configuration_sha256"] = _configuration_hash(ds)
    return sealed


def verify(ds: xr.Dataset, source: str = "the dataset") -> None:
    """Recompute every hash of a sealed dataset and compare.

    Raises
    ------
    DatasetError
        Naming the variables that differ, are missing, or were added.
    """
    if "content_sha256" not in ds.attrs or "sealed_variables" not in ds.attrs:
        raise DatasetError(
            f"{source}: global attribute 'content_sha256' is missing; the file was never sealed: "
            "write it with granbench.records.write_records"
        )
    hashes = content_hashes(ds)
    promised = str(ds.attrs["sealed_variables"]).split()
    remedy = "fetch the file again with `granbench data fetch`"
    if lost := sorted(set(promised) - set(hashes)):
        raise DatasetError(f"{source}: sealed variable {', '.join(lost)} is missing; {remedy}")
    if added := sorted(set(hashes) - set(promised)):
        raise DatasetError(f"{source}: variable {', '.join(added)} is not sealed; {remedy}")
    if differing := [n for n in hashes if ds[n].attrs.get("content_sha256") != hashes[n]]:
        plural = "s" if len(differing) > 1 else ""
        raise DatasetError(
            f"{source}: the values of variable{plural} {', '.join(differing)} differ from the "
            f"content_sha256 that the file records; {remedy}"
        )
    if dataset_hash(hashes) != ds.attrs["content_sha256"]:
        raise DatasetError(
            f"{source}: global attribute 'content_sha256' differs from the variables' hashes; "
            f"{remedy}"
        )
    if _configuration_hash(ds) != ds.attrs.get("configuration_sha256"):
        raise DatasetError(
            f"{source}: global attribute 'configuration' differs from its "
            f"configuration_sha256; {remedy}"
        )


def write_records(ds: xr.Dataset, path: Path | str) -> Path:
    """Validate, seal and write a dataset; the final name appears only when the file is whole.

    Parameters
    ----------
    ds : stress-strain records that follow the schema, in its units; variables without a `units`
        attribute get it
    path : file to write; an existing one is replaced

    Returns
    -------
    path

    Raises
    ------
    DatasetError
        If the dataset breaks the schema, or the folder cannot be written or is full.
    """
    path = Path(path)
    described = describe(ds)
    validate_records(described, str(path))
    sealed = seal(described)
    for variable in sealed.variables.values():
        variable.encoding = {}
    encoding = {str(name): _encoding(variable) for name, variable in sealed.variables.items()}
    with whole_file(path, DatasetError, RuntimeError, size=sealed.nbytes) as partial:
        sealed.to_netcdf(partial, engine="netcdf4", format="NETCDF4", encoding=encoding)
    return path


def _encoding(variable: xr.Variable) -> dict[str, Any]:
    """How a variable is stored; a chunk of 1-D labels or numbers holds all of them."""
    if not variable.size:
        return {}
    compressed = {"zlib": True, "complevel": 6, "shuffle": True}
    if variable.dtype.kind not in "fiu":
        # Text of variable length would take some 50 bytes a label, and is never compressed.
        return {**compressed, "dtype": "S1"}
    return {**compressed, "chunksizes": _chunk(variable) if variable.ndim > 1 else variable.shape}


def _chunk(variable: xr.Variable) -> tuple[int, ...]:
    """Some paths of one component: compresses best, and one path is read without the others."""
    paths, *others = variable.shape
    together = max(1, CHUNK_BYTES // (variable.dtype.itemsize * others[0]))
    return (min(paths, together), *others[:1], *(1 for _ in others[1:]))


def open_records(
    path: Path | str, *, chunks: int | dict[str, int] | str | None = None
) -> xr.Dataset:
    """Open a file of records lazily; one that is not known to be sound is first read to its end.

    That first reading, `check_records`, is made in a child process with bounds on memory and time;
    once in a process for a file that does not change, and not for a file that `mark_as_checked`
    names.

    Parameters
    ----------
    path : netCDF file
    chunks : as in `xarray.open_dataset`; dask is needed for it. Values stay on disk either way
        until they are used.

    Returns
    -------
    The dataset; close it, or use it as a context manager, when the file has to be released.

    Raises
    ------
    DatasetError
        If the file is missing, is no netCDF file, declares more than it can hold, breaks the
        schema, or cannot be read within the bounds.
    """
    path = Path(path)
    require_netcdf(path, DatasetError, _REMEDY)
    if _mark(path) not in _checked:
        read_bounded(path, DatasetError, check_records, path)
        mark_as_checked(path)
    return open_netcdf(path, DatasetError, _REMEDY, chunks=chunks)


def open_records_here(path: Path) -> xr.Dataset:
    """As `open_records`, but the first reading is made in this process.

    For functions that are called within `read_bounded`.

    Raises
    ------
    DatasetError
        See `open_records`.
    """
    require_netcdf(path, DatasetError, _REMEDY)
    if _mark(path) not in _checked:
        check_records(path)
        mark_as_checked(path)
    return open_netcdf(path, DatasetError, _REMEDY)


def check_records(path: Path) -> None:
    """Read a file of records to its end and check it against the schema, in this process.

    Raises
    ------
    DatasetError
        See `open_records`.
    """
    with open_netcdf(path, DatasetError, _REMEDY) as ds:
        validate_records(ds, str(path))


def mark_as_checked(path: Path) -> None:
    """Note that a file, as it is now, is known to hold records, so that it is opened at once.

    Parameters
    ----------
    path : a file that `check_records` accepted, or whose SHA-256 is that of a registered one
    """
    _checked.add(_mark(path))


def _mark(path: Path) -> tuple[str, int, int, int]:
    status = path.stat()
    return str(path.resolve()), status.st_ino, status.st_size, status.st_mtime_ns
