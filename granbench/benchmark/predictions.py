"""The predictions schema: what a model said about every path, under every protocol.

One netCDF file a model: `stress` (seed, protocol, path, step, component) and, where the model
has it, `void_ratio` (seed, protocol, path, step), with the record's path coordinates; for a
dataset that a model made, `noised_truth`, that model along the noised strain; the curves and
Gauss-point stresses of the boundary-value problems of the embedded axis, with those of the ground
truth; and the responses to the checks of the physics axis and the timings of the cost axis, see
`LAYOUT`. Values are stored
with `KEEP_BITS` bits of mantissa; NaN means that the run broke down there. Scores are computed
from the stored values against the truth rounded alike, so that anybody reproduces them from the
file, and a perfect model scores exactly zero.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from granbench.benchmark.axes.physics.checks import STRESS_CHECKS
from granbench.benchmark.protocols import NOISE_PROTOCOLS, PROTOCOLS
from granbench.errors import ConfigurationError, SubmissionError
from granbench.fem.statement import SOLVERS
from granbench.files.bounded_reading import read_bounded
from granbench.files.json_reading import parse_json_object
from granbench.files.netcdf_reading import open_netcdf
from granbench.files.whole_file import whole_file
from granbench.records.rounding import keep_mantissa

KEEP_BITS = 15
"""Stored mantissa bits: a relative rounding error of at most 2^-16 = 1.5e-5, about five digits.

Prediction and truth rounded so add some 1e-10 to a normalised squared error at values of one
training standard deviation, far below what single steps of a good network show. A file of three
seeds on all axes has 3 MB on `dem-triaxial` and 13 to 21 MB on the core `gp-*` tasks, a third of
that the ground truth along the noised strain.
"""

SCORED_INTERNALS = ("void_ratio",)
"""Internal variables that are kept beside the stress; the others no metric asks for."""

PHYSICS_OBSTACLES = "physics_not_applicable"
"""Global attribute where the physics axis was run: JSON, why a check does not apply, by name."""

EMBEDDED_OBSTACLE = "embedded_not_applicable"
"""Global attribute where the embedded axis was run: why it does not apply, "" where it does."""

CELL_NOTES = "cell_notes"
"""Global attribute: JSON, what was put right of the model's cells; absent where nothing was."""

EMBEDDED_FAILURES = "embedded_failures"
"""Global attribute: JSON, why analyses ended early, by SEED/SOLVER/ANALYSIS."""

LARGEST_PREDICTIONS = 2**29
"""Bytes of values that a file may declare, which is read whole: 30 seeds of the largest task."""

PATH_COORDINATES = ("path_id", "specimen", "split", "loading_family")


@dataclass(frozen=True)
class Stored:
    """A variable of the file.

    Parameters
    ----------
    dims : names of its dimensions
    units : SI
    long_name : what it is
    exact : whether it is kept as it is, not rounded to `KEEP_BITS`
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    exact: bool = False


_CHECKED = ("seed", "checked_path")
_ANALYSES = ("solver", "analysis")
_CURVE = (*_ANALYSES, "output")
_POINTS = (*_CURVE, "gauss_point", "component")
LAYOUT: dict[str, Stored] = {
    "stress": Stored(
        ("seed", "protocol", "path", "step", "component"),
        "Pa",
        "predicted stress, compression positive",
    ),
    "void_ratio": Stored(("seed", "protocol", "path", "step"), "1", "predicted void ratio"),
    "noised_truth": Stored(
        ("seed", "noise", "path", "step", "component"),
        "Pa",
        "stress of the ground truth along the noised strain, compression positive",
    ),
    "stress_change": Stored(
        ("seed", "check", "checked_path", "component"), "Pa", "largest violation of a check"
    ),
    "tangent_error": Stored(_CHECKED, "1", "largest relative error of the tangent"),
    "kink_share": Stored(_CHECKED, "1", "share of the checked points without a derivative"),
    "cycle_work": Stored(_CHECKED, "Pa", "work that a closed strain cycle consumes, J/m3"),
    "tension_share": Stored(_CHECKED, "1", "share of steps with a tensile mean stress"),
    "embedded_reaction": Stored(("seed", *_CURVE), "N/m", "reaction of an analysis"),
    "embedded_volumetric_strain": Stored(("seed", *_CURVE), "1", "its global volumetric strain"),
    "embedded_acceleration": Stored(
        ("seed", *_CURVE), "m/s2", "its largest nodal acceleration since the last output"
    ),
    "embedded_stress": Stored(("seed", *_POINTS), "Pa", "its stress at some Gauss points"),
    "embedded_seconds": Stored(("seed", *_ANALYSES), "s", "CPU time of the whole analysis"),
    "embedded_cell_seconds": Stored(("seed", *_ANALYSES), "s", "CPU time in the model alone"),
    "embedded_truth_reaction": Stored(_CURVE, "N/m", "reaction with the ground truth"),
    "embedded_truth_volumetric_strain": Stored(
        _CURVE, "1", "global volumetric strain with the ground truth"
    ),
    "embedded_truth_acceleration": Stored(
        _CURVE, "m/s2", "largest nodal acceleration with the ground truth since the last output"
    ),
    "embedded_truth_stress": Stored(
        _POINTS, "Pa", "stress at some Gauss points with the ground truth"
    ),
    "embedded_truth_seconds": Stored(_ANALYSES, "s", "CPU time with the ground truth"),
    "embedded_truth_cell_seconds": Stored(_ANALYSES, "s", "CPU time in the ground truth alone"),
    "parameters": Stored(("seed",), "1", "trained or fitted parameters", exact=True),
    "training_seconds": Stored(("seed",), "s", "time of training; NaN: not known"),
    "update_seconds": Stored(("seed", "points"), "s", "CPU time of one update of one point"),
    "truth_update_seconds": Stored(
        ("seed", "points"), "s", "the same of the ground truth, in the same process"
    ),
}
"""Every variable that a predictions file may hold."""


def quantise(values: np.ndarray) -> np.ndarray:
    """float32 values rounded to `KEEP_BITS` bits of mantissa, ties to even; NaN stays NaN.

    Applying it twice changes nothing. Magnitudes that float32 cannot hold become NaN: a model
    that reaches them has broken down.
    """
    return keep_mantissa(values, KEEP_BITS)


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
    """Whether several seeds are one and the same model: all that no seed enters is the same.

    Only the draws of the noise differ then. Of one seed, and where nothing is compared with
    recorded paths but noise, nobody can tell: not so.
    """
    if "protocol" not in predictions.dims or predictions.sizes["seed"] < 2:
        return False
    drawn = np.isin(predictions["protocol"].values.astype(str), NOISE_PROTOCOLS)
    if drawn.all():
        return False
    first, *others = predictions["stress"].values[:, ~drawn]
    return all(np.array_equal(first, other, equal_nan=True) for other in others)


def assemble(
    predicted: Mapping[str, np.ndarray],
    *,
    dataset: xr.Dataset,
    seeds: Iterable[int],
    protocols: Iterable[str],
    attrs: Mapping[str, str | int],
    others: Iterable[xr.Dataset] = (),
) -> xr.Dataset:
    """Predictions in their layout, quantised.

    Parameters
    ----------
    predicted : `stress` (seed, protocol, path, step, component), Pa, compression positive, and
        internal variables (seed, protocol, path, step); empty where there is no protocol
    dataset : the records that were predicted, in the same order of paths
    seeds, protocols : labels of the first two dimensions
    attrs : model, command and the like
    others : further variables of `LAYOUT`, with their coordinates, for the same seeds
    """
    labels = list(protocols)
    coordinates = {
        "seed": ("seed", np.asarray(list(seeds), dtype=np.int64)),
        "component": ("component", dataset["component"].values.astype(object)),
        **{name: ("path", dataset[name].values.astype(object)) for name in PATH_COORDINATES},
    }
    if labels:
        first = [PROTOCOLS[label].first_predicted_step for label in labels]
        coordinates["protocol"] = ("protocol", np.asarray(labels, dtype=object))
        coordinates["first_predicted_step"] = ("protocol", np.asarray(first, dtype=np.int64))
    described = {
        "dataset": str(dataset.attrs.get("dataset", "")),
        "dataset_version": str(dataset.attrs.get("version", "")),
        "dataset_content_sha256": str(dataset.attrs.get("content_sha256", "")),
        "keep_bits": KEEP_BITS,
        **attrs,
    }
    predictions = xr.Dataset({}, coordinates, described)
    for name, values in predicted.items():
        predictions[name] = (LAYOUT[name].dims, values)
    for other in others:
        predictions = predictions.assign(other.data_vars).assign_attrs(other.attrs)
    for label, variable in predictions.data_vars.items():
        stored = LAYOUT[str(label)]
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
    """As `open_predictions`, in this process.

    Raises
    ------
    SubmissionError
        See `open_predictions`.
    """
    with open_netcdf(path, SubmissionError, _REMEDY, largest=LARGEST_PREDICTIONS) as predictions:
        _check_variables(predictions, path)  # before any value is read
        predictions.load()
        _check_labels(predictions, path)
    return predictions


_REMEDY = "run `granbench evaluate` again"
_LABELS = {"noise": NOISE_PROTOCOLS, "check": STRESS_CHECKS, "solver": SOLVERS}


def _check_variables(predictions: xr.Dataset, path: Path) -> None:
    """Names, dimensions, types and attributes; values are not read."""
    remedy = _REMEDY
    predicts = "protocol" in predictions.dims
    if predicts and "stress" not in predictions.data_vars:
        raise SubmissionError(f"{path} lacks the variable 'stress'; {remedy}")
    for label, variable in predictions.data_vars.items():
        name = str(label)
        if name not in LAYOUT:
            raise SubmissionError(f"{path}: no score is made from {name!r}; {remedy}")
        if variable.dims != LAYOUT[name].dims:
            raise SubmissionError(
                f"{path}: {name!r} has dimensions {variable.dims}, expected "
                f"{LAYOUT[name].dims}; {remedy}"
            )
        if variable.dtype.kind != "f":
            raise SubmissionError(f"{path}: {name!r} does not hold numbers; {remedy}")
    for label, coordinate in predictions.coords.items():
        if label in LAYOUT or coordinate.ndim != 1:
            raise SubmissionError(f"{path}: {str(label)!r} is not a coordinate; {remedy}")
    for name, value in predictions.attrs.items():
        if not isinstance(value, str) and np.ndim(value) > 0:
            raise SubmissionError(
                f"{path}: attribute {name!r} is neither text nor a number; {remedy}"
            )
    for name in (PHYSICS_OBSTACLES, EMBEDDED_FAILURES):
        if name in predictions.attrs:
            text = str(predictions.attrs[name])
            parse_json_object(text, f"{path}: attribute {name!r}", SubmissionError, remedy=remedy)
    required = {*_labelled(predictions), *PATH_COORDINATES}
    if predicts:
        required.add("first_predicted_step")
    for name in sorted(required):
        if name not in predictions.coords:
            raise SubmissionError(f"{path} lacks the coordinate {name!r}; {remedy}")
    for name in ("seed", "first_predicted_step"):
        if name in required and predictions[name].dtype.kind not in "iu":
            raise SubmissionError(f"{path}: {name!r} does not hold integers; {remedy}")
    for name in PATH_COORDINATES:
        if predictions[name].dims != ("path",) or predictions[name].dtype.kind not in "OSU":
            raise SubmissionError(f"{path}: {name!r} does not hold a label for each path; {remedy}")
    if predicts and predictions["first_predicted_step"].dims != ("protocol",):
        raise SubmissionError(f"{path}: 'first_predicted_step' is not one a protocol; {remedy}")
    if empty := [str(name) for name, length in predictions.sizes.items() if not length]:
        raise SubmissionError(f"{path}: dimension {empty[0]!r} has no entry; {remedy}")


def _labelled(predictions: xr.Dataset) -> set[str]:
    """Coordinates whose values are all different."""
    return {"seed", "path_id", *(str(dim) for dim in predictions.dims)} - {"path", "step"}


def _check_labels(predictions: xr.Dataset, path: Path) -> None:
    """The values of the coordinates."""
    remedy = _REMEDY
    for name in sorted(_labelled(predictions)):
        values, counts = np.unique(predictions[name].values.astype(str), return_counts=True)
        if (counts > 1).any():
            raise SubmissionError(
                f"{path}: {name} {values[counts > 1][0]!s} appears more than once; {remedy}"
            )
    seeds = predictions["seed"].values
    if (seeds < 0).any() or (seeds > np.iinfo(np.int64).max).any():
        raise SubmissionError(f"{path}: a seed is {seeds.min()}; seeds begin at 0; {remedy}")
    if "protocol" in predictions.dims:
        _check_protocols(predictions, path)
    for dim, known in _LABELS.items():
        if dim in predictions.dims and not set(predictions[dim].values) <= set(known):
            raise SubmissionError(
                f"{path}: {dim} may be {', '.join(known)}, not "
                f"{', '.join(map(str, predictions[dim].values))}; {remedy}"
            )


def _check_protocols(predictions: xr.Dataset, path: Path) -> None:
    for label, first in zip(
        predictions["protocol"].values,
        predictions["first_predicted_step"].values,
        strict=True,
    ):
        if label not in PROTOCOLS:
            raise SubmissionError(
                f"{path}: unknown protocol {label!r}; known are {', '.join(PROTOCOLS)}"
            )
        if first != PROTOCOLS[label].first_predicted_step:
            raise SubmissionError(
                f"{path}: protocol {label} counts from step {first}, but the benchmark counts "
                f"from step {PROTOCOLS[label].first_predicted_step}; run `granbench evaluate` "
                "again"
            )
