"""The predictions file: what a model said on every axis that it was evaluated on.

One netCDF file a model, with the record's path coordinates and the variables that the registered
axes declare (`Axis.layout`). Values are stored with `KEEP_BITS` bits of mantissa; NaN means that
the run broke down there. Scores are computed from the stored values against the truth rounded
alike, so that they can be reproduced from the file, and a perfect model scores exactly zero.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from granbench.benchmark.comparison import KEEP_BITS, quantise
from granbench.benchmark.predictions_check import (
    PATH_COORDINATES,
    REMEDY,
    check_labels,
    check_variables,
)
from granbench.benchmark.registry import axes, layout, of_every_axis
from granbench.errors import ConfigurationError, SubmissionError
from granbench.files.bounded_reading import prepare_server, read_bounded
from granbench.files.netcdf_reading import open_netcdf
from granbench.files.whole_file import whole_file

CELL_NOTES = "cell_notes"
"""Global attribute: JSON, what was put right of the model's cells; absent where nothing was."""

LARGEST_PREDICTIONS = 2**29
"""Bytes of values that a file may declare, which is read whole: 30 seeds of the largest task."""


def evaluated(dataset: xr.Dataset) -> xr.Dataset:
    """The paths of `dataset` that models are scored on: splits `test` and `ood-...`.

    Raises
    ------
    ConfigurationError
        If there are none.
    """
    split = dataset["split"].values.astype(str)
    chosen = np.flatnonzero((split == "test") | np.char.startswith(split, "ood-"))
    if not chosen.size:
        name = dataset.attrs.get("dataset", "the dataset")
        raise ConfigurationError(
            f"{name} has no path in a split 'test' or 'ood-...'; its splits are "
            f"{', '.join(sorted(set(split)))}"
        )
    return dataset.isel(path=chosen)


def is_deterministic(predictions: xr.Dataset) -> bool:
    """Whether several seeds are one and the same model: only what a seed draws differs.

    Where there is one seed alone, or no axis can tell (`Axis.answers`), it is not so.
    """
    if predictions.sizes["seed"] < 2:
        return False
    known = known_answers(predictions)
    return bool(known) and all(
        np.array_equal(answers[0], other, equal_nan=True)
        for answers in known
        for other in answers[1:]
    )


def known_answers(predictions: xr.Dataset) -> list[list[np.ndarray]]:
    """What each seed answered on every axis where that is known, see `Axis.answers`.

    Parameters
    ----------
    predictions : what an axis predicted, or a predictions file
    """
    found = of_every_axis(lambda axis: [axis.answers(predictions)])
    return [answers for answers in found if answers is not None]


def assembled_predictions(
    parts: Iterable[xr.Dataset],
    *,
    dataset: xr.Dataset,
    seeds: Iterable[int],
    attrs: Mapping[str, str | int],
) -> xr.Dataset:
    """Predictions in their layout, quantised.

    Parameters
    ----------
    parts : what each axis predicted (`Axis.predict`), for the same seeds
    dataset : the records that were predicted, in the same order of paths
    seeds : labels of the first dimension
    attrs : model, command and the like
    """
    coordinates = {
        "seed": ("seed", np.asarray(list(seeds), dtype=np.int64)),
        "component": ("component", dataset["component"].values.astype(object)),
        **{name: ("path", dataset[name].values.astype(object)) for name in PATH_COORDINATES},
    }
    described = {
        "dataset": str(dataset.attrs.get("dataset", "")),
        "dataset_version": str(dataset.attrs.get("version", "")),
        "dataset_content_sha256": str(dataset.attrs.get("content_sha256", "")),
        "keep_bits": KEEP_BITS,
        **attrs,
    }
    predictions = xr.Dataset({}, coordinates, described)
    for part in parts:
        predictions = predictions.assign(part.data_vars).assign_attrs(part.attrs)
    variables = layout()
    for label, variable in predictions.data_vars.items():
        if label not in variables:
            raise ConfigurationError(
                f"an axis predicts {label!r}, which no registered axis declares; add it to the "
                "layout of the axis"
            )
        stored = variables[str(label)]
        attributes = {"units": stored.units, "long_name": stored.long_name}
        values = variable.transpose(*stored.dims).values
        kept = values.astype(np.float64) if stored.exact else quantise(values)
        predictions[str(label)] = (stored.dims, kept, attributes)
    return predictions


def write_predictions(predictions: xr.Dataset, path: Path) -> None:
    """Write a predictions file under a temporary name, then rename it.

    Raises
    ------
    SubmissionError
        If the folder cannot be written to.
    """
    encoding: dict[str, dict[str, Any]] = {}
    for label, variable in predictions.data_vars.items():
        encoding[str(label)] = {"zlib": True, "complevel": 6, "shuffle": True}
        if "step" in variable.dims:
            # One chunk a component keeps neighbours in time together, which compresses best.
            together = ("path", "step")
            encoding[str(label)]["chunksizes"] = [
                size if dim in together else 1 for dim, size in variable.sizes.items()
            ]
    with whole_file(path, SubmissionError, RuntimeError, size=predictions.nbytes) as partial:
        predictions.to_netcdf(partial, engine="netcdf4", encoding=encoding)


def open_predictions(path: Path) -> xr.Dataset:
    """Read a predictions file whole and check its layout, in a child process with bounds.

    Raises
    ------
    SubmissionError
        If it is missing, not netCDF, larger than `LARGEST_PREDICTIONS`, not in the layout, or
        cannot be read within the bounds of `read_bounded`.
    """
    if not path.is_file():
        raise SubmissionError(
            f"the predictions file {path} is missing; it belongs beside the submission"
        )
    return read_bounded(path, SubmissionError, read_predictions_here, path)


def read_predictions_here(path: Path) -> xr.Dataset:
    """Read a predictions file in this process, otherwise as `open_predictions`.

    Raises
    ------
    SubmissionError
        See `open_predictions`.
    """
    with open_netcdf(path, SubmissionError, REMEDY, largest=LARGEST_PREDICTIONS) as predictions:
        check_variables(predictions, path)  # before any value is read
        predictions.load()
        check_labels(predictions, path)
    return predictions


# Axes are imported once in the process that reads files, not again for every file.
prepare_server(axes)
