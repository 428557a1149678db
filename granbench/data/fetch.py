"""Fetching of a dataset from a mirror: resumed, checked, and renamed when complete."""

import contextlib
import errno
import importlib.util
import os
import shutil
from collections.abc import Iterable, Iterator
from functools import partial as given
from pathlib import Path
from typing import NoReturn

import pooch

from granbench.data.download import MirrorFailure, OnBytes, download, plain
from granbench.data.partial_file import discard, open_partial
from granbench.data.registry import RegistryEntry
from granbench.errors import DownloadError, Setting

MINI_FOLDER = Path(__file__).parent / "mini"
"""The mini tier, inside the wheel."""
MIRROR_VARIABLE = "GRANBENCH_MIRROR"
DATA_PACKAGE = "granbench_data"
"""The package of the wheel `granbench-data`, which holds the files of the checkout."""


class NoMirrorError(DownloadError):
    """No mirror provides the file; `tried` says why for each of them."""

    def __init__(self, entry: RegistryEntry, tried: str) -> None:
        super().__init__(
            f"{entry.file} could not be fetched ({tried}); set {MIRROR_VARIABLE} to a folder or "
            "address that has it"
        )
        self.tried = tried


def checkout_datasets() -> Path | None:
    """The `datasets` folder of the checkout that this package runs from, if it is one."""
    root = Path(__file__).resolve().parents[2]
    # Next to an installed wheel a folder `datasets` belongs to another package.
    is_checkout = (root / "pyproject.toml").is_file() and (root / "datasets").is_dir()
    return root / "datasets" if is_checkout else None


def installed_datasets() -> list[Path]:
    """The folders of the package granbench-data, where it is installed."""
    with contextlib.suppress(ImportError, ValueError):
        if found := importlib.util.find_spec(DATA_PACKAGE):
            return [Path(folder) for folder in found.submodule_search_locations or ()]
    return []


def folders_of(entry: RegistryEntry) -> list[Path]:
    """Folders of this installation that may hold the file: the wheels' and the checkout's."""
    found = [MINI_FOLDER] if entry.tier == "mini" else []
    found += installed_datasets()
    return [*found, folder] if (folder := checkout_datasets()) else found


def mirrors_of(entry: RegistryEntry) -> list[str]:
    """Folders and addresses that may hold the file, in the order in which they are tried."""
    found = [str(folder) for folder in folders_of(entry)]
    if chosen := os.environ.get(MIRROR_VARIABLE):
        found.append(chosen)
    return [*found, *entry.mirrors]


def why_not(path: Path, entry: RegistryEntry) -> str | None:
    """What is wrong with the file of an entry; None if nothing is."""
    if not path.is_file():
        return "the file is not there"
    if (size := path.stat().st_size) != entry.bytes:
        return f"the file has {size} bytes instead of {entry.bytes}"
    if (digest := pooch.file_hash(str(path), alg="sha256")) != entry.sha256:
        return f"its SHA-256 is {digest[:12]}... instead of the registered {entry.sha256[:12]}..."
    return None


def is_whole(path: Path, entry: RegistryEntry) -> bool:
    """Whether the file of an entry is at a path and agrees with the registry."""
    try:
        return why_not(path, entry) is None
    except (OSError, ValueError):
        return False


def fetch(
    entry: RegistryEntry,
    folder: Path,
    progress: OnBytes | None = None,
    also_in: Iterable[Path] = (),
) -> Path:
    """Fetch the file of a dataset into a folder, unless it is there already.

    The bytes go to a `.part` file, which a later call continues, and get the final name only
    when size and SHA-256 agree with the registry.

    Parameters
    ----------
    entry : the dataset
    folder : for the file; created if necessary
    progress : called after every piece
    also_in : folders that may already hold it, such as the cache

    Returns
    -------
    path of the file

    Raises
    ------
    NoMirrorError
        If no mirror provides the registered file; the text says why for each of them.
    DownloadError
        If the folder cannot be written or is full.
    """
    target = folder / entry.file
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with one_at_a_time(folder):
            if is_whole(target, entry):
                return target
            held = [str(f) for f in also_in if is_whole(f / entry.file, entry)]
            _fetch_from_any([*held, *mirrors_of(entry)], entry, target, progress)
    except OSError as error:
        _local_failure(target, error)
    return target


def _fetch_from_any(
    mirrors: list[str], entry: RegistryEntry, target: Path, progress: OnBytes | None
) -> None:
    partial = target.with_name(target.name + ".part")
    failures = []
    for mirror in mirrors:
        try:
            if mirror.lower().startswith(("http://", "https://")):
                address = f"{mirror.rstrip('/')}/{entry.file}"
                check = given(why_not, entry=entry)
                download(address, entry.bytes, partial, check, progress)
            elif "://" in mirror:
                raise MirrorFailure("only folders and http(s) addresses can be mirrors")
            else:
                _copy(_folder(mirror) / entry.file, entry, partial, progress)
        except MirrorFailure as failure:
            failures.append(f"{plain(mirror)}: {failure}")
            continue
        os.replace(partial, target)
        return
    raise NoMirrorError(entry, "; ".join(failures) or "there is no mirror")


def _folder(mirror: str) -> Path:
    try:
        return Path(mirror).expanduser()
    except RuntimeError as error:  # ~nobody
        raise MirrorFailure(f"there is no such home folder ({error})") from error


@contextlib.contextmanager
def one_at_a_time(folder: Path) -> Iterator[None]:
    """Prevent two processes from writing into one folder, if the system has locks."""
    try:
        import fcntl
    except ImportError:  # Windows
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):  # a network folder may have no locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _local_failure(path: Path, error: OSError) -> NoReturn:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        with contextlib.suppress(OSError):
            discard(path.with_name(path.name + ".part"))
        raise DownloadError(
            f"{path}: the disk is full; free some space or choose another ", Setting("folder")
        ) from error
    raise DownloadError(
        f"{path}: cannot be written ({error.strerror or error}); choose a writable ",
        Setting("folder"),
        ", or set GRANBENCH_CACHE to one",
    ) from error


def _copy(source: Path, entry: RegistryEntry, partial: Path, progress: OnBytes | None) -> None:
    # Checked before it is copied: a wrong file in the checkout costs no disk space.
    try:
        reason = why_not(source, entry)
        opened = source.open("rb") if reason is None else None
    except (OSError, ValueError) as error:
        raise MirrorFailure(f"it cannot be read ({plain(error)})") from error
    if opened is None:
        raise MirrorFailure(reason)
    try:
        with opened, open_partial(partial, keep=False) as copy:
            shutil.copyfileobj(opened, copy)
    except OSError:
        with contextlib.suppress(OSError):
            discard(partial)
        raise
    if reason := why_not(partial, entry):
        discard(partial)
        raise MirrorFailure(reason)
    if progress:
        progress(entry.bytes, entry.bytes)
