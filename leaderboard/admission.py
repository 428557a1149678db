"""Admission to the board: the checks of `submission validate` and of `leaderboard add`."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from granbench.benchmark.evaluation_run import SeedProgress
from granbench.benchmark.predictions import open_predictions
from granbench.benchmark.task import Task
from granbench.errors import GranbenchError
from granbench.leaderboard.originality import (
    Errors,
    copied_protocols,
    copied_seeds,
    errors_of,
    is_classical,
    near_truth,
    same_scores,
    seeds_score_alike,
)
from granbench.leaderboard.rows import Row, accepted, place_on
from granbench.leaderboard.submission import Submission
from granbench.leaderboard.validation import Validated, recompute

MINIMUM_SEEDS = 3


@dataclass(frozen=True)
class Objection:
    """A reason why the board does not accept a submission.

    Parameters
    ----------
    text : a sentence without the file's name, with the remedy
    flagged : whether it looks like a copy, which a maintainer can accept by stating a reason
    """

    text: str
    flagged: bool = False


@dataclass(frozen=True)
class Examination:
    """A valid submission, and the objections of the board to it.

    Parameters
    ----------
    validated : with the recomputed numbers
    objections : empty if the board accepts it
    """

    validated: Validated
    objections: tuple[Objection, ...]

    @property
    def submission(self) -> Submission:
        """The submission as the board would store it."""
        return self.validated.submission


def examine(
    file: Path,
    folder: Path | None,
    dataset: xr.Dataset | None = None,
    *,
    task: Task | None = None,
    replace: bool = False,
    progress: SeedProgress | None = None,
) -> Examination:
    """Validate a submission, and find out whether the board accepts it.

    Parameters
    ----------
    file : the submission's JSON file
    folder : the board's; None for no board to compare with
    dataset, task, progress : see `granbench.leaderboard.validation.recompute`
    replace : whether a row of the same name may be replaced

    Raises
    ------
    SubmissionError
        If it is not valid, whatever is on the board.
    """
    validated = recompute(file, dataset, task=task, progress=progress)
    errors = errors_of(validated.predictions, validated.records)
    rows = accepted(folder) if folder is not None else []
    rows = [row for row in rows if row.file.resolve() != file.resolve()]
    objections = [
        *_incomplete(validated.submission),
        *_name_taken(validated.submission, folder, rows, replace),
        *_of_truth(validated, errors),
        *_of_rows(validated, errors, folder, rows),
        *_of_seeds(validated, errors),
    ]
    found = {"deterministic": _deterministic(validated)}
    stored = validated.submission.model_copy(update=found)
    return Examination(
        Validated(
            stored, validated.claimed, validated.predictions, validated.records,
            validated.not_reproduced,
        ),
        tuple(objections),
    )  # fmt: skip


def _deterministic(validated: Validated) -> bool | None:
    """Whether the seeds of a model only draw the noise: recomputed, never taken from the file."""
    return seeds_score_alike(validated.submission.scores) or None


def _incomplete(submission: Submission) -> Iterator[Objection]:
    if len(submission.seeds) < MINIMUM_SEEDS:
        yield Objection(
            f"the board needs at least {MINIMUM_SEEDS} seeds, also for a deterministic model, "
            f"whose seeds draw the noise; this has {len(submission.seeds)}, evaluate more"
        )
    if left_out := [score for score in submission.scores if score.status == "not_run"]:
        yield Objection(
            f"axis {left_out[0].axis} was left out; the board needs every axis of the task, run "
            "`granbench evaluate` without --axis"
        )


def _name_taken(
    submission: Submission, folder: Path | None, rows: list[Row], replace: bool
) -> Iterator[Objection]:
    if folder is None or replace:
        return
    target = place_on(folder, submission)
    if any(row.file == target for row in rows):
        yield Objection(
            f"{submission.name!r} is on the board of {submission.task} already; choose another "
            "name, or replace that row"
        )


def _exempt(submission: Submission) -> bool:
    """Whether a submission may be close to the truth: a ceiling, or a classical model."""
    model = submission.model
    return submission.role == "ceiling" or (model is not None and is_classical(model.baseline))


def _of_truth(validated: Validated, errors: Errors | None) -> Iterator[Objection]:
    if errors is None or _exempt(validated.submission):
        return
    found = [
        *copied_protocols(validated.predictions, validated.records),
        *near_truth(errors, validated.records),
    ]
    if found:
        yield Objection(
            f"it is too close to the truth for a model: {found[0]}; submit what a model predicts, "
            "or, for a classical model, the model itself (`granbench evaluate --keep model`)",
            flagged=True,
        )


def _of_seeds(validated: Validated, errors: Errors | None) -> Iterator[Objection]:
    submission = validated.submission
    if errors is None or _exempt(submission) or seeds_score_alike(submission.scores):
        return
    if pairs := copied_seeds(errors, errors):
        one, other = (submission.seeds[place] for place in pairs[0])
        yield Objection(
            f"seeds {one} and {other} are one model: their predictions are the same, or much "
            "closer to each other than to the truth; train a model for each seed, or submit one "
            "deterministic model",
            flagged=True,
        )


def _of_rows(
    validated: Validated, errors: Errors | None, folder: Path | None, rows: list[Row]
) -> Iterator[Objection]:
    submission = validated.submission
    target = None if folder is None else place_on(folder, submission)
    for row in rows:
        other = row.submission
        if row.file == target:
            continue
        if _evidence(other) == _evidence(submission):
            what = "predictions are those" if submission.predictions else "model is that"
            yield Objection(
                f"its {what} of {other.name!r}, which is on the board already; submit a model once"
            )
        elif (submission.role, other.role) == ("ceiling", "ceiling"):
            if _same_task(submission, other):
                yield Objection(
                    f"the board of {submission.task} has a ceiling already, {other.name!r}",
                    flagged=True,
                )
        elif not _exempt(submission) and _copied(validated, errors, row):
            yield Objection(
                f"its predictions are those of {other.name!r}, which is on the board already, or "
                "much closer to them than to the truth; submit a model once",
                flagged=True,
            )


def _same_task(one: Submission, other: Submission) -> bool:
    places = ((item.task, item.task_version, item.dataset) for item in (one, other))
    return len(set(places)) == 1


def _copied(validated: Validated, errors: Errors | None, row: Row) -> bool:
    if not _same_task(validated.submission, row.submission):
        return False
    if same_scores(validated.submission.scores, row.submission.scores):
        return True
    if errors is None or row.submission.predictions is None or row.submission.role == "ceiling":
        return False
    try:
        predictions = open_predictions(row.file.parent / row.submission.predictions.file)
        theirs = errors_of(predictions, validated.records)
    except GranbenchError:
        return False  # a damaged row is reported when the site is built
    return theirs is not None and bool(copied_seeds(errors, theirs))


def _evidence(submission: Submission) -> tuple[object, ...]:
    """The files that no two submissions may share, by digest."""
    model = submission.model
    if model is None:
        return (submission.predictions.sha256 if submission.predictions else None,)
    digests = sorted(file.sha256 for file in model.files)
    where = (submission.task, submission.task_version, submission.dataset.version)
    return (*where, model.baseline, *digests)
