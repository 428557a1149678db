"""The `.part` file that a download grows in: a file of its own, whatever has its name before."""

import contextlib
import os
import shutil
import stat
from pathlib import Path
from typing import BinaryIO


def open_partial(path: Path, *, keep: bool) -> BinaryIO:
    """Open the file for writing at its end.

    Its name can be predicted, so that somebody else may have put a link to another file, a FIFO
    or a folder there. Such a thing is removed, and what it points to is left as it is.

    Parameters
    ----------
    path : of the `.part` file
    keep : whether what is in it already is continued; otherwise it begins empty

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
    """Bytes that a download may continue from; 0 where there is no file of its own."""
    try:
        status = os.lstat(path)
    except OSError:
        return 0
    return status.st_size if _is_own(status) else 0


def discard(path: Path) -> None:
    """Remove whatever has the name of the `.part` file."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _own_file(path: Path) -> BinaryIO:
    descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | _guard())
    if not _is_own(os.fstat(descriptor)):
        os.close(descriptor)
        raise OSError(f"{path} is not a file of its own")
    return os.fdopen(descriptor, "ab")


def _is_own(status: os.stat_result) -> bool:
    """A regular file with one name only: a second name may be another file of the user's."""
    return stat.S_ISREG(status.st_mode) and status.st_nlink == 1


def _guard() -> int:
    """Flags by which no link is followed and no FIFO is waited for, where the system has them."""
    return getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
