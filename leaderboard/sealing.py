"""The seal of a row: a digest of the row and of the files that its scores rest on.

It is made when the board accepts a row, and checked whenever the site is built, so that a number, a
badge or a file can only be changed by validating the row again.

``python -m granbench.leaderboard.sealing`` seals rows of the checkout that were accepted before
seals were introduced.
"""

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path

from granbench.errors import SubmissionError
from granbench.leaderboard.submission import (
    Acceptance,
    Submission,
    file_digest,
    read_submission,
    write_submission,
)


def row_digest(submission: Submission, folder: Path) -> str:
    """SHA-256 of a row without its seal, and of the files beside it.

    Parameters
    ----------
    submission : the row
    folder : where it lies

    Raises
    ------
    SubmissionError
        If a file is missing.
    """
    word = submission.acceptance.word if submission.acceptance else None
    unsealed = submission.model_copy(update={"acceptance": None})
    names = [submission.predictions.file] if submission.predictions else []
    names += [file.path for file in submission.model.files] if submission.model else []
    try:
        files = {name: file_digest(folder / name) for name in names}
    except OSError as error:
        raise SubmissionError(
            f"{folder}: the files of {submission.name!r} cannot be read ({error.strerror or error})"
            "; put them back, or add the submission again"
        ) from error
    content = [unsealed.model_dump(mode="json", exclude_none=True), files, word]
    text = json.dumps(content, sort_keys=True, ensure_ascii=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def sealed(submission: Submission, folder: Path, word: str | None = None) -> Submission:
    """Seal a row.

    Parameters
    ----------
    submission : the row
    folder : where its files lie
    word : why a maintainer accepted a submission that the checks flagged
    """
    blank = Acceptance(digest="0" * 64, word=word)
    digest = row_digest(submission.model_copy(update={"acceptance": blank}), folder)
    return submission.model_copy(update={"acceptance": Acceptance(digest=digest, word=word)})


def require_seal(submission: Submission, file: Path) -> None:
    """Make sure that a row is unchanged since it was accepted.

    Raises
    ------
    SubmissionError
        If it has no seal, or it or one of its files was changed.
    """
    if submission.acceptance is None:
        raise SubmissionError(
            f"{file}: has the badge {submission.badge!r}, but no seal of the board; put it there "
            "with `granbench leaderboard add`"
        )
    if submission.acceptance.digest != row_digest(submission, file.parent):
        raise SubmissionError(
            f"{file}: the row or a file beside it was changed after it was accepted; add "
            "the submission again with `granbench leaderboard add --replace`"
        )


def seal_older_rows(folder: Path) -> Iterator[Path]:
    """Seal every row of a board that has no seal, and give its file."""
    for file in sorted(folder.glob("*/*.json")):
        submission = read_submission(file)
        if submission.acceptance is None and submission.badge != "claimed":
            write_submission(sealed(submission, file.parent), file)
            yield file


if __name__ == "__main__":
    from granbench.leaderboard.board import default_folder

    for sealed_file in seal_older_rows(default_folder()):
        print(f"{sealed_file} is sealed")
