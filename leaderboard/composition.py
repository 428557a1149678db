"""From predictions and a scorecard to the two files of a submission."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import xarray as xr

from granbench.data.normalisation import Normalisation
from granbench.data.splits import split_hash
from granbench.errors import ConfigurationError
from granbench.leaderboard.submission import (
    DatasetReference,
    Environment,
    PredictionsReference,
    Submission,
    file_digest,
    write_submission,
)
from granbench.predictions import evaluated, open_predictions, write_predictions
from granbench.scoring import METRIC_VERSION, score


@dataclass(frozen=True)
class About:
    """What a submitter says of a model; see `Submission` for each."""

    name: str
    authors: tuple[str, ...]
    training_data: str
    licence: str
    command: str
    title: str | None = None
    code: str | None = None
    role: Literal["model", "floor", "ceiling"] = "model"
    parameters: int | None = None


def predictions_path(out: Path) -> Path:
    """Where the predictions of a submission file lie: beside it, ending in .nc.

    Raises
    ------
    ConfigurationError
        If the submission's name does not end in .json.
    """
    if out.suffix != ".json":
        raise ConfigurationError(f"--out {out} must end in .json")
    return out.with_suffix(".nc")


def compose(predictions: xr.Dataset, dataset: xr.Dataset, about: About, out: Path) -> Submission:
    """Write predictions, score them as they were written, and write the submission.

    Parameters
    ----------
    predictions : of every scored path of `dataset`
    dataset : the whole records of the task
    about : what the submitter says
    out : the submission's JSON file; the predictions get the same name ending in .nc

    Raises
    ------
    ConfigurationError
        If `out` does not end in .json.
    SubmissionError
        If the folder cannot be written to, or the predictions do not fit the dataset.
    """
    file = predictions_path(out)
    described = predictions.assign_attrs(
        model=about.name, command=about.command, metric_version=METRIC_VERSION
    )
    write_predictions(described, file)
    stored = open_predictions(file)
    card = score(stored, evaluated(dataset), Normalisation.from_training(dataset))
    name = str(dataset.attrs["dataset"])
    submission = Submission(
        metric_version=card.metric_version,
        name=about.name,
        title=about.title,
        role=about.role,
        authors=about.authors,
        code=about.code,
        task=name,
        dataset=DatasetReference(
            name=name,
            version=str(dataset.attrs["version"]),
            content_sha256=str(dataset.attrs["content_sha256"]),
            split_sha256=split_hash(dataset),
        ),
        seeds=tuple(int(seed) for seed in stored["seed"].values),
        parameters=about.parameters,
        training_data=about.training_data,
        licence=about.licence,
        environment=Environment.here(),
        command=about.command,
        predictions=PredictionsReference(
            file=file.name, sha256=file_digest(file), bytes=file.stat().st_size
        ),
        normalisation=card.normalisation,
        scores=card.scores,
        curves=card.curves,
    )
    write_submission(submission, out)
    return submission
