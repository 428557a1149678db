"""The predictions schema: what a model said about every path, under every protocol.

One netCDF file a model: `stress` (seed, protocol, path, step, component) and, where the model
has it, `void_ratio` (seed, protocol, path, step), with the record's path coordinates. Values are
stored with `KEEP_BITS` bits of mantissa; NaN means that the run broke down there. Scores are
computed from the stored values against the truth rounded alike, so that anybody reproduces them
from the file, and a perfect model scores exactly zero.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from granbench.errors import ConfigurationError, SubmissionError
from granbench.whole_file import whole_file

KEEP_BITS = 15
"""Stored mantissa bits: a relative rounding error of at most 2^-16 = 1.5e-5, about five digits.

Prediction and truth rounded so add some 1e-10 to a normalised squared error at values of one
training standard deviation, far below what single steps of a good network show, and a core
prediction stays below 4 MB.
"""

WINDOW_STEPS = 20
"""Predicted steps of a window (Sec 2.2.3)."""

SCORED_INTERNALS = ("void_ratio",)
"""Internal variables that are kept beside the stress; the others no metric asks for."""

PATH_COORDINATES = ("path_id", "specimen", "split", "loading_family")


@dataclass(frozen=True)
class ProtocolSpec:
    """How predictions of one protocol are made, and so which steps count.

    Parameters
    ----------
    name : label in the files
    axis : the benchmark axis that it belongs to
    title : for people
    restart : steps after which the true record is given again; None for never
    noise : amplitude xi of Eq 5.13
    """

    name: str
    axis: str
    title: str
    restart: int | None = None
    noise: float = 0.0

    @property
    def first_predicted_step(self) -> int:
        """Steps before this one are context and are never counted."""
        return 1

    def horizon(self, steps: int) -> np.ndarray:
        """Steps since truth was last given, (step,), int; 0 at the context step."""
        step = np.arange(steps)
        if self.restart is None:
            return step
        return np.where(step == 0, 0, (step - 1) % self.restart + 1)


PROTOCOLS: dict[str, ProtocolSpec] = {
    spec.name: spec
    for spec in (
        ProtocolSpec("single-step", "single-step", "Single step", restart=1),
        ProtocolSpec("window", "window", f"Windows of\u00a0{WINDOW_STEPS}", restart=WINDOW_STEPS),
        ProtocolSpec("rollout", "rollout", "Whole-path rollout"),
        ProtocolSpec("noise-0.2", "noise", "Rollout, noise ξ\u00a0=\u00a00.2", noise=0.2),
        ProtocolSpec("noise-0.5", "noise", "Rollout, noise ξ\u00a0=\u00a00.5", noise=0.5),
        ProtocolSpec("noise-1.0", "noise", "Rollout, noise ξ\u00a0=\u00a01", noise=1.0),
    )
}
AXES: tuple[str, ...] = tuple(dict.fromkeys(spec.axis for spec in PROTOCOLS.values()))


def protocols_of(axes: Iterable[str]) -> tuple[ProtocolSpec, ...]:
    """The protocols of some axes, in the order of `PROTOCOLS`.

    Raises
    ------
    ConfigurationError
        If an axis is unknown.
    """
    wanted = set(axes)
    if unknown := sorted(wanted - set(AXES)):
        raise ConfigurationError(f"unknown axis {unknown[0]!r}; use {', '.join(AXES)}")
    return tuple(spec for spec in PROTOCOLS.values() if spec.axis in wanted)


def quantise(values: np.ndarray) -> np.ndarray:
    """float32 values rounded to `KEEP_BITS` bits of mantissa, ties to even; NaN stays NaN.

    Applying it twice changes nothing. Magnitudes that float32 cannot hold become NaN: a model
    that reaches them has broken down.
    """
    with np.errstate(over="ignore"):
        single = np.ascontiguousarray(values, dtype=np.float32)
    drop = np.uint32(23 - KEEP_BITS)
    bits = single.view(np.uint32)
    half = (np.uint32(1) << (drop - np.uint32(1))) - np.uint32(1)
    rounded = bits + half + ((bits >> drop) & np.uint32(1))
    rounded &= ~((np.uint32(1) << drop) - np.uint32(1))
    result = rounded.view(np.float32)
    return np.where(np.isfinite(single) & np.isfinite(result), result, np.float32(np.nan))


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


def assemble(
    stress: np.ndarray,
    internals: Mapping[str, np.ndarray],
    *,
    dataset: xr.Dataset,
    seeds: Iterable[int],
    protocols: Iterable[str],
    attrs: Mapping[str, str],
) -> xr.Dataset:
    """Predictions in their layout, quantised.

    Parameters
    ----------
    stress : (seed, protocol, path, step, component), Pa, compression positive
    internals : each (seed, protocol, path, step) under its dataset name
    dataset : the records that were predicted, in the same order of paths
    seeds, protocols : labels of the first two dimensions
    attrs : model, command and the like
    """
    labels = list(protocols)
    series = ("seed", "protocol", "path", "step")
    variables: dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]] = {
        "stress": (
            (*series, "component"),
            quantise(stress),
            {"units": "Pa", "long_name": "predicted stress, compression positive"},
        )
    }
    for name, values in internals.items():
        units = dataset[name].attrs.get("units", "1")
        variables[name] = (
            series,
            quantise(values),
            {"units": units, "long_name": f"predicted {name.replace('_', ' ')}"},
        )
    coordinates = {
        "seed": ("seed", np.asarray(list(seeds), dtype=np.int64)),
        "protocol": ("protocol", np.asarray(labels, dtype=object)),
        "component": ("component", dataset["component"].values.astype(object)),
        "first_predicted_step": (
            "protocol",
            np.asarray([PROTOCOLS[label].first_predicted_step for label in labels], dtype=np.int64),
        ),
    }
    for name in PATH_COORDINATES:
        coordinates[name] = ("path", dataset[name].values.astype(object))
    described = {
        "dataset": str(dataset.attrs.get("dataset", "")),
        "dataset_version": str(dataset.attrs.get("version", "")),
        "dataset_content_sha256": str(dataset.attrs.get("content_sha256", "")),
        "keep_bits": KEEP_BITS,
        **attrs,
    }
    return xr.Dataset(variables, coordinates, described)


def write_predictions(predictions: xr.Dataset, path: Path) -> None:
    """Write a predictions file under a temporary name, then rename it.

    Raises
    ------
    SubmissionError
        If the folder cannot be written to.
    """
    encoding = {}
    for name, variable in predictions.data_vars.items():
        # One chunk a component keeps neighbours in time together, which compresses best.
        chunks = [1, 1, *variable.shape[2:4], *([1] if variable.ndim == 5 else [])]
        encoding[name] = {"zlib": True, "complevel": 6, "shuffle": True, "chunksizes": chunks}
    with whole_file(path, SubmissionError, RuntimeError, size=predictions.nbytes) as partial:
        predictions.to_netcdf(partial, engine="netcdf4", encoding=encoding)


def open_predictions(path: Path) -> xr.Dataset:
    """Read a predictions file whole and check its layout.

    Raises
    ------
    SubmissionError
        If it is missing, not netCDF or not in the layout.
    """
    if not path.is_file():
        raise SubmissionError(
            f"the predictions file {path} is missing; it belongs beside the submission"
        )
    try:
        with xr.open_dataset(path, engine="netcdf4", decode_timedelta=False) as handle:
            predictions = handle.load()
    except (OSError, ValueError, RuntimeError) as error:
        raise SubmissionError(
            f"{path} cannot be read as netCDF ({error}); run `granbench evaluate` again"
        ) from error
    _check_layout(predictions, path)
    return predictions


def _check_layout(predictions: xr.Dataset, path: Path) -> None:
    remedy = "run `granbench evaluate` again"
    dims = ("seed", "protocol", "path", "step", "component")
    for name in ("seed", "protocol", "component", *PATH_COORDINATES, "first_predicted_step"):
        if name not in predictions.coords:
            raise SubmissionError(f"{path} lacks the coordinate {name!r}; {remedy}")
    if "stress" not in predictions:
        raise SubmissionError(f"{path} lacks the variable 'stress'; {remedy}")
    for label, variable in predictions.data_vars.items():
        name = str(label)
        expected = dims if name == "stress" else dims[:-1]
        if variable.dims != expected:
            raise SubmissionError(
                f"{path}: {name!r} has dimensions {variable.dims}, expected {expected}; {remedy}"
            )
        if variable.dtype.kind != "f":
            raise SubmissionError(f"{path}: {name!r} does not hold numbers; {remedy}")
    for name in ("seed", "protocol", "path_id"):
        values, counts = np.unique(predictions[name].values, return_counts=True)
        if (counts > 1).any():
            raise SubmissionError(
                f"{path}: {name} {values[counts > 1][0]!s} appears more than once; {remedy}"
            )
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
                f"from step {PROTOCOLS[label].first_predicted_step}; {remedy}"
            )
