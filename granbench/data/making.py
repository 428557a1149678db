"""Datasets made on this machine by their registered command, if no mirror provides them.

A dataset that takes seconds is made whenever it is needed, one that takes minutes on request, and
one that takes hours never. Every hash of the values must be the registered one; the bytes of the
file may differ, because netCDF libraries write files differently.
"""

import logging
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

from granbench.data.fetch import one_at_a_time
from granbench.data.registry import RegistryEntry
from granbench.errors import DatasetError, DownloadError, GranbenchError, Setting

AT_ONCE_SECONDS = 60.0
"""Longest duration of a dataset that is made whenever it is needed."""
ON_REQUEST_SECONDS = 900.0
"""Longest duration of a dataset that is made on request."""
COMMAND = ["granbench", "generate"]
FOLDER_OPTION = "--out"
FOLDER = "DIR"
"""Stands for the folder in a registered command."""

PROGRAM = """
import ctypes, runpy, sys
if sys.platform == "linux":
    ctypes.CDLL(None).prctl(1, 15)  # SIGTERM when the parent process ends
runpy.run_module("granbench", run_name="__main__", alter_sys=True)
"""
"""Runs `granbench`, and stops with the process that started it, even if that is killed."""

logger = logging.getLogger(__name__)

_checked: set[tuple[str, int, int, str]] = set()


def is_made_at_once(entry: RegistryEntry) -> bool:
    """Whether the dataset is made whenever it is needed."""
    return _seconds(entry) <= AT_ONCE_SECONDS


def is_made_on_request(entry: RegistryEntry) -> bool:
    """Whether the dataset is made on request, within minutes."""
    return _seconds(entry) <= ON_REQUEST_SECONDS


def how_to_make(entry: RegistryEntry) -> tuple[str | Setting, ...]:
    """Parts of an error text: how to have the dataset made; empty if no command makes it."""
    if entry.generator_seconds is None:
        return ()
    time = duration(entry.generator_seconds)
    if is_made_on_request(entry):
        return (f"; or make it here, {time}, with ", Setting("minutes", True))
    return (
        f"; or make it with `{entry.generator}`, {time}, and give the file instead of the name",
    )


def duration(seconds: float) -> str:
    """A length of time in words: ``about 3 minutes``."""
    for unit, length in (("hour", 3600.0), ("minute", 60.0)):
        if seconds >= 1.5 * length:
            return f"about {seconds / length:.0f} {unit}s"
    return f"about {seconds:.0f} seconds"


def made_file(entry: RegistryEntry, folder: Path) -> Path | None:
    """The file that was made here earlier, if it still has the registered hashes.

    Parameters
    ----------
    entry : the dataset
    folder : where datasets are made
    """
    path = folder / entry.file
    try:
        status = path.stat()
    except OSError:
        return None
    mark = (str(path), status.st_size, status.st_mtime_ns, entry.content_sha256)
    if mark not in _checked:
        if _difference(path, entry) is not None:
            return None
        _checked.add(mark)
    return path


def make(entry: RegistryEntry, folder: Path) -> Path:
    """Run the registered command and check its result; an interrupted run is continued.

    Parameters
    ----------
    entry : the dataset; `is_made_on_request` holds
    folder : where datasets are made; it is created if necessary

    Returns
    -------
    Path of the file in the folder

    Raises
    ------
    DownloadError
        If the command fails or the folder cannot be written.
    DatasetError
        If the result is not the registered dataset.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with one_at_a_time(folder):
            return made_file(entry, folder) or _make(entry, folder)
    except OSError as error:
        raise DownloadError(
            f"{folder}: cannot be written ({error.strerror or error}); set GRANBENCH_CACHE to a "
            "folder that can be written"
        ) from error


def _make(entry: RegistryEntry, folder: Path) -> Path:
    command = shown_command(entry)
    workshop = folder / f"{entry.id}-{entry.version}.campaign"
    logger.info(f"making {entry.id} here by `{command}`, {duration(_seconds(entry))}")
    _run(entry, workshop)
    path = folder / entry.file
    try:
        os.replace(workshop / entry.file, path)
    except FileNotFoundError:
        raise DatasetError(
            f"`{command}` wrote no {entry.file}: this version of GranBench makes another version "
            f"of {entry.id}; install granbench-data"
        ) from None
    shutil.rmtree(workshop, ignore_errors=True)
    if reason := _difference(path, entry):
        path.unlink()
        raise DatasetError(
            f"{entry.id} {entry.version} was made here, but it is not the registered dataset "
            f"({reason}): the libraries or the processor of this machine give other numbers; "
            "install granbench-data or set GRANBENCH_MIRROR to a folder or address that holds it"
        )
    logger.info(f"{entry.id} was made here by `{command}`, content hash as registered")
    return path


def shown_command(entry: RegistryEntry) -> str:
    """The registered command without its folder."""
    return entry.generator.removesuffix(f" {FOLDER_OPTION} {FOLDER}")


def _run(entry: RegistryEntry, workshop: Path) -> None:
    words = [str(workshop) if word == FOLDER else word for word in shlex.split(entry.generator)]
    # The generators are in a layer above this one, and what they load stays out of this process.
    # -P: a folder `granbench` in the working folder is not the installed package.
    program = [sys.executable, "-P", "-c", PROGRAM, *words[1:]]
    shown = logger.isEnabledFor(logging.INFO) and sys.stderr is not None and sys.stderr.isatty()
    command = program if shown else [*program, "--quiet"]
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=None if shown else subprocess.PIPE,
        text=True,
        errors="replace",
    ) as process:
        try:
            _, errors = process.communicate()
        except BaseException:
            process.terminate()  # it stops its jobs and continues from there next time
            raise
    if process.returncode:
        lines = (errors or "").strip().splitlines()
        reason = lines[-1].removeprefix("error: ") if lines else "see the messages above"
        raise DownloadError(
            f"{entry.id} could not be made here: `{shown_command(entry)}` ended with exit code "
            f"{process.returncode} ({reason}); fetch again to continue"
        )


def _difference(path: Path, entry: RegistryEntry) -> str | None:
    """How the values of a file differ from the registered ones; None if they do not."""
    # Not at the top: verification imports the store, which imports this module.
    from granbench.data.verification import verify_file

    try:
        found = verify_file(path)
    except GranbenchError as error:
        return str(error)
    return None if found == entry else f"its name is {found.id if found else 'another'}"


def _seconds(entry: RegistryEntry) -> float:
    """Duration of the registered command; infinite if it cannot be run here."""
    words = shlex.split(entry.generator)
    runs = words[:2] == COMMAND and words[-2:] == [FOLDER_OPTION, FOLDER]
    if entry.generator_seconds is None or not runs:
        return float("inf")
    return entry.generator_seconds
