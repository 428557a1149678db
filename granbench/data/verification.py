"""Verification of a file against its own hashes and the registry."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Concatenate, ParamSpec, TypeVar

from granbench.data.download import OnBytes
from granbench.data.registry import RegistryEntry, entries
from granbench.data.splits import split_hash
from granbench.data.store import file_of, registered_file
from granbench.errors import DatasetError
from granbench.files.bounded_reading import read_bounded
from granbench.records import (
    attributes_hash,
    mark_as_checked,
    open_records_here,
    verify,
)

P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True)
class Identity:
    """Name, version and hashes of a verified file, for comparison with the registry.

    Parameters
    ----------
    name, version : its attributes `dataset` and `version`
    split_sha256, content_sha256, attributes_sha256 : see `RegistryEntry`
    """

    name: str
    version: str
    split_sha256: str
    content_sha256: str
    attributes_sha256: str


def task_file(name_or_file: str, progress: OnBytes | None = None) -> Path:
    """The verified file of a task, for training and scoring.

    Parameters
    ----------
    name_or_file : as for `file_of`; a file of the user is verified completely, that of a registered
        dataset was checked when it was fetched
    progress : called while a file is fetched

    Raises
    ------
    GranbenchError
        See `file_of` and `verify_file`.
    """
    path = file_of(name_or_file, progress)
    if Path(name_or_file).is_file():
        verify_file(path)
    return path


def verify_file(path: Path) -> RegistryEntry | None:
    """Recompute every hash of a file, and compare it with the registry if its version is there.

    A file that is not registered, byte for byte, is read in a child process with bounds on memory
    and time.

    Parameters
    ----------
    path : netCDF file of records

    Returns
    -------
    The registry entry that it agrees with, or None for a dataset that is not registered: its values
    and its configuration agree with its own hashes, but its other attributes cannot be verified

    Raises
    ------
    DatasetError
        If the file breaks the schema; if a variable differs from its hash, by name; if the file
        was changed and sealed again under a registered version.
    """
    found = read_as_trusted(path, identify)
    mark_as_checked(path)
    entry = {(e.id, e.version): e for e in entries()}.get((found.name, found.version))
    if entry is not None:
        _compare(found, entry, path)
    return entry


def read_as_trusted(
    path: Path, function: Callable[Concatenate[Path, P], T], *arguments: P.args, **options: P.kwargs
) -> T:
    """Call a function that reads a file of records, with bounds unless the file is registered.

    Parameters
    ----------
    path : the file; a registered file, byte for byte, is read in this process, any other as by
        `granbench.files.bounded_reading.read_bounded`
    function : called with the path, `arguments` and `options`; see `read_bounded`

    Raises
    ------
    DatasetError
        If the file breaks a bound, or see the function.
    """
    if registered_file(path) is not None:
        return function(path, *arguments, **options)
    return read_bounded(path, DatasetError, function, path, *arguments, **options)


def identify(path: Path) -> Identity:
    """Verify a file, in this process, and return its identity.

    Raises
    ------
    DatasetError
        If a variable differs from its hash, by name.
    """
    with open_records_here(path) as ds:
        verify(ds, str(path))
        return Identity(
            name=ds.attrs["dataset"],
            version=ds.attrs["version"],
            split_sha256=split_hash(ds),
            content_sha256=ds.attrs["content_sha256"],
            attributes_sha256=attributes_hash(ds),
        )


def _compare(found: Identity, entry: RegistryEntry, path: Path) -> None:
    # The splits first: a changed split is more specific than changed values.
    for what in ("split", "content", "attributes"):
        mine = getattr(found, f"{what}_sha256")
        registered = getattr(entry, f"{what}_sha256")
        if mine != registered:
            changed = (
                "its attributes (ground truth, licence, units and the like) were changed"
                if what == "attributes"
                else "it was changed and sealed again"
            )
            raise DatasetError(
                f"{path}: its name is {found.name} {found.version}, but its {what}_sha256 "
                f"{mine[:12]}... is not the registered {registered[:12]}...; {changed}: fetch it "
                "again, or give your own data another name"
            )
