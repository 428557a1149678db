"""The board's folder: accepted submissions by task, each with its predictions or its model."""

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from granbench.errors import ConfigurationError, SubmissionError
from granbench.leaderboard.model_files import moved
from granbench.leaderboard.rerunning import Told
from granbench.leaderboard.submission import Submission, read_submission, write_submission
from granbench.leaderboard.validation import validate
from granbench.whole_file import cannot_write, whole_file

MINIMUM_SEEDS = 3


@dataclass(frozen=True)
class Row:
    """A submission and the file that holds it."""

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
            "granbench does not run from a checkout, so there is no board of its own; give the "
            "folder of submissions as --board"
        )
    return folder


def slug(name: str) -> str:
    """A file name from a model's name."""
    return re.sub(r"[^a-z0-9.]+", "-", name.lower()).strip("-.")


def accept(
    file: Path,
    folder: Path,
    dataset: xr.Dataset | None = None,
    *,
    replace: bool = False,
    progress: Told | None = None,
) -> Path:
    """Validate a submission and copy it and its predictions, or its model, onto the board.

    Parameters
    ----------
    file : the submission's JSON file
    folder : the board's folder
    dataset, progress : see `validate`
    replace : whether a submission of the same name may be replaced

    Returns
    -------
    The accepted JSON file, with the badge `rescored` or `rerun`

    Raises
    ------
    SubmissionError
        If it is not valid, was not evaluated on every axis or for three seeds, is on the board
        already, or the folder cannot be written to.
    """
    submission = validate(file, dataset, progress=progress)
    if len(submission.seeds) < MINIMUM_SEEDS:
        raise SubmissionError(
            f"{file}: the board needs at least {MINIMUM_SEEDS} seeds, this has "
            f"{len(submission.seeds)}; evaluate more"
        )
    if left_out := [score for score in submission.scores if score.status == "not_run"]:
        raise SubmissionError(
            f"{file}: axis {left_out[0].axis} was left out; the board needs every axis, run "
            "`granbench evaluate` without --axis"
        )
    stem = slug(submission.name)
    target = folder / submission.task / f"{stem}.json"
    _refuse_duplicates(submission, file, target, replace)
    write_submission(_taken_along(submission, file.parent, target), target)
    return target


def _taken_along(submission: Submission, source: Path, target: Path) -> Submission:
    """Copy what bears a submission out beside its place on the board; nothing older stays."""
    predictions, model = target.with_suffix(".nc"), f"{target.stem}.model"
    if submission.model is not None:
        try:
            moved_model = moved(submission.model, source, target.parent, model)
        except OSError as error:
            raise SubmissionError(cannot_write(target, error)) from error
        predictions.unlink(missing_ok=True)
        return submission.model_copy(update={"model": moved_model})
    if submission.predictions is not None:
        _copy(source / submission.predictions.file, predictions)
        reference = submission.predictions.model_copy(update={"file": predictions.name})
        submission = submission.model_copy(update={"predictions": reference})
    shutil.rmtree(target.parent / model, ignore_errors=True)
    return submission


def accepted(folder: Path) -> list[Row]:
    """Every submission on the board, by task and name.

    Raises
    ------
    SubmissionError
        If a file there breaks the schema.
    """
    files = sorted(folder.glob("*/*.json"))
    return [Row(read_submission(file), file) for file in files]


def _refuse_duplicates(submission: Submission, file: Path, target: Path, replace: bool) -> None:
    for row in accepted(target.parent.parent):
        other = row.submission
        if row.file == target and not replace:
            raise SubmissionError(
                f"{file}: {other.name!r} is on the board of {other.task} already; choose another "
                "name, or give --replace"
            )
        if row.file != target and _what_bears_out(other) == _what_bears_out(submission):
            what = "its predictions are those" if submission.predictions else "its model is that"
            raise SubmissionError(
                f"{file}: {what} of {other.name!r}, which is on the board already; submit a model "
                "once"
            )


def _what_bears_out(submission: Submission) -> tuple[object, ...]:
    """What no two submissions may share."""
    model = submission.model
    if model is None:
        return (submission.predictions.sha256 if submission.predictions else None,)
    digests = sorted(file.sha256 for file in model.files)
    return (submission.task, submission.dataset.version, model.baseline, *digests)


def _copy(source: Path, target: Path) -> None:
    with whole_file(target, SubmissionError) as partial:
        shutil.copyfile(source, partial)
