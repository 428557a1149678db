"""Checks of options that several commands have."""

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer

from granbench.cli.printing import note
from granbench.errors import ConfigurationError
from granbench.files.whole_file import cannot_write
from granbench.units.plausible import LARGEST_SEED


def refuse_overwriting(out: Path, option: str, source: Path | None) -> None:
    """Refuse a target that is one of the command's own sources, under whatever name.

    Parameters
    ----------
    out : file to write
    option : option that gives the source, for the error
    source : file that is read; None, or one that does not exist, cannot be overwritten

    Raises
    ------
    ConfigurationError
        If both are one file.
    """
    if source is not None and out.exists() and source.exists() and out.samefile(source):
        raise ConfigurationError(
            f"--out {out} is the file that {option} reads and would be overwritten; write to "
            "another file"
        )


@contextmanager
def naming_option(option: str) -> Iterator[None]:
    """Put the option's name before an error of the library about its value."""
    try:
        yield
    except ConfigurationError as error:
        raise ConfigurationError(f"{option} {error}") from error


def require_writable(option: str, file: Path) -> None:
    """Refuse, before any work, a file that could not be written; no file is made.

    Raises
    ------
    ConfigurationError
        If a folder has the name, or the nearest folder that is there cannot be written to.
    """
    try:
        if file.is_dir():
            raise IsADirectoryError(None, "Is a directory")
        with tempfile.TemporaryFile(dir=next(above for above in file.parents if above.exists())):
            pass
    except OSError as error:
        raise ConfigurationError(f"{option} {cannot_write(file, error)}") from error


def require_folder(option: str, folder: Path) -> None:
    """Refuse, before any work, a folder that could not be made or written into.

    Raises
    ------
    ConfigurationError
        If a file has the name, or the folder, or the nearest above it, cannot be written to.
    """
    if folder.exists() and not folder.is_dir():
        raise ConfigurationError(f"{option} {folder} is a file; give a folder")
    require_writable(option, folder / "new" if folder.exists() else folder)


def default_task() -> str:
    """The task of a command without --task, with a note if it is not the usual one."""
    from granbench.data.store import DEFAULTS, default_dataset

    task = default_dataset()
    if task != DEFAULTS[0]:
        note(
            f"{DEFAULTS[0]} is not on this machine, so {task} is used; name another task with "
            "--task (`granbench task list`)"
        )
    return task


def require_one_of(option: str, given: str, allowed: Sequence[str]) -> None:
    """Refuse a word that an option does not know.

    Raises
    ------
    ConfigurationError
        Naming the option and the words that it knows.
    """
    if given not in allowed:
        raise ConfigurationError(f"{option} {given!r} must be one of {', '.join(allowed)}")


def seed_option(text: str) -> Any:
    """The option `--seed`, limited to numbers that every generator and file can hold."""
    return typer.Option("--seed", min=0, max=LARGEST_SEED, help=text)


def listed_seeds(text: str) -> list[int]:
    """The numbers of `--seeds`, such as ``0,1,2``.

    Raises
    ------
    ConfigurationError
        If they are not different whole numbers from 0 to `LARGEST_SEED`.
    """
    try:
        seeds = [int(part) for part in text.split(",")]
    except ValueError as error:
        raise ConfigurationError(
            f"--seeds {text[:60]!r} is not a list of numbers such as 0,1,2"
        ) from error
    if not 0 <= min(seeds) <= max(seeds) <= LARGEST_SEED or len(set(seeds)) < len(seeds):
        raise ConfigurationError(
            f"--seeds {text[:60]!r} must be different whole numbers from 0 to {LARGEST_SEED}"
        )
    return seeds


def core_count() -> int:
    """Processor cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


def require_cores(option: str, count: int) -> None:
    """Refuse more threads than the machine has cores, because they would wait for each other.

    Raises
    ------
    ConfigurationError
        Naming the option and how many there are.
    """
    if count > (cores := core_count()):
        raise ConfigurationError(
            f"{option} {count} is more than the {cores} cores of this machine; give 1 to {cores}"
        )
