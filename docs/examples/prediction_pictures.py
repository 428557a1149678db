"""Compare submissions: prediction_pictures.py FOLDER SUBMISSION [SUBMISSION ...].

This writes two pictures to FOLDER: measured and predicted stress and void ratio along a typical
path of each loading family, and the error of every model against the number of steps since the
start. The typical path is the one with the median error of the first submission.
"""

import sys
from pathlib import Path

from granbench.benchmark.predictions import open_predictions
from granbench.data import load
from granbench.data.replicates import replicate_scatter
from granbench.leaderboard.submission import read_submission
from granbench.plotting import save_figure
from granbench.plotting.predictions import horizon_figure, prediction_figure, typical_paths


def main(folder: Path, files: list[Path]) -> None:
    """Draw both pictures."""
    submissions = {file: read_submission(file) for file in files}
    first = submissions[files[0]]
    records = load(f"{first.dataset.name}@{first.dataset.version}")
    predictions = {
        submission.name: open_predictions(file.parent / submission.predictions.file)
        for file, submission in submissions.items()
    }
    paths = typical_paths(records, predictions[first.name])
    figure = prediction_figure(records, predictions, paths)
    save_figure(figure, folder / "measured-against-predicted.png")
    curves = {submission.name: submission.curves for submission in submissions.values()}
    floor = replicate_scatter(records).floor_mse
    save_figure(horizon_figure(curves, floor=floor), folder / "error-against-horizon.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]), [Path(name) for name in sys.argv[2:]])
