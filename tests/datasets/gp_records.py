"""The published `gp-*` records for tests: opened once, with the model that made them."""

import json
from functools import cache

import numpy as np
import torch
import xarray as xr

from granbench.cells.contract import Rollout
from granbench.data import load
from granbench.data.adapters import conditions_of
from granbench.generators.classical.design import DATASETS
from granbench.models.classical import ClassicalCell
from granbench.models.ground_truth import recording_cell
from granbench.tensors import deviatoric_stress, mean_stress

NAMES = tuple(DATASETS)
UNIT = 2.0**-17
"""Largest relative error of a recorded stress: it keeps 16 bits of mantissa."""


@cache
def shipped(name: str) -> xr.Dataset:
    """The whole dataset in memory; only to be read."""
    with load(name) as records:
        return records.load()


def some(name: str, every: int = 8) -> xr.Dataset:
    """Paths of every split, one in `every`."""
    return shipped(name).isel(path=slice(0, None, every))


def ground_truth(records: xr.Dataset) -> ClassicalCell:
    """The model that made the records, according to their attributes."""
    truth = json.loads(records.attrs["ground_truth"])
    return recording_cell(truth["model"], truth["parameters"])


def rollout(records: xr.Dataset) -> Rollout:
    """The response of the ground truth to the recorded strain from the recorded start."""
    strain = torch.from_numpy(records["strain"].values.astype(np.float64))
    with torch.no_grad():
        return ground_truth(records).rollout(strain, conditions_of(records))


def series(records: xr.Dataset, name: str) -> np.ndarray:
    """A recorded variable in double precision."""
    return records[name].values.astype(np.float64)


def full_stress(records: xr.Dataset) -> np.ndarray:
    """Stress with its out-of-plane component, (path, step, 6), Pa."""
    xx, yy, xy = np.moveaxis(series(records, "stress"), -1, 0)
    nothing = np.zeros_like(xx)
    zz = series(records, "out_of_plane_stress")
    return np.stack([xx, yy, zz, nothing, nothing, xy], axis=-1)


def invariants(records: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """p and q, (path, step), Pa: of the full tensor if the model is three-dimensional."""
    if "out_of_plane_stress" in records:
        stress = full_stress(records)
        return mean_stress(stress, "full"), deviatoric_stress(stress, "full")
    stress = series(records, "stress")
    return mean_stress(stress, "plane"), deviatoric_stress(stress, "plane")


def principal_stress(records: xr.Dataset) -> np.ndarray:
    """Principal stresses of a three-dimensional model, decreasing, (path, step, 3), Pa."""
    xx, yy, xy = np.moveaxis(series(records, "stress"), -1, 0)
    centre, radius = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    zz = series(records, "out_of_plane_stress")
    return np.sort(np.stack([centre + radius, centre - radius, zz], axis=-1), axis=-1)[..., ::-1]


def split_rows(records: xr.Dataset, *splits: str) -> np.ndarray:
    """Rows of the paths of some splits."""
    return np.flatnonzero(np.isin(records["split"].values.astype(str), splits))
