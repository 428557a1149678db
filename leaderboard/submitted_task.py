"""The task that a submission names, and its records.

Only registered tasks and the records that the caller gives are used: the name in a submission is
never read as a path.
"""

from pathlib import Path

import xarray as xr

from granbench.benchmark.task import FIRST_VERSION, Task
from granbench.benchmark.task_registry import registered_task, task_records
from granbench.data.splits import split_hash
from granbench.errors import GranbenchError, RegistryError, SubmissionError
from granbench.leaderboard.submission import Submission


def task_of(submission: Submission, path: Path, dataset: xr.Dataset | None = None) -> Task:
    """The registered task that a submission names, or the task of the given records alone.

    Parameters
    ----------
    submission : with the name of its task
    path : its JSON file, for messages
    dataset : the whole records that it is checked against; where they are not those of the
        registered task, they are the task

    Raises
    ------
    SubmissionError
        If there is no such task, or the records are not fit to be one.
    """
    try:
        task = registered_task(submission.task, submission.task_version or FIRST_VERSION)
        if dataset is None or task.dataset.content_sha256 == dataset.attrs.get("content_sha256"):
            return task
    except RegistryError as error:
        if dataset is None:
            raise SubmissionError(f"{path}: task: {error}") from error
    try:
        return Task.of_records(dataset)
    except GranbenchError as error:
        raise SubmissionError(f"{path}: {error}") from error


def records_of(task: Task, path: Path) -> xr.Dataset:
    """The whole dataset of a task.

    Raises
    ------
    SubmissionError
        If the task names records that are not registered.
    """
    try:
        return task_records(task)
    except RegistryError as error:
        raise SubmissionError(f"{path}: {error}") from error


def require_same_task(submission: Submission, task: Task, dataset: xr.Dataset, path: Path) -> None:
    """Refuse a submission that is about another task or other records.

    Raises
    ------
    SubmissionError
        Naming the field that differs.
    """
    claimed = {"task": submission.task, "task_version": submission.task_version or FIRST_VERSION}
    for field, value in {"task": task.id, "task_version": task.version}.items():
        if claimed[field] != value:
            raise SubmissionError(
                f"{path}: {field} is {claimed[field]!r}, but it is checked against the task "
                f"{task.id} {task.version}; they must agree"
            )
    actual = {
        "name": str(dataset.attrs.get("dataset")),
        "version": str(dataset.attrs.get("version")),
        "content_sha256": str(dataset.attrs.get("content_sha256")),
        "split_sha256": split_hash(dataset),
    }
    for field, value in actual.items():
        if (stated := getattr(submission.dataset, field)) != value:
            raise SubmissionError(
                f"{path}: dataset.{field} is {stated}, but the records have {value}; evaluate on "
                "the dataset of the task"
            )
