"""Measured against predicted: errors of tests, and curves for figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from torch import Tensor

from granbench.fitting.least_squares import LOST
from granbench.fitting.rollouts import Prediction
from granbench.fitting.test_batch import TestBatch
from granbench.tensors import mean_stress, volumetric_strain

CURVES = {
    "axial_strain": ("1", "axial strain"),
    "deviatoric_stress": ("Pa", "deviatoric stress, axial minus lateral"),
    "mean_stress": ("Pa", "mean stress"),
    "volumetric_strain": ("1", "volumetric strain, compression positive"),
    "axial_stress": ("Pa", "axial stress"),
}

COLUMNS = (
    "axial_strain",
    *(
        f"{kind}_{name}"
        for kind in ("predicted", "measured")
        for name in ("deviatoric_stress", "mean_stress", "volumetric_strain")
    ),
    "predicted_axial_strain",
    "predicted_axial_stress",
    "measured_axial_stress",
)
"""Variables in the order of files: new ones are added at the end."""


@dataclass(frozen=True)
class TestError:
    """Error of a model in a test.

    Parameters
    ----------
    name : of the test
    role : `fitted` or `left out`
    control : `strain` or `mixed`
    points : compared points
    total : root of the mean square of the quantities' errors
    by_quantity : root-mean-square error over the range of the quantity in this test, by name
        for those that the fit weighs
    lost : points that the model does not reach; each counts with an error of `LOST` ranges
    """

    name: str
    role: str
    control: str
    points: int
    total: float
    by_quantity: Mapping[str, float]
    lost: int

    __test__ = False  # pytest would take it for tests of its own


def errors_of(role: str, batch: TestBatch, prediction: Prediction) -> list[TestError]:
    """The errors of the tests of a batch with one parameter vector, without weights."""
    error = (prediction.quantities(batch)[0] - batch.observed) / batch.scale[:, None]
    lost = ~error.isfinite()
    squares = np.where(lost, LOST, error.nan_to_num().numpy()) ** 2
    counts = (batch.weight > 0.0).any(dim=2).numpy()
    found = []
    for test, name in enumerate(batch.names):
        of_test = squares[test, counts[test]]
        measured = (batch.weight[test] > 0.0).any(dim=0).numpy()
        by_quantity = {
            quantity: float(of_test[:, place].mean() ** 0.5)
            for place, quantity in enumerate(batch.quantities)
            if measured[place]
        }
        missed = int(lost[test, counts[test]].any(dim=1).sum())
        total = float(np.mean([value**2 for value in by_quantity.values()]) ** 0.5)
        points = int(counts[test].sum())
        found.append(TestError(name, role, batch.kind, points, total, by_quantity, missed))
    return found


def curves_of(predicted: Sequence[tuple[str, TestBatch, Prediction]]) -> xr.Dataset:
    """Measured and predicted curves of tests in the principal order.

    Parameters
    ----------
    predicted : role, tests and the prediction of one parameter vector

    Returns
    -------
    Dataset over `test` and `step`, NaN after the end of a test and where nothing was measured or
    predicted, with the measured `axial_strain`, with `predicted_axial_strain`, which differs from
    it where the axial stress is prescribed, and `measured_NAME`, `predicted_NAME` for the other
    names in `CURVES`; coordinates `test` and `role`
    """
    rows: list[dict[str, np.ndarray]] = []
    names, roles = [], []
    for role, batch, prediction in predicted:
        for test, name in enumerate(batch.names):
            rows.append(_curves(batch, prediction, test))
            names.append(name)
            roles.append(role)
    longest = max(len(row["axial_strain"]) for row in rows)
    variables = {}
    for key in COLUMNS:
        values = np.full((len(rows), longest), np.nan)
        for place, row in enumerate(rows):
            values[place, : len(row[key])] = row[key]
        units, long_name = CURVES[key.removeprefix("measured_").removeprefix("predicted_")]
        variables[key] = (("test", "step"), values, {"units": units, "long_name": long_name})
    return xr.Dataset(variables, {"test": names, "role": ("test", roles)})


def _curves(batch: TestBatch, prediction: Prediction, test: int) -> dict[str, np.ndarray]:
    real = (batch.weight[test] > 0.0).any(dim=1)
    real[0] = True
    if batch.kind == "oedometer":
        return _oedometer_curves(batch, prediction, test, real)
    steps = int(real.nonzero().max()) + 1
    strain = prediction.strain[0, test, :steps].numpy()
    stress = prediction.stress[0, test, :steps].numpy()
    known = batch.observed[test, :steps].numpy()
    weight = (batch.weight[test] > 0.0).any(dim=0).numpy()
    driven = batch.control.driven[test, :steps]
    found = {
        "axial_strain": driven[:, 0],
        "predicted_axial_strain": strain[:, 0],
        "predicted_axial_stress": stress[:, 0],
        "predicted_deviatoric_stress": stress[:, 0] - stress[:, 2],
        "predicted_mean_stress": mean_stress(stress),
        "predicted_volumetric_strain": volumetric_strain(strain),
    }
    if batch.kind == "mixed":
        difference, volume = known.T
        lateral = batch.control.targets[test, :steps, 1]
        found["measured_axial_stress"] = lateral + difference
        found["measured_deviatoric_stress"] = difference
        found["measured_mean_stress"] = lateral + difference / 3.0
        found["measured_volumetric_strain"] = volume if weight[1] else np.full(steps, np.nan)
    else:
        found["measured_axial_stress"] = known[:, 0]
        found["measured_deviatoric_stress"] = known[:, 0] - known[:, 2]
        found["measured_mean_stress"] = mean_stress(known)
        found["measured_volumetric_strain"] = volumetric_strain(driven)
    return found


def _oedometer_curves(
    batch: TestBatch, prediction: Prediction, test: int, real: Tensor
) -> dict[str, np.ndarray]:
    """Curves of a test driven by its axial stress, at its measured points only."""
    rows = real.nonzero().flatten()
    strain = prediction.strain[0, test, rows].numpy()
    stress = prediction.stress[0, test, rows].numpy()
    measured = batch.observed[test, rows, 0].numpy()
    unknown = np.full(len(rows), np.nan)
    return {
        "axial_strain": measured,
        "predicted_axial_strain": strain[:, 0],
        "predicted_axial_stress": stress[:, 0],
        "predicted_deviatoric_stress": stress[:, 0] - stress[:, 2],
        "predicted_mean_stress": mean_stress(stress),
        "predicted_volumetric_strain": volumetric_strain(strain),
        "measured_axial_stress": batch.control.targets[test, rows.numpy(), 0],
        "measured_deviatoric_stress": unknown,
        "measured_mean_stress": unknown,
        "measured_volumetric_strain": measured,
    }
