"""Files, and folders of them, that appear whole or not at all."""

import contextlib
import errno
import os
import shutil
import uuid
from collections.abc import Iterator
from pathlib import Path

from granbench.errors import GranbenchError

FULL_DISK = (errno.ENOSPC, errno.EDQUOT)
"""Error numbers that more space would mend."""


@contextlib.contextmanager
def whole_file(
    path: Path, error: type[GranbenchError], *also: type[Exception], size: int = 0
) -> Iterator[Path]:
    """Give a temporary name beside `path`; it becomes `path` when the block ends well.

    Parameters
    ----------
    path : final name; its folder is made when it is absent, a file there is replaced
    error : what a failure to write is raised as
    also : exceptions, besides OSError, by which a library says that it could not write
    size : bytes that are about to be written, to tell a full disk where a library does not

    Raises
    ------
    GranbenchError
        The given one, naming the file and the remedy; nothing is left behind then.
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
    """Give a temporary folder; what is written into it is in `path` when the block ends well.

    Where `path` is there before, its other files stay, and those of the same names are replaced
    in the order in which they were written.

    Parameters
    ----------
    path : final name; folders above it are made when they are absent
    error : what a folder that cannot be written is raised as, before the block begins

    Raises
    ------
    GranbenchError
        The given one, naming the folder and the remedy; nothing is left behind then.
    """
    old = path.is_dir()
    made = [folder for folder in path.parents if not folder.exists()]
    name = f".{path.name or 'folder'}.{uuid.uuid4().hex[:8]}.part"
    # Within an old folder, which may be a mount of its own, beside a new one.
    partial = path / name if old else path.with_name(name)
    try:
        with _said_as(error, path):
            partial.mkdir(parents=True)
        yield partial
        with _said_as(error, path):
            if not path.is_dir():  # another command may have made it since
                partial.rename(path)
                return
            for file in sorted(partial.iterdir(), key=lambda file: file.stat().st_mtime_ns):
                os.replace(file, path / file.name)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
        for folder in made:
            with contextlib.suppress(OSError):
                folder.rmdir()  # fails where the block has ended well, and the folder holds `path`


@contextlib.contextmanager
def _said_as(error: type[GranbenchError], path: Path) -> Iterator[None]:
    """Raise what the system cannot do as the given error, naming the path."""
    try:
        yield
    except OSError as problem:
        raise error(cannot_write(path, problem)) from problem


def cannot_write(path: Path, problem: Exception, size: int = 0) -> str:
    """One sentence: a file or folder cannot be written, why, and what would mend that.

    Parameters
    ----------
    path : what was to be written
    problem : what the system or a library raised
    size : bytes that were to be written, to tell a full disk where a library does not
    """
    reason = problem.strerror if isinstance(problem, OSError) else None
    full = isinstance(problem, OSError) and problem.errno in FULL_DISK
    if not reason:
        # HDF5 says "HDF error" whatever happened.
        with contextlib.suppress(OSError):
            full = shutil.disk_usage(path.parent).free < size
        reason = "the disk is full" if full else str(problem) or type(problem).__name__
    remedy = "choose a folder that can be written"
    if full:
        remedy = "free some space or choose another folder"
    elif isinstance(problem, IsADirectoryError):
        remedy = "a folder has this name, choose another"
    return f"{path}: cannot be written ({reason}); {remedy}"
