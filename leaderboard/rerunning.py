"""Run a submitted model again."""

from collections.abc import Callable
from pathlib import Path

import xarray as xr

from granbench.benchmark.predictions import evaluated
from granbench.benchmark.registry import axis_names
from granbench.benchmark.task import Task
from granbench.errors import SubmissionError
from granbench.leaderboard.model_files import restored
from granbench.leaderboard.rerun_budget import SECONDS_PER_SEED, check_budget, time_limit
from granbench.leaderboard.submission import Submission

Progress = Callable[[int, str], None]
"""Called with the seed and what was done."""


def rerun(
    submission: Submission,
    records: xr.Dataset,
    path: Path,
    progress: Progress | None = None,
    *,
    task: Task | None = None,
) -> xr.Dataset:
    """Predictions of a submission's model for the axes that it was evaluated on.

    Parameters
    ----------
    submission : with a model
    records : the whole dataset of its task, see `granbench.benchmark.task.Task.view`
    path : the submission's JSON file, the model beside it
    progress : called after each part
    task : gives the axes and the embedded analyses; None for the records alone

    Raises
    ------
    SubmissionError
        If there is no model, it cannot be loaded, it is not what the submission says of it, or it
        exceeds the budget of a rerun.
    """
    from granbench.benchmark.evaluation import predict

    if submission.model is None:
        raise SubmissionError(f"{path}: has no model to run again")
    check_budget(submission.seeds, submission.model, path)
    with (
        time_limit(SECONDS_PER_SEED * len(submission.seeds), path),
        restored(submission.model, path, submission.seeds, records) as candidate,
    ):
        if submission.parameters != candidate.parameters:
            raise SubmissionError(
                f"{path}: parameters is {submission.parameters}, but the model has "
                f"{candidate.parameters}"
            )
        return predict(
            candidate.cells,
            evaluated(records).load(),
            run_axes(submission, task),
            task=task,
            training_seconds=candidate.training_seconds,
            progress=progress,
        )


def run_axes(submission: Submission, task: Task | None = None) -> tuple[str, ...]:
    """The axes that a submission was evaluated on.

    Parameters
    ----------
    submission : with scores
    task : its task, for the axes that there are; None for all of the benchmark
    """
    left_out = {score.axis for score in submission.scores if score.status == "not_run"}
    return tuple(axis for axis in (task.axes if task else axis_names()) if axis not in left_out)
