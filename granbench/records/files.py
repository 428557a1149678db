"""Files of stress-strain records: written whole or not at all, sealed by a content hash.

The hash covers values, not the bytes of the file, so that it does not depend on the compression or
the netCDF library. Each variable has its own hash, so that an error names the one that differs.
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
"""Size of a chunk, one component of some paths, before compression, bytes: long runs of similar
bytes compress well, and one path is still read without most of the others."""
INFORMATIVE_ATTRIBUTES = (
    "title",
    "generator_version",
    "engine_version",
    "rounding",
    "thinning",
    "tangents",
    "admissible_scaling",
)
"""Global attributes for people, or with the release that wrote the file, which are not hashed:
another release that makes the same values makes the same dataset."""
HASHES = ("content_sha256", "configuration_sha256", "sealed_variables")
_REMEDY = "give a file of stress-strain records, or fetch it again"

_checked: set[tuple[str, int, int, int]] = set()
"""Files that were found to hold records, by path, inode, size and time; see `mark_as_checked`."""


def content_hashes(ds: xr.Dataset) -> dict[str, str]:
    """SHA-256 of the values of every variable and coordinate, by name.

    The hash covers dimension names, type, shape and the little-endian bytes in C order; text is
    hashed as UTF-8 JSON. All NaN have the same hash.
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
    """SHA-256 of the hashes of all variables, which does not depend on their order."""
    lines = "".join(f"{name} {hashes[name]}\n" for name in sorted(hashes))
    return hashlib.sha256(lines.encode()).hexdigest()


def attributes_hash(ds: xr.Dataset) -> str:
    """SHA-256 of the attributes of a dataset.

    It covers every global attribute except `INFORMATIVE_ATTRIBUTES` and `HASHES`: name, version,
    licence, generator, engine, configuration, thesis section, conventions, `ground_truth`,
    `embedded_analyses` and all others, so that an added attribute is found too. It also covers
    every attribute of every variable, such as `units` and `long_name`, except its hash. The order
    of attributes and variables does not matter.
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
    """An attribute as a JSON value, whatever its type of number."""
    return value if isinstance(value, str) else np.asarray(value).tolist()


def _configuration_hash(ds: xr.Dataset) -> str:
    return hashlib.sha256(str(ds.attrs["configuration"]).encode()).hexdigest()


def seal(ds: xr.Dataset) -> xr.Dataset:
    """The dataset with hashes in its attributes: of each variable, of all, of the configuration."""
    sealed = ds.copy()
    hashes = content_hashes(ds)
    for name, value in hashes.items():
        sealed[name].attrs["content_sha256"] = value
    sealed.attrs["sealed_variables"] = " ".join(sorted(hashes))
    sealed.attrs["content_sha256"] = dataset_hash(hashes)
    sealed.attrs["configuration_sha256"] = _configuration_hash(ds)
    return sealed


def verify(ds: xr.Dataset, source: str = "the dataset") -> None:
    """Compare the values of a sealed dataset with its hashes.

    Parameters
    ----------
    ds : sealed dataset
    source : file name for the error text

    Raises
    ------
    DatasetError
        Naming the variables that differ, are missing, or were added.
    """
    if "content_sha256" not in ds.attrs or "sealed_variables" not in ds.attrs:
        raise DatasetError(
            f"{source}: global attribute 'content_sha256' is missing; the file has no hashes: "
            "write it with granbench.records.write_records"
        )
    hashes = content_hashes(ds)
    listed = str(ds.attrs["sealed_variables"]).split()
    remedy = "fetch the file again with `granbench data fetch`"
    if lost := sorted(set(listed) - set(hashes)):
        raise DatasetError(f"{source}: sealed variable {', '.join(lost)} is missing; {remedy}")
    if added := sorted(set(hashes) - set(listed)):
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
    """Check, seal and write a dataset; the file appears under its name only when it is complete.

    Parameters
    ----------
    ds : stress-strain records that follow the schema, in its units; a missing `units` attribute is
        added
    path : file to write; an existing one is replaced

    Returns
    -------
    Path of the file

    Raises
    ------
    DatasetError
        If the dataset does not follow the schema, or the file cannot be written.
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
    """Storage of a variable; all 1-D labels or numbers are in one chunk."""
    if not variable.size:
        return {}
    compressed = {"zlib": True, "complevel": 6, "shuffle": True}
    if variable.dtype.kind not in "fiu":
        # Text of variable length takes about 50 bytes per label, and is never compressed.
        return {**compressed, "dtype": "S1"}
    return {**compressed, "chunksizes": _chunk(variable) if variable.ndim > 1 else variable.shape}


def _chunk(variable: xr.Variable) -> tuple[int, ...]:
    """Chunk of one component of some paths; see `CHUNK_BYTES`."""
    paths, *others = variable.shape
    together = max(1, CHUNK_BYTES // (variable.dtype.itemsize * others[0]))
    return (min(paths, together), *others[:1], *(1 for _ in others[1:]))


def open_records(
    path: Path | str, *, chunks: int | dict[str, int] | str | None = None
) -> xr.Dataset:
    """Open a file of records lazily; its whole content is checked first.

    The check, `check_records`, runs in a child process with limits on memory and time. It is not
    repeated in the same process while the file does not change, and is left out for files that
    were marked by `mark_as_checked`.

    Parameters
    ----------
    path : netCDF file
    chunks : as in `xarray.open_dataset`, which needs dask for it; values are read when they are
        used in either case

    Returns
    -------
    Dataset; close it, or use it as a context manager, to release the file

    Raises
    ------
    DatasetError
        If the file is missing, is not a netCDF file, declares more values than it has, does not
        follow the schema, or cannot be read within the limits.
    """
    path = Path(path)
    require_netcdf(path, DatasetError, _REMEDY)
    if _mark(path) not in _checked:
        read_bounded(path, DatasetError, check_records, path)
        mark_as_checked(path)
    return open_netcdf(path, DatasetError, _REMEDY, chunks=chunks)


def open_records_here(path: Path) -> xr.Dataset:
    """Open a file of records as `open_records` does, but check it in this process.

    It is meant for functions that `read_bounded` calls.

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
    """Check the whole content of a file of records against the schema, in this process.

    Raises
    ------
    DatasetError
        See `open_records`.
    """
    with open_netcdf(path, DatasetError, _REMEDY) as ds:
        validate_records(ds, str(path))


def mark_as_checked(path: Path) -> None:
    """Mark a file, as it is now, as checked, so that it is opened without another check.

    Parameters
    ----------
    path : file that `check_records` accepted, or whose SHA-256 is registered
    """
    _checked.add(_mark(path))


def _mark(path: Path) -> tuple[str, int, int, int]:
    status = path.stat()
    return str(path.resolve()), status.st_ino, status.st_size, status.st_mtime_ns
