"""Lock on a folder, which ends with the process that holds it."""

import contextlib
import os
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

from granbench.errors import GranbenchError
from granbench.files.whole_file import cannot_write

try:
    import fcntl
except ImportError:  # Windows: folders are not locked there
    fcntl = None  # type: ignore[assignment]

LOCK_FILE = ".lock"


@contextlib.contextmanager
def locked_folder(folder: Path, error: type[GranbenchError]) -> Iterator[None]:
    """Keep other commands from writing to a folder while the block runs.

    The system releases the lock when the process ends in any way; the file that a killed process
    leaves does not lock the folder.

    Parameters
    ----------
    folder : created if necessary
    error : type of the error

    Raises
    ------
    GranbenchError
        The given one, if another command has locked the folder or it cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = _opened(folder / LOCK_FILE)
    except OSError as problem:
        raise error(cannot_write(folder, problem)) from problem
    with lock:
        if fcntl is not None and not _taken(lock):
            raise error(
                f"another command is writing to {folder} ({_holder(lock)}); wait for it, stop it, "
                "or give another folder"
            )
        with contextlib.suppress(OSError):  # a full disk; the lock itself needs no space
            os.ftruncate(lock.fileno(), 0)
            os.write(lock.fileno(), f"process {os.getpid()} on {socket.gethostname()}".encode())
        try:
            yield
        finally:
            with contextlib.suppress(OSError):
                (folder / LOCK_FILE).unlink(missing_ok=True)


def _opened(path: Path) -> TextIO:
    return open(path, "a+", encoding="utf-8")


def _taken(lock: TextIO) -> bool:
    """Whether this process now holds the lock; a lock on a removed file does not count."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return True
    try:
        return os.path.samestat(os.fstat(lock.fileno()), os.stat(lock.name))
    except FileNotFoundError:
        return False


def _holder(lock: TextIO) -> str:
    lock.seek(0)
    return lock.read() or "a process that has just started or ended"
