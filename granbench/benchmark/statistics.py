"""Statistics: what is known of each predicted path, before anything is averaged over paths."""

import numpy as np
import xarray as xr

from granbench.benchmark.predictions import quantise
from granbench.benchmark.protocols import PROTOCOLS
from granbench.data.normalisation import Normalisation
from granbench.errors import SubmissionError

CEILING = 10.0
"""Largest error that counts: ten training standard deviations, or ten times the true stress.

A broken-down run has no error to average, and one finite outlier of 1e30 would drown all the
others; both count as the ceiling, in every mean, median and worst case, and the share of
broken-down paths is reported beside them.
"""

ERROR_POINT = 0.5
"""Relative stress error above which a step is an error point (Sec 5.3)."""

Columns = dict[str, tuple[tuple[str, ...], np.ndarray]]


def align(truth: xr.Dataset, predictions: xr.Dataset) -> xr.Dataset:
    """The records in the order of the predictions' paths.

    Raises
    ------
    SubmissionError
        If paths are missing, foreign, or of another length or component order.
    """
    position = {str(name): index for index, name in enumerate(truth["path_id"].values)}
    predicted = [str(name) for name in predictions["path_id"].values]
    if foreign := [name for name in predicted if name not in position]:
        raise SubmissionError(
            f"the predictions hold path {foreign[0]!r}, which is not among the scored paths of "
            f"{truth.attrs.get('dataset', 'the dataset')}; predict its test and ood splits only"
        )
    if missing := sorted(set(position) - set(predicted)):
        raise SubmissionError(
            f"the predictions lack {len(missing)} of the {len(position)} scored paths, the first "
            f"is {missing[0]!r}; predict every path of the test and ood splits"
        )
    ordered = truth.isel(path=[position[name] for name in predicted])
    if predictions.sizes.get("step", truth.sizes["step"]) != truth.sizes["step"]:
        raise SubmissionError(
            f"the predictions have {predictions.sizes['step']} steps a path, the records have "
            f"{truth.sizes['step']}; predict every step"
        )
    if list(predictions["component"].values) != list(truth["component"].values):
        raise SubmissionError(
            f"the predictions' components are {list(predictions['component'].values)}, the "
            f"records' are {list(truth['component'].values)}; use the records' order"
        )
    return ordered


def path_statistics(
    predictions: xr.Dataset, truth: xr.Dataset, normalisation: Normalisation
) -> xr.Dataset:
    """Statistics of every path.

    Parameters
    ----------
    predictions : see `granbench.benchmark.predictions`
    truth : the scored records, in any order
    normalisation : training standard deviations

    Returns
    -------
    Dataset over (seed, protocol, path), with `specimen`, `split` and `loading_family`:

    - `component_squared_error` (.., component): mean over the predicted steps of the squared
      normalised stress error, each clipped at `CEILING` squared; `stress_squared_error` is its
      mean over components;
    - `void_ratio_squared_error`, likewise, if it is predicted; `output_squared_error`: mean over
      stress components and void ratio (the loss of Sec 2.2);
    - `relative_error`: mean of |stress error| / |true stress| (Frobenius norms), clipped;
    - `error_point_share`: share of steps with relative error above `ERROR_POINT` or broken down;
    - `divergence_step`: first step from which every later one is an error point; inf if none;
      `diverged`: 1 where there is one;
    - `failed`: 1 where the run broke down (NaN) at some predicted step;
    - `step_squared_error` (.., step): squared normalised stress error, mean over components.

    and, over (seed, noise, path), `recomputed_squared_error`, `recomputed_relative_error` and
    `recomputed_error_point_share`: the same as `stress_squared_error`, `relative_error` and
    `error_point_share`, but against the ground truth along the noised strain, over the steps that
    it can follow. What the predictions lack is left out.

    Raises
    ------
    SubmissionError
        If the predictions do not fit the records.
    """
    truth = align(truth, predictions)
    columns: Columns = {}
    if "stress" in predictions:
        columns |= _against_records(predictions, truth, normalisation)
    if "noised_truth" in predictions:
        columns |= _against_noised_truth(predictions, normalisation)
    labelled = ("seed", "protocol", "noise", "component")
    paths = {
        name: ("path", truth[name].values.astype(object))
        for name in ("path_id", "specimen", "split", "loading_family")
    }
    coordinates = {dim: predictions[dim].values for dim in labelled if dim in predictions.coords}
    steps = {"step": np.arange(1, truth.sizes["step"])} if "stress" in predictions else {}
    return xr.Dataset(columns, coordinates | steps | paths)


def _against_records(
    predictions: xr.Dataset, truth: xr.Dataset, normalisation: Normalisation
) -> Columns:
    predicted, true = _counted(predictions["stress"]), _counted(truth["stress"])
    broken = np.logical_not(np.isfinite(predicted).all(axis=-1, keepdims=True))

    component_error = _squared(predicted, true, normalisation.std["stress"], broken)
    step_error = component_error.mean(axis=-1)
    broken = broken[..., 0]
    relative = relative_error(predicted, true, list(truth["component"].values.astype(str)), broken)
    error_point = relative > ERROR_POINT
    divergence_step = _divergence_step(error_point)

    dims = ("seed", "protocol", "path")
    by_component = component_error.mean(axis=-2)
    columns: Columns = {
        "component_squared_error": ((*dims, "component"), by_component),
        "stress_squared_error": (dims, by_component.mean(axis=-1)),
        "step_squared_error": ((*dims, "step"), step_error),
        "relative_error": (dims, relative.mean(axis=-1)),
        "error_point_share": (dims, error_point.mean(axis=-1)),
        "divergence_step": (dims, divergence_step),
        "diverged": (dims, np.isfinite(divergence_step).astype(np.float64)),
    }
    if "void_ratio" in predictions:
        void_ratio = _counted(predictions["void_ratio"], ())
        true_void_ratio = _counted(truth["void_ratio"], ())
        void_broken = ~np.isfinite(void_ratio)
        error = _squared(
            void_ratio, true_void_ratio, normalisation.std["void_ratio"], void_broken
        ).mean(axis=-1)
        outputs = by_component.shape[-1]
        joint = (np.sum(by_component, axis=-1) + error) / (outputs + 1)
        columns["void_ratio_squared_error"] = (dims, np.asarray(error))
        columns["output_squared_error"] = (dims, np.asarray(joint))
        broken = broken | void_broken
    columns["failed"] = (dims, np.asarray(broken.any(axis=-1), dtype=np.float64))
    return columns


def _against_noised_truth(predictions: xr.Dataset, normalisation: Normalisation) -> Columns:
    noised = predictions["noised_truth"]
    if "stress" not in predictions or not set(noised["noise"].values) <= set(
        predictions["protocol"].values
    ):
        raise SubmissionError(
            "the predictions hold a truth for noise that they do not hold a prediction for; run "
            "`granbench evaluate` again"
        )
    predicted = _counted(predictions["stress"].sel(protocol=noised["noise"].values))
    true = _counted(noised)
    # Where the ground truth itself breaks down there is nothing to compare with.
    known = np.isfinite(true).all(axis=-1)
    weight = known / np.maximum(known.sum(axis=-1, keepdims=True), 1)
    true = np.where(known[..., None], true, 0.0)
    broken = np.logical_not(np.isfinite(predicted).all(axis=-1, keepdims=True))
    error = _squared(predicted, true, normalisation.std["stress"], broken).mean(axis=-1)
    labels = list(predictions["component"].values.astype(str))
    relative = relative_error(predicted, true, labels, broken[..., 0])
    dims = ("seed", "noise", "path")
    return {
        "recomputed_squared_error": (dims, (weight * error).sum(axis=-1)),
        "recomputed_relative_error": (dims, (weight * relative).sum(axis=-1)),
        "recomputed_error_point_share": (dims, (weight * (relative > ERROR_POINT)).sum(axis=-1)),
    }


def _counted(variable: xr.DataArray, last: tuple[str, ...] = ("component",)) -> np.ndarray:
    """Quantised values (..., step, *last) from every protocol's first predicted step on.

    That step is 1 for each of them, which is checked when a file is opened.
    """
    axis = -1 - len(last)
    values = np.moveaxis(quantise(variable.values), axis, 0)[1:]
    return np.moveaxis(values, 0, axis).astype(np.float64)


def horizon_means(step_error: np.ndarray, protocol: str) -> tuple[np.ndarray, np.ndarray]:
    """Errors averaged over the steps that lie equally far from given truth.

    Parameters
    ----------
    step_error : (..., step) from the first predicted step on
    protocol : label of the protocol

    Returns
    -------
    (horizon (k,), means (..., k))
    """
    horizon = PROTOCOLS[protocol].horizon(step_error.shape[-1] + 1)[1:]
    present = np.unique(horizon)
    means = [step_error[..., horizon == value].mean(axis=-1) for value in present]
    return present, np.stack(means, axis=-1)


def _squared(
    predicted: np.ndarray, true: np.ndarray, scale: np.ndarray, broken: np.ndarray
) -> np.ndarray:
    error = np.where(broken, CEILING, np.abs(predicted - true) / scale)
    return np.minimum(error, CEILING) ** 2


def relative_error(
    predicted: np.ndarray, true: np.ndarray, components: list[str], broken: np.ndarray
) -> np.ndarray:
    """Norm of the stress error over that of the true stress (...,), at most `CEILING`.

    Parameters
    ----------
    predicted, true : (..., component), Pa
    components : their labels
    broken : (...,), where there is no prediction; it counts as `CEILING`
    """
    # A shear component stands twice in the tensor: "12" and "21".
    weight = np.array([1.0 if label[0] == label[1] else 2.0 for label in components])
    error = np.sqrt((weight * (predicted - true) ** 2).sum(axis=-1))
    norm = np.sqrt((weight * true**2).sum(axis=-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(error == 0.0, 0.0, error / norm)
    return np.minimum(np.where(broken, CEILING, ratio), CEILING)


def _divergence_step(error_point: np.ndarray) -> np.ndarray:
    steps = error_point.shape[-1]
    lost = np.cumprod(error_point[..., ::-1], axis=-1).sum(axis=-1)
    return np.where(lost > 0, steps - lost + 1.0, np.inf)
