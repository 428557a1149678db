"""Write a submission: score predictions and store them, or the model, beside the scores."""

import os
import re
import shutil
import tempfile
from pathlib import Path

import xarray as xr

from granbench.benchmark.metric import METRIC_VERSION
from granbench.benchmark.predictions import (
    is_deterministic,
    open_predictions,
    write_predictions,
)
from granbench.benchmark.scoring import score
from granbench.benchmark.task import FIRST_VERSION, Task
from granbench.cells.find import FoundModel
from granbench.data.splits import split_hash
from granbench.errors import ConfigurationError, SubmissionError
from granbench.files.whole_file import cannot_write
from granbench.leaderboard.model_files import export
from granbench.leaderboard.submission import (
    About,
    DatasetReference,
    Environment,
    PredictionsReference,
    Submission,
    file_digest,
    write_submission,
)


def check_target(out: Path) -> Path:
    """Check before a long evaluation that a submission can be written to `out`.

    Returns
    -------
    Where its predictions go: beside it, the name ending in .nc

    Raises
    ------
    ConfigurationError
        If the name does not end in .json, or the folder cannot be written to.
    """
    if out.suffix != ".json":
        raise ConfigurationError(f"{out} must end in .json")
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", out.name):
        raise ConfigurationError(
            f"{out.name!r} may hold letters, digits, dots, dashes and underscores only"
        )
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out.parent):
            pass
    except OSError as error:
        raise ConfigurationError(cannot_write(out, error)) from error
    return out.with_suffix(".nc")


def compose(
    predictions: xr.Dataset,
    dataset: xr.Dataset,
    about: About,
    out: Path,
    *,
    task: Task | None = None,
    model: FoundModel | None = None,
) -> Submission:
    """Score predictions as they are stored, and write the submission with its predictions or model.

    Either all files are written, or none.

    Parameters
    ----------
    predictions : of every scored path of the task
    dataset : the whole dataset of the task, as it is in its file
    about : what the submitter says; a model whose every error is zero becomes the ceiling
    out : the submission's JSON file; the predictions get the same name ending in .nc
    task : what was evaluated; None for the records alone, which have no analyses
    model : kept in place of the predictions, in a folder of that name ending in .model

    Raises
    ------
    ConfigurationError
        See `check_target`.
    SubmissionError
        If the files cannot be written, the predictions do not fit the dataset, or the model has
        code of its own.
    """
    final = check_target(out)
    described = predictions.assign_attrs(
        model=about.name, command=about.command, metric_version=METRIC_VERSION
    )
    try:
        with tempfile.TemporaryDirectory(dir=out.parent, prefix=f".{out.stem}.") as folder:
            file, text = Path(folder) / final.name, Path(folder) / out.name
            write_predictions(described, file)
            submission = _scored(file, dataset, about, task or Task.of_records(dataset))
            if model is None:
                write_submission(submission, text)
                os.replace(file, final)
            else:
                name = f"{out.stem}.model"
                reference = export(model, Path(folder), name)
                submission = submission.model_copy(update={"predictions": None, "model": reference})
                write_submission(submission, text)
                shutil.rmtree(out.with_name(name), ignore_errors=True)
                if reference.files:
                    os.replace(Path(folder) / name, out.with_name(name))
            os.replace(text, out)
    except OSError as error:
        raise SubmissionError(cannot_write(out, error)) from error
    return submission


def _scored(file: Path, dataset: xr.Dataset, about: About, task: Task) -> Submission:
    stored = open_predictions(file)
    card = score(stored, task.scored(dataset), task.normalisation(dataset), task)
    # A model whose every error is zero has read the answers: it is shown as a bound, not ranked.
    role = "ceiling" if card.perfect else about.role
    return Submission(
        **about.model_dump() | {"role": role, "deterministic": is_deterministic(stored) or None},
        metric_version=card.metric_version,
        task=task.id,
        task_version=None if task.version == FIRST_VERSION else task.version,
        dataset=DatasetReference(
            name=str(dataset.attrs["dataset"]),
            version=str(dataset.attrs["version"]),
            content_sha256=str(dataset.attrs["content_sha256"]),
            split_sha256=split_hash(dataset),
        ),
        seeds=tuple(int(seed) for seed in stored["seed"].values),
        environment=Environment.here(),
        predictions=PredictionsReference(
            file=file.name, sha256=file_digest(file), bytes=file.stat().st_size
        ),
        normalisation=card.normalisation,
        scores=card.scores,
        curves=card.curves,
    )
