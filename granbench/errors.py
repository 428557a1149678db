"""Errors that a user can cause; each text names the file, the field and the remedy."""

from collections.abc import Iterable
from difflib import get_close_matches


class GranbenchError(Exception):
    """Base of every error that a user can cause; the CLI prints its text and exits with 2."""


class ConfigurationError(GranbenchError):
    """A setting is outside what the physics or the program allows."""


class DatasetError(GranbenchError):
    """A file of stress-strain records does not follow the schema or differs from its hash."""


class RegistryError(GranbenchError):
    """A dataset, split or preset that nobody registered."""


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
