"""The board's folder: accepted submissions by task, each with its predictions or its model."""

import contextlib
import os
import shutil
import uuid
from collections.abc import Sequence
from pathlib import Path

import xarray as xr

from granbench.benchmark.task import Task
from granbench.errors import SubmissionError
from granbench.files.whole_file import cannot_write
from granbench.leaderboard.admission import MINIMUM_SEEDS, Examination, examine
from granbench.leaderboard.model_files import moved
from granbench.leaderboard.rerunning import Progress
from granbench.leaderboard.rows import Row, accepted, default_folder, place_on, slug
from granbench.leaderboard.sealing import sealed
from granbench.leaderboard.submission import Submission, write_submission

LONGEST_WORD = 400

__all__ = [
    "MINIMUM_SEEDS",
    "Row",
    "accept",
    "accepted",
    "default_folder",
    "refuse_objections",
    "slug",
]


def accept(
    file: Path,
    folder: Path,
    dataset: xr.Dataset | None = None,
    *,
    task: Task | None = None,
    replace: bool = False,
    word: str | None = None,
    progress: Progress | None = None,
) -> Path:
    """Validate a submission and put it, with its predictions or its model, onto the board.

    The row has the recomputed numbers and a seal. It appears whole or not at all; a row that it
    replaces stays whole until then.

    Parameters
    ----------
    file : the submission's JSON file
    folder : the board's folder
    dataset, task, progress : see `granbench.leaderboard.validation.recompute`
    replace : whether a submission of the same name may be replaced
    word : why a maintainer accepts what the checks flag as a copy; kept in the row

    Returns
    -------
    The accepted JSON file, with the badge `rescored` or `rerun`

    Raises
    ------
    SubmissionError
        If it is not valid, was not evaluated on every axis or for three seeds, is a copy or on the
        board already, or the folder cannot be written to.
    """
    if word is not None and not 1 <= len(word.strip()) <= LONGEST_WORD:
        raise SubmissionError(f"the reason must be a sentence of 1 to {LONGEST_WORD} characters")
    examination = examine(file, folder, dataset, task=task, replace=replace, progress=progress)
    refuse_objections(file, examination, word)
    submission = examination.submission
    flagged = any(objection.flagged for objection in examination.objections)
    target = place_on(folder, submission)
    made = [place for place in (target.parent, *target.parent.parents) if not place.exists()]
    stage = target.parent / f".{target.stem}.{uuid.uuid4().hex[:8]}.part"
    try:
        stage.mkdir(parents=True)
        row = _taken_along(submission, file.parent, stage, target.stem)
        write_submission(sealed(row, stage, word if flagged else None), stage / target.name)
        _exchange(stage, target)
    except OSError as error:
        raise SubmissionError(cannot_write(target, error)) from error
    finally:
        shutil.rmtree(stage, ignore_errors=True)
        for place in made:
            with contextlib.suppress(OSError):
                place.rmdir()  # only where nothing was put into it
    return target


def refuse_objections(file: Path, examination: Examination, word: str | None) -> None:
    """Raise the first thing that the board has against a submission.

    Parameters
    ----------
    file : the submission's JSON file, for the message
    examination : see `granbench.leaderboard.admission.examine`
    word : a maintainer's, for what was flagged; None for none

    Raises
    ------
    SubmissionError
        Unless there is nothing left.
    """
    for objection in examination.objections:
        if not objection.flagged:
            raise SubmissionError(f"{file}: {objection.text}")
        if word is None:
            raise SubmissionError(
                f"{file}: {objection.text}; if it is a model of its own all the same, a maintainer "
                "may accept it with `granbench leaderboard add --reason`"
            )


def _taken_along(submission: Submission, source: Path, stage: Path, stem: str) -> Submission:
    """Copy the files that a submission's scores rest on, under the names that they will have."""
    if submission.model is not None:
        model = moved(submission.model, source, stage, f"{stem}.model")
        return submission.model_copy(update={"model": model})
    if submission.predictions is not None:
        name = f"{stem}.nc"
        shutil.copyfile(source / submission.predictions.file, stage / name)
        reference = submission.predictions.model_copy(update={"file": name})
        submission = submission.model_copy(update={"predictions": reference})
    return submission


def _exchange(stage: Path, target: Path) -> None:
    """Put a staged row in the place of an older one, or leave that as it was."""
    names = (target.name, f"{target.stem}.nc", f"{target.stem}.model")
    new = [name for name in names if (stage / name).exists()]
    old = stage / "old"
    old.mkdir()
    aside: list[str] = []
    placed: list[str] = []
    try:
        for name in names:
            if (target.parent / name).exists():
                os.replace(target.parent / name, old / name)
                aside.append(name)
        for name in reversed(new):  # the row itself comes last
            os.replace(stage / name, target.parent / name)
            placed.append(name)
    except OSError:
        _restore(stage, target.parent, aside, placed)
        raise


def _restore(stage: Path, folder: Path, aside: Sequence[str], placed: Sequence[str]) -> None:
    for name in placed:
        os.replace(folder / name, stage / f"{name}.refused")
    for name in aside:
        os.replace(stage / "old" / name, folder / name)
