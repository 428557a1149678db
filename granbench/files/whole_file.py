"""Writing of files and folders that appear complete or not at all."""

import contextlib
import errno
import os
import shutil
import uuid
from collections.abc import Iterator
from pathlib import Path

from granbench.errors import GranbenchError

FULL_DISK = (errno.ENOSPC, errno.EDQUOT)
"""Error numbers of a full disk."""


@contextlib.contextmanager
def whole_file(
    path: Path, error: type[GranbenchError], *also: type[Exception], size: int = 0
) -> Iterator[Path]:
    """Give a temporary name next to `path`, which is renamed to `path` if the block succeeds.

    Parameters
    ----------
    path : final name; its folder is created if necessary, an existing file is replaced
    error : type of the error if the file cannot be written
    also : exceptions, in addition to OSError, by which a library reports a failed write
    size : bytes to be written, to recognise a full disk if the library does not report it

    Raises
    ------
    GranbenchError
        The given one, naming the file and the remedy; nothing is left on disk then.
    """
    partial = path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}.part")
    causes: tuple[type[Exception], ...] = (OSError, *also)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield partial
        os.replace(partial, path)
    except causes as problem:
        raise error(cannot_write(path, problem, size)) from problem
    finally:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)


@contextlib.contextmanager
def whole_folder(path: Path, error: type[GranbenchError]) -> Iterator[Path]:
    """Give a temporary folder, whose files are moved to `path` if the block succeeds.

    If `path` exists, its other files stay, and files of the same names are replaced in the order in
    which they were written.

    Parameters
    ----------
    path : final name; folders above it are created if necessary
    error : type of the error if the folder cannot be written, raised before the block begins

    Raises
    ------
    GranbenchError
        The given one, naming the folder and the remedy; nothing is left on disk then.
    """
    old = path.is_dir()
    made = [folder for folder in path.parents if not folder.exists()]
    name = f".{path.name or 'folder'}.{uuid.uuid4().hex[:8]}.part"
    # Inside an existing folder, which may be its own mount; next to a new one.
    partial = path / name if old else path.with_name(name)
    try:
        with _raised_as(error, path):
            partial.mkdir(parents=True)
        yield partial
        with _raised_as(error, path):
            if not path.is_dir():  # another command may have made it since
                partial.rename(path)
                return
            for file in sorted(partial.iterdir(), key=lambda file: file.stat().st_mtime_ns):
                os.replace(file, path / file.name)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
        for folder in made:
            with contextlib.suppress(OSError):
                folder.rmdir()  # fails if the block succeeded and the folder contains `path`


@contextlib.contextmanager
def _raised_as(error: type[GranbenchError], path: Path) -> Iterator[None]:
    """Raise an error of the system as the given error, naming the path."""
    try:
        yield
    except OSError as problem:
        raise error(cannot_write(path, problem)) from problem


def cannot_write(path: Path, problem: Exception, size: int = 0) -> str:
    """Error text for a file or folder that cannot be written: the reason and the remedy.

    Parameters
    ----------
    path : file or folder to be written
    problem : error of the system or a library
    size : bytes to be written, to recognise a full disk if the library does not report it
    """
    reason = problem.strerror if isinstance(problem, OSError) else None
    full = isinstance(problem, OSError) and problem.errno in FULL_DISK
    if not reason:
        # HDF5 reports "HDF error" for every cause.
        with contextlib.suppress(OSError):
            full = shutil.disk_usage(path.parent).free < size
        reason = "the disk is full" if full else str(problem) or type(problem).__name__
    remedy = "choose a folder that can be written"
    if full:
        remedy = "free some space or choose another folder"
    elif isinstance(problem, IsADirectoryError):
        remedy = "a folder has this name, choose another"
    return f"{path}: cannot be written ({reason}); {remedy}"
