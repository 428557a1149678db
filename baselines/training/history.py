"""The learning curve of a run, as a table of epochs."""

import csv
import os
from dataclasses import astuple, fields
from pathlib import Path

import numpy as np
import xarray as xr

from granbench.baseline import EpochReport
from granbench.errors import ModelError

HISTORY_FILE = "history.csv"


def write_history(folder: Path, reports: list[EpochReport]) -> None:
    """Write `history.csv`, whole or not at all; numbers keep all their digits."""
    partial = folder / f".{HISTORY_FILE}.part"
    with partial.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(field.name for field in fields(EpochReport))
        table.writerows(astuple(report) for report in reports)
    os.replace(partial, folder / HISTORY_FILE)


def read_history(folder: Path, *, until_epoch: int) -> list[EpochReport]:
    """The reports of epochs 1 to `until_epoch`; later rows belong to a session that was killed.

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
    if [report.epoch for report in reports[:until_epoch]] != list(range(1, until_epoch + 1)):
        raise ModelError(
            f"{path}: epochs are missing from the table; remove the folder {folder} and train again"
        )
    return reports[:until_epoch]


def learning_curve(reports: list[EpochReport]) -> xr.Dataset:
    """The history as a dataset over `epoch`: `training_loss`, `validation_loss`, `learning_rate`.

    Losses are mean squared errors in units of the training split's variance.
    """
    names = {
        "training_loss": "training loss",
        "validation_loss": "validation loss",
        "learning_rate": "learning rate",
    }
    return xr.Dataset(
        {
            name: (
                "epoch",
                np.asarray([getattr(report, name) for report in reports], dtype=np.float64),
                {"units": "1", "long_name": title},
            )
            for name, title in names.items()
        },
        {"epoch": np.asarray([report.epoch for report in reports], dtype=np.int64)},
    )
