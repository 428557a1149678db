"""What the options of several commands have to obey."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import typer

from granbench.errors import ConfigurationError
from granbench.whole_file import cannot_write


def refuse_overwriting(out: Path, option: str, source: Path | None) -> None:
    """Refuse a target that is one of the command's own sources, under whatever name.

    Parameters
    ----------
    out : file to write
    option : that gives the source, for the error
    source : file that is read; None, or one that does not exist, cannot be overwritten

    Raises
    ------
    ConfigurationError
        If both are one file.
    """
    if source is not None and out.exists() and source.exists() and out.samefile(source):
        raise ConfigurationError(
            f"--out {out} is what {option} reads and would be overwritten; write to another file"
        )


def require_writable(option: str, file: Path) -> None:
    """Refuse, before any work, a file that could not be written; nothing is made.

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


def default_task() -> str:
    """The dataset of a command that names none, which says so where it is not the usual one."""
    from granbench.data.store import DEFAULTS, default_dataset

    task = default_dataset()
    if task != DEFAULTS[0]:
        typer.echo(
            f"{DEFAULTS[0]} is not on this machine, so {task} is taken; name another dataset with "
            "--task (`granbench data list`)",
            err=True,
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
