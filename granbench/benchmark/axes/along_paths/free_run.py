"""Protocols in which the model feeds itself: whole paths, windows and noised increments."""

import zlib

import numpy as np
import torch
import xarray as xr
from torch import Tensor

from granbench.benchmark.axes.along_paths.protocols import WINDOW_STEPS
from granbench.cells.contract import MaterialCell
from granbench.cells.robust_runs import Series, robust_rollout
from granbench.data.adapters import conditions_of


def rollout(cell: MaterialCell, dataset: xr.Dataset) -> Series:
    """Whole paths from the state at step 0, the cell's own outputs fed back.

    Returns
    -------
    `stress` (path, step, component) and the cell's internals, each (path, step)
    """
    return robust_rollout(cell, strain_of(dataset), conditions_of(dataset, dtype=cell.dtype))


def window(cell: MaterialCell, dataset: xr.Dataset, length: int = WINDOW_STEPS) -> Series:
    """Windows of `length` predicted steps that follow each other without overlap.

    Each starts by `initial_state` from the true record at its first step, as the mLSTM of
    Fig 2.9 does from true stress and void ratio and the LSTM, which starts blank, cannot.

    Returns
    -------
    As `rollout`; step 0 is the given stress
    """
    strain = strain_of(dataset)
    windows: list[Series] = []
    for start in range(0, strain.shape[1] - 1, length):
        part = strain[:, start : start + length + 1]
        series = robust_rollout(cell, part - part[:, :1], conditions_of(dataset, start, cell.dtype))
        first = 0 if start == 0 else 1  # a window's step 0 is the last step of the one before
        windows.append({name: values[:, first:] for name, values in series.items()})
    return {name: torch.cat([part[name] for part in windows], dim=1) for name in windows[0]}


def noise(cell: MaterialCell, dataset: xr.Dataset, xi: float, seed: int) -> Series:
    """Rollout along noised increments d_eps (1 + xi R), R standard normal (Eq 5.13).

    R is drawn per step and component. A path's draws depend on `seed` and its name only, so
    every model meets the same noise, every xi the same R, and xi = 0 is `rollout`.
    """
    strain = strain_of(dataset)
    increments = torch.diff(strain, dim=1)
    normal = torch.from_numpy(_draws(dataset, tuple(increments.shape[1:]), seed))
    # The noise is added to the strain so that xi = 0 leaves it untouched to the last bit.
    noised = strain.clone()
    noised[:, 1:] += torch.cumsum(xi * normal * increments, dim=1)
    return robust_rollout(cell, noised, conditions_of(dataset, dtype=cell.dtype))


def strain_of(dataset: xr.Dataset) -> Tensor:
    """Cumulative strain (path, step, component), float64, compression positive."""
    return torch.from_numpy(dataset["strain"].values.astype(np.float64))


def _draws(dataset: xr.Dataset, shape: tuple[int, ...], seed: int) -> np.ndarray:
    names = dataset["path_id"].values.astype(str)
    return np.stack(
        [
            np.random.default_rng([seed, zlib.crc32(name.encode())]).standard_normal(shape)
            for name in names
        ]
    )
