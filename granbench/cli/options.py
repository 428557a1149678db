"""What the options of several commands have to obey."""

from collections.abc import Sequence
from pathlib import Path

from granbench.errors import ConfigurationError


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


def require_one_of(option: str, given: str, allowed: Sequence[str]) -> None:
    """Refuse a word that an option does not know.

    Raises
    ------
    ConfigurationError
        Naming the option and the words that it knows.
    """
    if given not in allowed:
        raise ConfigurationError(f"{option} {given!r} must be one of {', '.join(allowed)}")
