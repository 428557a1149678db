"""The learning curve of a run, as a table of epochs."""

import csv
from dataclasses import astuple, fields
from pathlib import Path

import numpy as np
import xarray as xr

from granbench.cells.baseline import EpochReport
from granbench.errors import ModelError
from granbench.files.whole_file import whole_file

HISTORY_FILE = "history.csv"
CURVE_FILE = "learning_curve.png"


def write_history(folder: Path, reports: list[EpochReport]) -> None:
    """Write `history.csv`, whole or not at all; numbers keep all their digits."""
    with (
        whole_file(folder / HISTORY_FILE, ModelError) as partial,
        partial.open("w", newline="") as file,
    ):
        table = csv.writer(file)
        table.writerow(field.name for field in fields(EpochReport))
        table.writerows(astuple(report) for report in reports)


def read_history(folder: Path, until_epoch: int | None = None) -> list[EpochReport]:
    """The reports of epochs 1 to `until_epoch`, or all; a killed session may have written more.

    Raises
    ------
    ModelError
        If the table is missing or damaged.
    """
    path = folder / HISTORY_FILE
    try:
        with path.open(newline="") as file:
            reports = [
                EpochReport(
                    int(row.pop("epoch")), **{name: float(text) for name, text in row.items()}
                )
                for row in csv.DictReader(file)
            ]
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise ModelError(
            f"{path}: the table of epochs cannot be read ({error}); remove the folder "
            f"{folder} and train again"
        ) from error
    kept = reports[:until_epoch]
    wanted = len(reports) if until_epoch is None else until_epoch
    if [report.epoch for report in kept] != list(range(1, wanted + 1)):
        raise ModelError(
            f"{path}: epochs are missing from the table; remove the folder {folder} and train again"
        )
    return kept


def learning_curve(reports: list[EpochReport]) -> xr.Dataset:
    """The history as a dataset over `epoch`: `training_loss` and `validation_loss`.

    Both are mean squared errors in units of the training split's variance.
    """
    losses = {
        name: (
            "epoch",
            np.asarray([getattr(report, name) for report in reports], dtype=np.float64),
            {"units": "1", "long_name": name.replace("_", " ")},
        )
        for name in ("training_loss", "validation_loss")
    }
    return xr.Dataset(losses, {"epoch": [report.epoch for report in reports]})
