"""Validation: of a submission only what its predictions or its model give again is believed."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from granbench.benchmark.every_axis import score
from granbench.benchmark.metrics import METRIC_VERSION
from granbench.benchmark.predictions import evaluated, open_predictions
from granbench.benchmark.protocols import PROTOCOLS
from granbench.benchmark.statistics import align
from granbench.data.normalisation import Normalisation
from granbench.data.registry import entry
from granbench.data.splits import split_hash
from granbench.data.store import load
from granbench.errors import GranbenchError, SubmissionError
from granbench.leaderboard.agreement import RERUN, RESCORED, compare
from granbench.leaderboard.rerunning import Progress, rerun
from granbench.leaderboard.submission import Submission, file_digest, read_submission

TRUTH_TOLERANCE = 1e-3
"""By which a recomputed ground truth may differ, in training standard deviations or relative to a
larger stress: machines round differently, and error control then takes other steps. Of the curves
and stresses of an analysis, relative to their root mean square."""


@dataclass(frozen=True)
class Validated:
    """A submission whose numbers were computed again.

    Parameters
    ----------
    submission : with the recomputed numbers and the badge `rescored` or `rerun`
    claimed : as it was submitted
    predictions : that the numbers were computed from: submitted, or made by its model
    records : the whole dataset of the task
    not_reproduced : labels of claimed numbers that did not come out again, for the model has lost
        the analyses that they are of
    """

    submission: Submission
    claimed: Submission
    predictions: xr.Dataset
    records: xr.Dataset
    not_reproduced: tuple[str, ...] = ()


def validate(
    path: Path, dataset: xr.Dataset | None = None, *, progress: Progress | None = None
) -> Submission:
    """Score a submission again and compare every number; see `recompute`.

    Returns
    -------
    The submission with the recomputed numbers, and the badge `rescored` where they come from its
    predictions, or `rerun` where its model was run again
    """
    return recompute(path, dataset, progress=progress).submission


def recompute(
    path: Path, dataset: xr.Dataset | None = None, *, progress: Progress | None = None
) -> Validated:
    """Score a submission again and compare every number.

    Parameters
    ----------
    path : the submission's JSON file, its predictions or its model beside it
    dataset : the whole records of the task; the registered dataset that it names by default
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
    records = dataset if dataset is not None else _registered(submission, path)
    _check_dataset(submission, records, path)
    if submission.model is None:
        predictions, badge, how = _checked_predictions(submission, path), "rescored", RESCORED
    else:
        predictions, badge, how = rerun(submission, records, path, progress), "rerun", RERUN
    _check_parameters(submission, predictions, path)
    truth, normalisation = evaluated(records), Normalisation.from_training(records)
    card = score(predictions, truth, normalisation)
    if submission.model is None:
        _check_noised_truth(predictions, truth, normalisation, path)
        _check_embedded_truth(predictions, truth, path)
    not_reproduced = compare(submission, card, path, how)
    if card.perfect and submission.role == "model":
        raise SubmissionError(
            f"{path}: every error is exactly zero, which only the truth itself can be; submit "
            "what a model predicts, or set role to 'ceiling'"
        )
    if submission.role == "ceiling" and not card.perfect:
        raise SubmissionError(
            f"{path}: role is 'ceiling', but its errors are not zero; a ceiling is shown the "
            "truth: set role to 'model'"
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


def _registered(submission: Submission, path: Path) -> xr.Dataset:
    name = f"{submission.dataset.name}@{submission.dataset.version}"
    try:
        entry(name)
    except GranbenchError as error:
        raise SubmissionError(f"{path}: {error}") from error
    return load(name)


def _check_dataset(submission: Submission, records: xr.Dataset, path: Path) -> None:
    claimed = submission.dataset
    actual = {
        "name": str(records.attrs.get("dataset")),
        "version": str(records.attrs.get("version")),
        "content_sha256": str(records.attrs.get("content_sha256")),
        "split_sha256": split_hash(records),
    }
    for field, value in actual.items():
        if getattr(claimed, field) != value:
            raise SubmissionError(
                f"{path}: dataset.{field} is {getattr(claimed, field)}, but the records have "
                f"{value}; evaluate on the registered dataset"
            )
    if submission.task != claimed.name:
        raise SubmissionError(
            f"{path}: task is {submission.task!r}, but its dataset is {claimed.name!r}; they "
            "must agree"
        )


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


def _check_noised_truth(
    predictions: xr.Dataset, truth: xr.Dataset, normalisation: Normalisation, path: Path
) -> None:
    """Refuse a stored ground truth that the ground truth does not give (its values are scored)."""
    if "noised_truth" not in predictions:
        return
    from granbench.benchmark.evaluation import noised_truth

    records = align(truth, predictions)
    for seed in predictions["seed"].values:
        for name in predictions["noise"].values:
            stored = predictions["noised_truth"].sel(seed=seed, noise=name).values
            again = noised_truth(records, PROTOCOLS[name], int(seed))
            scale = np.maximum(np.abs(again), normalisation.std["stress"])
            difference = np.abs(stored - again) / scale
            same = np.isnan(stored) == np.isnan(again)
            if not same.all() or np.nanmax(difference, initial=0.0) > TRUTH_TOLERANCE:
                raise SubmissionError(
                    f"{path}: the predictions' ground truth for {name}, seed {seed}, is not what "
                    "the ground truth gives; run `granbench evaluate` again"
                )


def _check_embedded_truth(predictions: xr.Dataset, truth: xr.Dataset, path: Path) -> None:
    """Refuse analyses of the ground truth that the ground truth does not give.

    Machines differ in their times, but not by more than `RERUN.clock`.
    """
    if "embedded_truth_reaction" not in predictions:
        return
    from granbench.benchmark.axes.embedded.predict import embedded_truth

    again = embedded_truth(truth)
    for name in ("reaction", "volumetric_strain", "acceleration", "stress"):
        variable = f"embedded_truth_{name}"
        mine, theirs = again[variable], predictions[variable]
        same_gaps = (np.isnan(mine) == np.isnan(theirs)).all()
        over = [dim for dim in mine.dims if dim not in ("solver", "analysis")]
        size = np.sqrt((mine**2).mean(over))
        difference = np.sqrt(((mine - theirs) ** 2).mean(over))
        if not same_gaps or (difference > TRUTH_TOLERANCE * size).any():
            raise _another_truth(path, variable)
    for name in ("seconds", "cell_seconds"):
        variable = f"embedded_truth_{name}"
        ratio = predictions[variable] / again[variable]
        off = (ratio > RERUN.clock) | (ratio < 1.0 / RERUN.clock)
        if off.any() or (np.isnan(again[variable]) != np.isnan(predictions[variable])).any():
            raise _another_truth(path, variable)


def _another_truth(path: Path, variable: str) -> SubmissionError:
    return SubmissionError(
        f"{path}: the predictions' {variable} is not what the ground truth gives; run "
        "`granbench evaluate` again"
    )
