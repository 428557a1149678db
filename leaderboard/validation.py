"""Validate a submission: compute every number again from its predictions or its model."""

from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from granbench.benchmark.evaluation_run import SeedProgress
from granbench.benchmark.metric import METRIC_VERSION
from granbench.benchmark.predictions import evaluated, open_predictions
from granbench.benchmark.registry import axes, axis_code
from granbench.benchmark.scored_task import ScoredPredictions
from granbench.benchmark.scoring import score, scored_predictions
from granbench.benchmark.task import Task
from granbench.data.normalisation import Normalisation
from granbench.errors import SubmissionError
from granbench.leaderboard.agreement import RERUN, RESCORED, compare
from granbench.leaderboard.rerunning import rerun
from granbench.leaderboard.submission import Submission, file_digest, read_submission
from granbench.leaderboard.submitted_task import records_of, require_same_task, task_of


@dataclass(frozen=True)
class Validated:
    """A submission whose numbers were computed again.

    Parameters
    ----------
    submission : with the recomputed numbers and the badge `rescored` or `rerun`
    claimed : as it was submitted
    predictions : what the numbers were computed from: submitted, or made by its model
    records : the whole dataset, see `granbench.benchmark.task.Task.view`
    not_reproduced : labels of claimed numbers that were not reproduced, of analyses that the model
        has lost
    """

    submission: Submission
    claimed: Submission
    predictions: xr.Dataset
    records: xr.Dataset
    not_reproduced: tuple[str, ...] = ()


def validate(
    path: Path,
    dataset: xr.Dataset | None = None,
    *,
    task: Task | None = None,
    progress: SeedProgress | None = None,
) -> Submission:
    """Score a submission again and compare every number; see `recompute`.

    Returns
    -------
    The submission with the recomputed numbers, and the badge `rescored` where they come from its
    predictions, or `rerun` where its model was run again
    """
    return recompute(path, dataset, task=task, progress=progress).submission


def recompute(
    path: Path,
    dataset: xr.Dataset | None = None,
    *,
    task: Task | None = None,
    progress: SeedProgress | None = None,
) -> Validated:
    """Score a submission again and compare every number.

    Parameters
    ----------
    path : the submission's JSON file, its predictions or its model beside it
    dataset : the whole dataset of the task; the one that the task names by default
    task : the registered task of the submission's name by default or, where `dataset` is given and
        is not that task's, the task of these records alone
    progress : called while a model is run, with the seed and what was done

    Raises
    ------
    SubmissionError
        If the file breaks the schema, refers to another dataset, lacks its predictions or its
        model, or has a number that they do not give.
    """
    submission = read_submission(path)
    if submission.metric_version != METRIC_VERSION:
        raise SubmissionError(
            f"{path}: scores follow metric version {submission.metric_version}, this board "
            f"{METRIC_VERSION}; run `granbench evaluate` again"
        )
    task = task or task_of(submission, path, dataset)
    whole = dataset if dataset is not None else records_of(task, path)
    require_same_task(submission, task, whole, path)
    records = task.view(whole)
    if submission.model is None:
        predictions, badge, how = _checked_predictions(submission, path), "rescored", RESCORED
    else:
        predictions, badge, how = (
            rerun(submission, records, path, progress, task=task), "rerun", RERUN,
        )  # fmt: skip
    _check_parameters(submission, predictions, path)
    truth, normalisation = evaluated(records), Normalisation.from_training(records)
    card = score(predictions, truth, normalisation, task)
    if submission.model is None:
        _check_ground_truth(scored_predictions(predictions, truth, normalisation, task), path)
    not_reproduced = compare(submission, card, path, how)
    if card.perfect and submission.role == "model":
        raise SubmissionError(
            f"{path}: every error is exactly zero, so these are the records themselves; submit "
            "what a model predicts, or set role to 'ceiling'"
        )
    if submission.role == "ceiling" and not card.perfect:
        raise SubmissionError(
            f"{path}: role is 'ceiling', but its errors are not zero, and a ceiling reads the "
            "records; set role to 'model'"
        )
    recomputed = submission.model_copy(
        update={
            "badge": badge,
            "normalisation": card.normalisation,
            "scores": card.scores,
            "curves": card.curves,
        }
    )
    return Validated(recomputed, submission, predictions, records, not_reproduced)


def _checked_predictions(submission: Submission, path: Path) -> xr.Dataset:
    if submission.predictions is None:
        raise SubmissionError(f"{path}: has no predictions; run `granbench evaluate` again")
    file = path.parent / submission.predictions.file
    if not file.is_file():
        raise SubmissionError(
            f"{path}: the predictions file {submission.predictions.file} is missing; put it "
            "into the same folder"
        )
    if file.stat().st_size != submission.predictions.bytes:
        raise SubmissionError(
            f"{path}: predictions.bytes is {submission.predictions.bytes}, but {file.name} has "
            f"{file.stat().st_size} bytes; run `granbench evaluate` again"
        )
    if file_digest(file) != submission.predictions.sha256:
        raise SubmissionError(
            f"{path}: predictions.sha256 is not the digest of {file.name}; submit the "
            "predictions that the scores were made from"
        )
    predictions = open_predictions(file)
    seeds = [int(seed) for seed in predictions["seed"].values]
    if seeds != list(submission.seeds):
        raise SubmissionError(
            f"{path}: seeds are {list(submission.seeds)}, but {file.name} holds {seeds}; they "
            "must agree"
        )
    about = predictions.attrs.get("dataset_content_sha256")
    if about != submission.dataset.content_sha256:
        raise SubmissionError(
            f"{path}: {file.name} was made from other records (content hash {about}); run "
            "`granbench evaluate` again"
        )
    return predictions


def _check_parameters(submission: Submission, predictions: xr.Dataset, path: Path) -> None:
    """Refuse a number of parameters that is not the one whose cost was measured."""
    if "parameters" not in predictions:
        return
    counted = [float(value) for value in predictions["parameters"].values]
    stated = submission.parameters
    wanted = counted[0] if stated is None else stated
    if any(value != wanted for value in counted):
        found = ", ".join(f"{value:g}" for value in dict.fromkeys(counted))
        raise SubmissionError(
            f"{path}: parameters is {stated}, but its predictions are of a model with {found}; "
            "run `granbench evaluate` again"
        )


def _check_ground_truth(scored: ScoredPredictions, path: Path) -> None:
    """Refuse stored values of the ground truth that it does not give, because they are scored."""
    for axis in axes():
        try:
            with axis_code(axis):
                axis.check_ground_truth(scored)
        except SubmissionError as error:
            raise SubmissionError(f"{path}: {error}") from error
