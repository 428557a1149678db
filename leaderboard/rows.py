"""The rows of a board: where they lie, and how they are read."""

import re
from dataclasses import dataclass
from pathlib import Path

from granbench.errors import ConfigurationError
from granbench.leaderboard.submission import Submission, read_submission


@dataclass(frozen=True)
class Row:
    """A submission and the file that it is in."""

    submission: Submission
    file: Path


def default_folder() -> Path:
    """`leaderboard/submissions` of the checkout that granbench runs from.

    Raises
    ------
    ConfigurationError
        If granbench does not run from a checkout.
    """
    folder = Path(__file__).parent / "submissions"
    if not folder.is_dir():
        raise ConfigurationError(
            "granbench does not run from a checkout, so it has no board of its own; give the "
            "folder of submissions"
        )
    return folder


def slug(name: str) -> str:
    """A file name from a model's name."""
    return re.sub(r"[^a-z0-9.]+", "-", name.lower()).strip("-.")


def place_on(folder: Path, submission: Submission) -> Path:
    """The JSON file of a submission on a board.

    Parameters
    ----------
    folder : the board's
    submission : to be put there
    """
    return folder / submission.task / f"{slug(submission.name)}.json"


def accepted(folder: Path) -> list[Row]:
    """Every submission on the board, by task and name.

    Raises
    ------
    SubmissionError
        If a file there breaks the schema.
    """
    return [Row(read_submission(file), file) for file in sorted(folder.glob("*/*.json"))]
