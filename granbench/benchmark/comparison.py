"""Comparing predicted with true stress: alignment of paths, errors, and what counts as lost."""

import numpy as np
import xarray as xr

from granbench.errors import SubmissionError
from granbench.records.rounding import keep_mantissa
from granbench.tensors import is_normal

KEEP_BITS = 15
"""Stored mantissa bits: a relative rounding error of at most 2^-16 = 1.5e-5, about five digits.

Prediction and truth rounded so add some 1e-10 to a normalised squared error at values of one
training standard deviation, far below what single steps of a good network show. A file of three
seeds on all axes has 3 MB on `dem-triaxial` and 13 to 21 MB on the core `gp-*` tasks, a third of
that the ground truth along the noised strain.
"""

CEILING = 10.0
"""Largest error that counts: ten training standard deviations, or ten times the true stress.

A broken-down run has no error to average, and one finite outlier of 1e30 would drown all the
others; both count as the ceiling, in every mean, median and worst case, and the share of
broken-down paths is reported beside them.
"""

ERROR_POINT = 0.5
"""Relative stress error above which a step is an error point (Sec 5.3)."""


def quantise(values: np.ndarray) -> np.ndarray:
    """float32 values rounded to `KEEP_BITS` bits of mantissa, ties to even; NaN stays NaN.

    Applying it twice changes nothing. Magnitudes that float32 cannot hold become NaN: a model
    that reaches them has broken down.
    """
    return keep_mantissa(values, KEEP_BITS)


def align(truth: xr.Dataset, predictions: xr.Dataset) -> xr.Dataset:
    """The records in the order of the predictions' paths.

    Raises
    ------
    SubmissionError
        If paths are missing, are none of the task, or have another length or component order.
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


def predicted_steps(variable: xr.DataArray, last: tuple[str, ...] = ("component",)) -> np.ndarray:
    """Quantised values (..., step, *last) from the first predicted step on, which is step 1.

    Parameters
    ----------
    variable : with the dimension `step`, before the dimensions `last`
    last : its last dimensions
    """
    axis = -1 - len(last)
    values = np.moveaxis(quantise(variable.values), axis, 0)[1:]
    return np.moveaxis(values, 0, axis).astype(np.float64)


def squared_error(
    predicted: np.ndarray, true: np.ndarray, scale: np.ndarray, broken: np.ndarray
) -> np.ndarray:
    """Squared normalised error, each at most `CEILING` squared.

    Parameters
    ----------
    predicted, true : (...), in the unit of `scale`
    scale : training standard deviation
    broken : (...), where there is no prediction; it counts as `CEILING`
    """
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
    # A shear component stands twice in the tensor.
    weight = np.array([1.0 if is_normal(label) else 2.0 for label in components])
    error = np.sqrt((weight * (predicted - true) ** 2).sum(axis=-1))
    norm = np.sqrt((weight * true**2).sum(axis=-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(error == 0.0, 0.0, error / norm)
    return np.minimum(np.where(broken, CEILING, ratio), CEILING)


def clipped(error: np.ndarray) -> np.ndarray:
    """Errors of at most `CEILING`, which what is missing (NaN) counts as."""
    return np.minimum(np.nan_to_num(error, nan=CEILING, posinf=CEILING), CEILING)
