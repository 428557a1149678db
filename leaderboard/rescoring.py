"""Score the board again under a new version of the metrics, from its predictions and models.

Run ``python -m granbench.leaderboard.rescoring`` from the root of the checkout after a change of
`METRIC_VERSION`. An axis that the predictions leave out becomes `not_run`; a model is run again on
the axes that it was evaluated on.
"""

from collections.abc import Iterator
from pathlib import Path

import xarray as xr

from granbench.benchmark.bootstrap import MINIMUM_SPECIMENS
from granbench.benchmark.metric import METRIC_VERSION
from granbench.benchmark.predictions import evaluated, open_predictions
from granbench.benchmark.registry import axes
from granbench.benchmark.scorecard import Curve, Score
from granbench.benchmark.scored_task import ScoredPredictions, ScoredTask
from granbench.benchmark.scoring import score
from granbench.benchmark.task import Task
from granbench.data.normalisation import Normalisation
from granbench.data.splits import split_names
from granbench.leaderboard.rerunning import rerun
from granbench.leaderboard.rows import accepted, default_folder
from granbench.leaderboard.sealing import sealed
from granbench.leaderboard.submission import Submission, write_submission
from granbench.leaderboard.submitted_task import records_of, task_of

SAME_VALUES = ("1.2",)
"""Versions whose values are those of this one: 1.3 only left out some intervals."""


def rescored(
    submission: Submission, file: Path, dataset: xr.Dataset, task: Task | None = None
) -> Submission:
    """A submission with the scores that this version makes from its predictions or its model.

    Parameters
    ----------
    submission : whatever version its scores follow
    file : its JSON file, the others beside it
    dataset : the whole dataset of its task
    task : the one that it names by default
    """
    task = task or task_of(submission, file, dataset)
    records = task.view(dataset)
    if submission.metric_version in SAME_VALUES:
        return without_unsupported_intervals(submission, records, task)
    if submission.predictions is None:
        predictions = rerun(submission, records, file, task=task)
    else:
        predictions = open_predictions(file.parent / submission.predictions.file)
    normalisation = Normalisation.from_training(records)
    card = score(predictions, evaluated(records), normalisation, task)
    return submission.model_copy(
        update={
            "metric_version": card.metric_version,
            "normalisation": card.normalisation,
            "scores": card.scores,
            "curves": card.curves,
        }
    )


def without_unsupported_intervals(
    submission: Submission, records: xr.Dataset, task: Task
) -> Submission:
    """The submission without the intervals that fewer than `MINIMUM_SPECIMENS` specimens give.

    This is what scoring again gives, because no other number of version 1.2 changed.

    Parameters
    ----------
    submission : with scores of a version in `SAME_VALUES`
    records : the whole dataset, see `granbench.benchmark.task.Task.view`
    task : of the submission
    """
    supported = _supported_intervals(records, task)

    def kept(item: Score) -> Score:
        if item.low is None or (item.protocol, item.split, item.group) in supported:
            return item
        return item.model_copy(update={"low": None, "high": None})

    def kept_of_curve(item: Curve) -> Curve:
        if not item.low or (item.protocol, item.split, item.group) in supported:
            return item
        return item.model_copy(update={"low": (), "high": ()})

    return submission.model_copy(
        update={
            "metric_version": METRIC_VERSION,
            "scores": tuple(map(kept, submission.scores)),
            "curves": tuple(map(kept_of_curve, submission.curves)),
        }
    )


def _supported_intervals(records: xr.Dataset, task: Task) -> set[tuple[str, str, str]]:
    """Protocol, split and group of scores of enough specimens for an interval."""
    tested = evaluated(records)
    normalisation = Normalisation.from_training(records)
    scored = ScoredPredictions(xr.Dataset(), ScoredTask.of(tested, task), normalisation)
    return {
        (part.name, split, group.name)
        for split in split_names(tested)
        for axis in axes()
        for part, group in axis.places(scored, split)
        if group.resampling is not None and group.resampling.specimens >= MINIMUM_SPECIMENS
    }


def rescore(folder: Path) -> Iterator[Path]:
    """Rewrite every submission of a board that follows another version of the metrics.

    Returns
    -------
    The files that were written, one after the other
    """
    for row in accepted(folder):
        if row.submission.metric_version != METRIC_VERSION:
            task = task_of(row.submission, row.file)
            with records_of(task, row.file) as records:
                found = rescored(row.submission, row.file, records, task)
            if found.acceptance is not None:
                found = sealed(found, row.file.parent, found.acceptance.word)
            write_submission(found, row.file)
            yield row.file


if __name__ == "__main__":
    for file in rescore(default_folder()):
        print(f"{file} follows metric version {METRIC_VERSION}")
