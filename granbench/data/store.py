"""Datasets by name: found on this machine, or fetched or made in the cache, and opened."""

import contextlib
import os
import re
import shutil
from pathlib import Path

import pooch
import xarray as xr

from granbench.data.download import OnBytes
from granbench.data.fetch import (
    MIRROR_VARIABLE,
    NoMirrorError,
    fetch,
    folders_of,
    is_whole,
)
from granbench.data.making import how_to_make, is_made_at_once, is_made_on_request, made_file, make
from granbench.data.registry import RegistryEntry, entries
from granbench.data.registry import entry as registry_entry
from granbench.data.splits import select_split
from granbench.errors import ConfigurationError, DatasetError, DownloadError
from granbench.files.whole_file import whole_file
from granbench.records import mark_as_checked, open_records

CACHE_VARIABLE = "GRANBENCH_CACHE"
DEFAULTS = ("dem-triaxial", "dem-triaxial-mini")
"""Default datasets of a command; the first that is on this machine is used."""

REGISTERED_NAME = re.compile(r"[a-z0-9-]+(@[0-9.]+)?")

_checked: set[tuple[str, int, int, str]] = set()


def cache_folder() -> Path:
    """The folder of fetched datasets: `GRANBENCH_CACHE`, or the cache folder of the user.

    Raises
    ------
    ConfigurationError
        If the variable does not name a folder.
    """
    chosen = os.environ.get(CACHE_VARIABLE)
    try:
        folder = Path(chosen or pooch.os_cache("granbench")).expanduser()
        if not os.path.lexists(folder) or folder.is_dir():
            return folder
        reason = "it is not a folder"
    except (OSError, RuntimeError, ValueError) as error:
        reason = str(error)
    place = f"{CACHE_VARIABLE}={chosen}" if chosen else "the user's cache folder"
    raise ConfigurationError(
        f"{place} cannot hold datasets ({reason}); set {CACHE_VARIABLE} to a folder that can be "
        "written"
    )


def making_folder() -> Path:
    """The folder for datasets that are made here because no mirror provides them."""
    return cache_folder() / "made"


def local_file(entry: RegistryEntry) -> Path | None:
    """The file of an entry on this machine, in wheel, checkout or cache, or None.

    Size and SHA-256 must agree with the registry, or its values if it was made here; a checked file
    is not read again in this process unless it changes.
    """
    for folder in (*folders_of(entry), cache_folder()):
        if _is_whole(folder / entry.file, entry):
            return folder / entry.file
    return made_file(entry, making_folder())


def present_file(entry: RegistryEntry) -> Path | None:
    """Like `local_file`, but only the size is compared, for listings."""
    for folder in (*folders_of(entry), cache_folder()):
        path = folder / entry.file
        with contextlib.suppress(OSError):
            if path.is_file() and path.stat().st_size == entry.bytes:
                return path
    made = making_folder() / entry.file
    return made if os.path.isfile(made) else None


def _is_whole(path: Path, entry: RegistryEntry) -> bool:
    try:
        status = path.stat()
    except OSError:
        return False
    mark = (str(path), status.st_size, status.st_mtime_ns, entry.sha256)
    if mark in _checked:
        return True
    if not is_whole(path, entry):
        return False
    _checked.add(mark)
    mark_as_checked(path)
    return True


def registered_file(path: Path) -> RegistryEntry | None:
    """The entry with this file, byte for byte; None if the file is not registered.

    Parameters
    ----------
    path : a file with any name
    """
    candidates = (entry for entry in entries() if _is_whole(path, entry))
    return next(candidates, None)


def dataset_file(name: str, progress: OnBytes | None = None, *, minutes: bool = False) -> Path:
    """The checked file of a registered dataset, fetched or made when it is not on this machine.

    Parameters
    ----------
    name : `dem-triaxial` for the newest version, `dem-triaxial@1.0.0` for that one
    progress : called while the file is fetched
    minutes : whether a dataset that no mirror provides may be made here if it takes minutes; one
        that takes seconds is always made

    Raises
    ------
    RegistryError
        If the name is not registered.
    DownloadError
        If no mirror provides the file and it is not made here; the text names the remedies.
    DatasetError
        If what was made here is not the registered dataset.
    """
    entry = registry_entry(name)
    if found := local_file(entry):
        return found
    try:
        return fetch(entry, cache_folder(), progress)
    except NoMirrorError as failure:
        return _made(entry, failure, minutes=minutes)


def bring(
    name: str, folder: Path, progress: OnBytes | None = None, *, minutes: bool = False
) -> Path:
    """The file of a registered dataset, copied into a folder.

    Parameters
    ----------
    name, progress, minutes : as for `dataset_file`
    folder : where to put it; made when missing

    Raises
    ------
    GranbenchError
        As for `dataset_file`, or if the folder cannot be written or is full.
    """
    entry = registry_entry(name)
    try:
        return fetch(entry, folder, progress, also_in=(cache_folder(),))
    except NoMirrorError as failure:
        made = _made(entry, failure, minutes=minutes)
    with whole_file(folder / entry.file, DownloadError, size=made.stat().st_size) as copy:
        shutil.copyfile(made, copy)
    return folder / entry.file


def _made(entry: RegistryEntry, failure: NoMirrorError, *, minutes: bool) -> Path:
    """The file made here; otherwise an error with the ways to get it."""
    if made := made_file(entry, making_folder()):
        return made
    if is_made_at_once(entry) or (minutes and is_made_on_request(entry)):
        return make(entry, making_folder())
    here = ", ".join(present.id for present in entries() if present_file(present))
    ways = [
        "install the package granbench-data, which holds it",
        "run in a checkout of GranBench",
        f"set {MIRROR_VARIABLE} to a folder or address that holds {entry.file}",
    ]
    raise DownloadError(
        f"{entry.id} {entry.version} could not be fetched ({failure.tried}): {'; or '.join(ways)}",
        *how_to_make(entry),
        f". On this machine: {here or 'no dataset'}",
    ) from failure


def default_dataset() -> str:
    """The default dataset of training and scoring: one that is on this machine."""
    present = {entry.id for entry in entries() if present_file(entry)}
    return next((name for name in DEFAULTS if name in present), DEFAULTS[0])


def load(name: str, split: str | None = None, progress: OnBytes | None = None) -> xr.Dataset:
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
        If no mirror provides the file and it is not made here; see `dataset_file`.
    """
    ds = open_records(dataset_file(name, progress))
    return ds if split is None else select_split(ds, split)


def file_of(name_or_file: str, progress: OnBytes | None = None) -> Path:
    """A file by its path, or the file of a registered dataset by its name.

    Raises
    ------
    DatasetError
        If it is a path and there is no such file.
    """
    path = Path(name_or_file)
    if path.is_file():
        return path
    # A folder of that name, as `granbench generate` leaves behind, does not hide the dataset.
    if path.is_dir() and name_or_file not in {entry.id for entry in entries()}:
        raise DatasetError(f"{name_or_file}: is a folder; give a netCDF file in it")
    if not REGISTERED_NAME.fullmatch(name_or_file):
        raise DatasetError(
            f"{name_or_file}: there is no such file; give a netCDF file or the name of a "
            "registered dataset"
        )
    return dataset_file(name_or_file, progress)
