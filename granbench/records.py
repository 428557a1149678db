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
from granbench.schema import (
    CONVENTIONS,
    REQUIRED_ATTRIBUTES,
    SCHEMA,
    VariableSpec,
    describe,
    path_blocks,
)
from granbench.schema_check import validate_records
from granbench.whole_file import whole_file

__all__ = [
    "CONVENTIONS",
    "REQUIRED_ATTRIBUTES",
    "SCHEMA",
    "VariableSpec",
    "content_hashes",
    "dataset_hash",
    "describe",
    "open_records",
    "path_blocks",
    "seal",
    "validate_records",
    "verify",
    "write_records",
]

CHUNK_BYTES = 2**18
"""Of one component over some paths, before compression: long runs of like bytes compress well,
and one path is still read without most of the others."""
_SIGNATURES = (b"\x89HDF\r\n\x1a\n", b"CDF\x01", b"CDF\x02", b"CDF\x05")


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
    """Open a file of records lazily and validate it.

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
        If the file is missing, is no netCDF file, or breaks the schema.
    """
    path = Path(path)
    if not path.is_file():
        raise DatasetError(f"{path}: there is no such file; check the name")
    try:
        with path.open("rb") as file:
            head = file.read(8)
        if not head.startswith(_SIGNATURES):
            what = f"it begins with {head!r}" if head else "it is empty"
            raise DatasetError(
                f"{path}: is not a netCDF file ({what}); give a file of "
                "stress-strain records, or fetch it again"
            )
        ds = xr.open_dataset(path, engine="netcdf4", chunks=chunks)
    except (OSError, RuntimeError, ValueError) as error:
        raise DatasetError(
            f"{path}: cannot be read as netCDF ({error}); the file is damaged, fetch it again"
        ) from error
    try:
        validate_records(ds, str(path))
    except (OSError, RuntimeError) as error:
        ds.close()
        raise DatasetError(
            f"{path}: cannot be read to its end ({error}); the file is truncated, fetch it again"
        ) from error
    except DatasetError:
        ds.close()
        raise
    return ds
