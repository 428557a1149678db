"""Single steps: what the model adds to an error when everything before is true."""

import numpy as np
import torch
import xarray as xr

from granbench.benchmark.axes.along_paths.free_run import strain_of
from granbench.cells.contract import MaterialCell
from granbench.cells.robust_runs import Series, robust_condition_each, robust_step
from granbench.data.adapters import history_of

BLOCK = 16384
"""Points evaluated at a time: enough to be fast, few enough to stay in the cache."""


def single_step(cell: MaterialCell, dataset: xr.Dataset) -> Series:
    """Stress at step n from the state that the true record up to n - 1 implies.

    The states come from `MaterialCell.condition_each`; the steps are independent then, and are
    batched over paths and steps together.

    Returns
    -------
    `stress` (path, step, component) and those internals, each (path, step), that the records
    have; step 0 is the given one
    """
    increments = torch.diff(strain_of(dataset), dim=1).to(cell.dtype)
    paths, steps, components = increments.shape
    states = robust_condition_each(cell, history_of(dataset, cell.dtype))[:, :-1].to(cell.dtype)
    flat_increments = increments.reshape(paths * steps, components)
    flat_states = states.reshape(paths * steps, -1)
    blocks = [
        robust_step(cell, flat_increments[i : i + BLOCK], flat_states[i : i + BLOCK])
        for i in range(0, paths * steps, BLOCK)
    ]
    series = {}
    for name in blocks[0]:
        if name in dataset:
            flat = torch.cat([block[name] for block in blocks])
            given = torch.from_numpy(dataset[name].values[:, :1].astype(np.float64))
            predicted = flat.reshape(paths, steps, *flat.shape[1:])
            series[name] = torch.cat([given, predicted], dim=1)
    return series
