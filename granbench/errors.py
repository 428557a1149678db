"""Errors that a user can cause; each text names the file, the field and the remedy."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from difflib import get_close_matches


class Blank(str):
    """A word that the user replaces, such as ``HEADER``; it is written without quotes."""

    def __repr__(self) -> str:
        return str(self)


@dataclass(frozen=True)
class Setting:
    """A setting that an error asks for; Python and the command line spell it differently.

    Parameters
    ----------
    name : field of the settings object, or keyword argument
    value : that the user would give; None where only the setting is named

    Notes
    -----
    `str` gives the Python spelling, such as ``kind='oedometer'``; the command line maps the name
    to its option, see `GranbenchError.spelled`.
    """

    name: str
    value: object = None

    def __str__(self) -> str:
        return self.name if self.value is None else f"{self.name}={self.value!r}"


class GranbenchError(Exception):
    """Base of every error that a user can cause; the CLI prints its text and exits with 2.

    Parameters
    ----------
    parts : of the text, in order: plain text, and a `Setting` wherever the text names one
    """

    def __init__(self, *parts: str | Setting) -> None:
        super().__init__(*parts)

    def __str__(self) -> str:
        return self.spelled(str)

    def spelled(self, spelling: Callable[[Setting], str]) -> str:
        """The text of the error, with every setting written by `spelling`."""
        return "".join(
            spelling(part) if isinstance(part, Setting) else str(part) for part in self.args
        )


class ConfigurationError(GranbenchError):
    """A setting is outside what the physics or the program allows."""


class DatasetError(GranbenchError):
    """A file of stress-strain records does not follow the schema or differs from its hash."""


class RegistryError(GranbenchError):
    """A dataset, split, task or preset that is not registered."""


class DownloadError(GranbenchError):
    """No mirror gave the file whole and with the registered hash."""


class EngineError(GranbenchError):
    """A simulation engine is missing, or ended a simulation."""


class AnalysisError(GranbenchError):
    """A finite-element analysis that cannot go on."""


class ModelError(GranbenchError):
    """A model is unknown, its file is damaged, or it lacks what a path cannot give."""


class SubmissionError(GranbenchError):
    """A leaderboard submission that cannot be accepted."""


def alternatives(name: str, known: Iterable[str]) -> str:
    """What there is in place of a name: ``did you mean 'csuh'? there are j2, csuh``."""
    names = list(known)
    near = get_close_matches(name, names, n=1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return f"{hint}there are {', '.join(names) or 'none'}"
