"""Datasets by name: found in place, or fetched into the user's cache, and opened."""

import os
import re
from pathlib import Path

import pooch
import xarray as xr

from granbench.data.fetch import Progress, fetch, folders_of, why_not
from granbench.data.registry import RegistryEntry, entries
from granbench.data.registry import entry as registry_entry
from granbench.data.splits import select_split
from granbench.errors import DatasetError
from granbench.records import mark_as_checked, open_records

CACHE_VARIABLE = "GRANBENCH_CACHE"

REGISTERED_NAME = re.compile(r"[a-z0-9-]+(@[0-9.]+)?")

_checked: set[tuple[str, int, int, str]] = set()


def cache_folder() -> Path:
    """Where fetched datasets are kept: `GRANBENCH_CACHE`, or the user's cache of the system."""
    return Path(os.environ.get(CACHE_VARIABLE) or pooch.os_cache("granbench")).expanduser()


def local_file(entry: RegistryEntry) -> Path | None:
    """The entry's file where it already is on this machine - wheel, checkout or cache - or None.

    A file counts only if size and SHA-256 agree with the registry; one that was checked is not
    read again in this process unless it changes.
    """
    for folder in (*folders_of(entry), cache_folder()):
        if _is_whole(folder / entry.file, entry):
            return folder / entry.file
    return None


def present_file(entry: RegistryEntry) -> Path | None:
    """As `local_file`, but only the size is compared: for listings."""
    for folder in (*folders_of(entry), cache_folder()):
        path = folder / entry.file
        if path.is_file() and path.stat().st_size == entry.bytes:
            return path
    return None


def _is_whole(path: Path, entry: RegistryEntry) -> bool:
    try:
        status = path.stat()
    except OSError:
        return False
    mark = (str(path), status.st_size, status.st_mtime_ns, entry.sha256)
    if mark in _checked:
        return True
    if why_not(path, entry) is not None:
        return False
    _checked.add(mark)
    mark_as_checked(path)
    return True


def registered_file(path: Path) -> RegistryEntry | None:
    """The entry whose file this is, byte for byte; None if it is no registered file.

    Parameters
    ----------
    path : a file by whatever name
    """
    candidates = (entry for entry in entries() if _is_whole(path, entry))
    return next(candidates, None)


def dataset_file(name: str, progress: Progress | None = None) -> Path:
    """The checked file of a registered dataset, fetched when it is not on this machine.

    Raises
    ------
    RegistryError
        If nobody registered the name.
    DownloadError
        If no mirror gives the file.
    """
    entry = registry_entry(name)
    return local_file(entry) or fetch(entry, cache_folder(), progress)


def bring(name: str, folder: Path, progress: Progress | None = None) -> Path:
    """A registered dataset's file in a folder of the user's choice.

    Raises
    ------
    RegistryError
        If nobody registered the name.
    DownloadError
        If the folder cannot be written or is full, or no mirror gives the file.
    """
    return fetch(registry_entry(name), folder, progress, also_in=(cache_folder(),))


def load(name: str, split: str | None = None, progress: Progress | None = None) -> xr.Dataset:
    """A registered dataset, opened lazily.

    Parameters
    ----------
    name : `dem-triaxial` for the newest version, `dem-triaxial@1.0.0` for that one
    split : `train`, `validation`, `test` or `ood-...`; all of them when not given
    progress : called while the file is fetched

    Returns
    -------
    Records that follow `granbench.records.SCHEMA`

    Raises
    ------
    RegistryError
        If the dataset or the split is unknown.
    DownloadError
        If no mirror gives the file.
    """
    ds = open_records(dataset_file(name, progress))
    return ds if split is None else select_split(ds, split)


def file_of(name_or_file: str, progress: Progress | None = None) -> Path:
    """A file by its path, or a registered dataset's by its name.

    Raises
    ------
    DatasetError
        If it looks like a path and there is no such file.
    """
    path = Path(name_or_file)
    if path.is_file():
        return path
    # A folder of that name, as `granbench generate` leaves behind, does not hide the dataset.
    if path.is_dir() and name_or_file not in {entry.id for entry in entries()}:
        raise DatasetError(f"{name_or_file}: is a folder; give a netCDF file in it")
    if not REGISTERED_NAME.fullmatch(name_or_file):
        raise DatasetError(
            f"{name_or_file}: there is no such file; give a netCDF file or a name of "
            "`granbench data list`"
        )
    return dataset_file(name_or_file, progress)
