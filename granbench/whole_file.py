"""Files that appear whole or not at all."""

import contextlib
import os
import shutil
import uuid
from collections.abc import Iterator
from pathlib import Path

from granbench.errors import GranbenchError


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
        raise error(
            f"{path}: cannot be written ({_reason(problem, path.parent, size)}); choose a folder "
            "that is writable and has free space"
        ) from problem
    finally:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)


def _reason(problem: Exception, folder: Path, size: int) -> str:
    if isinstance(problem, OSError) and problem.strerror:
        return problem.strerror
    # HDF5 says "HDF error" whatever happened.
    with contextlib.suppress(OSError):
        if shutil.disk_usage(folder).free < size:
            return "the disk is full"
    return str(problem) or type(problem).__name__
