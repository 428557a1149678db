"""The `.part` file of a download, opened safely whatever has its name before."""

import contextlib
import os
import shutil
import stat
from pathlib import Path
from typing import BinaryIO


def open_partial(path: Path, *, keep: bool) -> BinaryIO:
    """Open the file for writing at its end.

    Its name is predictable, so another user may have put a link, a FIFO or a folder there. It is
    removed, and the target of a link is not changed.

    Parameters
    ----------
    path : of the `.part` file
    keep : whether its present content is continued; otherwise it begins empty

    Raises
    ------
    OSError
        If the folder cannot be written.
    """
    if keep:
        with contextlib.suppress(OSError):
            return _own_file(path)
    discard(path)
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _guard()
    return os.fdopen(os.open(path, flags, 0o666), "wb")


def partial_size(path: Path) -> int:
    """Size of the file in bytes; 0 if it is not a regular file with a single name."""
    try:
        status = os.lstat(path)
    except OSError:
        return 0
    return status.st_size if _is_own(status) else 0


def discard(path: Path) -> None:
    """Remove the `.part` file, or what has its name."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _own_file(path: Path) -> BinaryIO:
    descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | _guard())
    if not _is_own(os.fstat(descriptor)):
        os.close(descriptor)
        raise OSError(f"{path} is not a regular file with a single name")
    return os.fdopen(descriptor, "ab")


def _is_own(status: os.stat_result) -> bool:
    """Whether it is a regular file with one name: a second name may be a file of the user."""
    return stat.S_ISREG(status.st_mode) and status.st_nlink == 1


def _guard() -> int:
    """Flags against following links and waiting for a FIFO, if the system has them."""
    return getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
