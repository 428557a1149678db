"""Score the board again under a new version of the metrics, from what lies there.

``python -m granbench.leaderboard.rescoring`` from the root of the checkout, whenever
`METRIC_VERSION` was raised. An axis that predictions say nothing of is `not_run` afterwards; a
model is run again on the axes that it was evaluated on.
"""

from collections.abc import Iterator
from pathlib import Path

import xarray as xr

from granbench.benchmark.every_axis import score
from granbench.benchmark.metrics import METRIC_VERSION
from granbench.benchmark.predictions import evaluated, open_predictions
from granbench.data.normalisation import Normalisation
from granbench.data.store import load
from granbench.fem.statement import embedded_analyses
from granbench.leaderboard.rerunning import rerun
from granbench.leaderboard.rows import accepted, default_folder
from granbench.leaderboard.sealing import sealed
from granbench.leaderboard.submission import Submission, write_submission

WITHOUT_ANALYSES = ("1.1",)
"""Versions whose scores are this version's on tasks that state no boundary-value problem: 1.2 only
added the embedded axis."""


def rescored(submission: Submission, file: Path, records: xr.Dataset) -> Submission:
    """A submission with the scores that this version makes from its predictions or its model.

    Parameters
    ----------
    submission : whatever version its scores follow
    file : its JSON file, the others beside it
    records : the whole dataset of its task
    """
    if submission.metric_version in WITHOUT_ANALYSES and not embedded_analyses(records):
        return submission.model_copy(update={"metric_version": METRIC_VERSION})
    if submission.predictions is None:
        predictions = rerun(submission, records, file)
    else:
        predictions = open_predictions(file.parent / submission.predictions.file)
    card = score(predictions, evaluated(records), Normalisation.from_training(records))
    return submission.model_copy(
        update={
            "metric_version": card.metric_version,
            "normalisation": card.normalisation,
            "scores": card.scores,
            "curves": card.curves,
        }
    )


def rescore(folder: Path) -> Iterator[Path]:
    """Rewrite every submission of a board that follows another version of the metrics.

    Returns
    -------
    The files that were written, one after the other
    """
    for row in accepted(folder):
        if row.submission.metric_version != METRIC_VERSION:
            dataset = row.submission.dataset
            with load(f"{dataset.name}@{dataset.version}") as records:
                found = rescored(row.submission, row.file, records)
            if found.acceptance is not None:
                found = sealed(found, row.file.parent, found.acceptance.word)
            write_submission(found, row.file)
            yield row.file


if __name__ == "__main__":
    for file in rescore(default_folder()):
        print(f"{file} follows metric version {METRIC_VERSION}")
