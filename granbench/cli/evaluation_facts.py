"""Facts about a model that `granbench evaluate` writes into its submission."""

import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from granbench.benchmark.task import Task
    from granbench.cells.find import FoundModel
    from granbench.leaderboard.submission import Submission

PREDICTIONS, MODEL = KEPT = ("predictions", "model")
"""Kinds of evidence that can be kept with the scores."""

OWN_AUTHORS = "The GranBench authors"
OWN_LICENCE = "BSD-3-Clause"


def authors_of(authors: str | None, candidate: "FoundModel") -> tuple[str, ...]:
    """The names in a comma-separated list; by default the authors of the model, if known."""
    named = tuple(author.strip() for author in (authors or "").split(",") if author.strip())
    return named or (OWN_AUTHORS if candidate.baseline else "anonymous",)


def licence_of(licence: str | None, candidate: "FoundModel") -> str:
    """The given licence; by default that of GranBench's own models."""
    return licence or (OWN_LICENCE if candidate.baseline else "not stated")


def training_data_of(stated: str | None, candidate: "FoundModel", task: "Task") -> str:
    """The given training data, else those in the model's files, else those of the task."""
    if stated or candidate.training_data:
        return stated or str(candidate.training_data)
    if not candidate.trained:
        dataset, splits = task.dataset, ", ".join(task.splits.training)
        return f"{dataset.name} {dataset.version}, split {splits} at most"
    return "not stated"


def shown_command(
    model: str,
    task: str,
    *,
    axes: Sequence[str] | None,
    folders: Sequence[Path] | None,
    seeds: Iterable[int],
    name: str | None,
    keep: str,
    out: Path,
) -> str:
    """The command for publication, with only the last names of files and folders."""
    model_name = model if ":" in model else Path(model).name
    words = ["granbench", "evaluate", model_name, "--task", Path(task).name]
    for axis in axes or ():
        words += ["--axis", axis]
    for folder in folders or ():
        words += ["--model-dir", folder.resolve().name]
    words += ["--seeds", ",".join(map(str, seeds))]
    if name:
        words += ["--name", name]
    if keep != PREDICTIONS:
        words += ["--keep", keep]
    words += ["--out", out.name]
    return shlex.join(words)


def what_was_written(submission: "Submission", out: Path) -> str:
    """A sentence that names the files of a submission."""
    if submission.predictions is not None:
        megabytes = submission.predictions.bytes / 1e6
        return f"{out} and {submission.predictions.file} ({megabytes:.1f} MB) are written"
    if submission.model is not None and submission.model.files:
        folder = submission.model.files[0].path.split("/")[0]
        return f"{out} and the model in {folder} are written"
    return f"{out} is written; its model needs no file"
