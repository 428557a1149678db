"""Whether a file is what it says it is, and what the registry says of it."""

from pathlib import Path

from granbench.data.registry import RegistryEntry, entries
from granbench.data.splits import split_hash
from granbench.data.store import Progress, file_of
from granbench.errors import DatasetError
from granbench.records import open_records, verify


def task_file(name_or_file: str, progress: Progress | None = None) -> Path:
    """The checked file of a task: what a model is trained or scored on is what it says it is.

    Parameters
    ----------
    name_or_file : as for `file_of`; a file of the user's is verified whole, a registered
        dataset's was checked when it was fetched
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

    Parameters
    ----------
    path : netCDF file of records

    Returns
    -------
    The registry entry that it agrees with, or None for a dataset that nobody registered

    Raises
    ------
    DatasetError
        If the file breaks the schema; if a variable differs from its hash, by name; if the file
        was changed and sealed again under a registered version.
    """
    with open_records(path) as ds:
        verify(ds, str(path))
        name = (str(ds.attrs["dataset"]), str(ds.attrs["version"]))
        entry = {(e.id, e.version): e for e in entries()}.get(name)
        if entry is None:
            return None
        # The splits first: that they moved says more than that some value did.
        for what, found, registered in (
            ("split", split_hash(ds), entry.split_sha256),
            ("content", str(ds.attrs["content_sha256"]), entry.content_sha256),
        ):
            if found != registered:
                raise DatasetError(
                    f"{path}: calls itself {' '.join(name)}, but its {what}_sha256 "
                    f"{found[:12]}... is not the registered {registered[:12]}...; it was changed "
                    "and sealed again: fetch it with `granbench data fetch`, or give your own "
                    "data another name"
                )
        return entry
