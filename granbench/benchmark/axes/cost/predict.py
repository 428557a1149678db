"""The cost axis: CPU time of a Gauss-point update, of a model and of the ground truth."""

import time

import numpy as np
import torch
import xarray as xr
from torch import Tensor

from granbench.benchmark.axes.along_paths.free_run import strain_of
from granbench.benchmark.axes.cost.metrics import POINTS, TRUTH_UPDATE, UPDATE
from granbench.benchmark.axes.physics.checks import checked_paths
from granbench.cells.contract import FLOATING_FAILURES, MaterialCell
from granbench.cells.robust_runs import robust_states
from granbench.data.adapters import conditions_of

ROUNDS = 7
"""Timings of each cell, taken in turn; the fastest counts, for nothing makes a run too fast."""

SECONDS = 0.03
"""Least CPU time of one timing, s."""


def cost(cell: MaterialCell, dataset: xr.Dataset, truth: MaterialCell | None) -> xr.Dataset:
    """CPU seconds of one update of one point, without gradients.

    Points start from states along the checked paths, as the cell itself reaches them, and meet
    the increments that come next. Model and ground truth are timed in turn in one process.

    Parameters
    ----------
    cell : the model
    dataset : the scored records
    truth : their ground truth, if a model made them

    Returns
    -------
    Dataset over `points`: `update_seconds`, and `truth_update_seconds` where there is a truth;
    NaN where the cell breaks down while it is timed. Empty for a cell that reads records: to look
    an answer up is no update.
    """
    if cell.reads_records:
        return xr.Dataset()
    cells = {UPDATE: cell}
    if truth is not None:
        cells[TRUTH_UPDATE] = truth
    starts = {name: _starts(each, dataset) for name, each in cells.items()}
    seconds = {name: np.full(len(POINTS), np.inf) for name in cells}
    for size, points in enumerate(POINTS):
        batches = {name: _batch(*starts[name], points) for name in cells}
        for _ in range(ROUNDS):
            for name, each in cells.items():
                taken = _seconds(each, *batches[name]) / points
                seconds[name][size] = min(seconds[name][size], taken)
    return xr.Dataset(
        {
            name: (("points",), np.where(np.isfinite(values), values, np.nan))
            for name, values in seconds.items()
        },
        {"points": np.asarray(POINTS, dtype=np.int64)},
    )


def _starts(cell: MaterialCell, dataset: xr.Dataset) -> tuple[Tensor, Tensor]:
    """Increments and the states that they meet, (point, ...), where the cell does not break down.

    A cell that breaks down everywhere is timed from the starts of the paths.
    """
    records = dataset.isel(path=checked_paths(dataset))
    strain = strain_of(records)
    course = robust_states(cell, strain, conditions_of(records, dtype=cell.dtype))
    state = course["state"][:, :-1]
    finite = torch.isfinite(course["state"]).all(dim=-1)
    alive = finite[:, :-1] & finite[:, 1:]
    if not alive.any():
        alive[:, 0] = True
    return strain.diff(dim=1)[alive].to(cell.dtype), state[alive].to(cell.dtype)


def _batch(increments: Tensor, states: Tensor, points: int) -> tuple[Tensor, Tensor]:
    """Evenly spread points, repeated where needed, each component contiguous over the points."""
    chosen = torch.linspace(0, len(states) - 1, points).long()
    return increments[chosen].T.contiguous().T, states[chosen].T.contiguous().T


def _seconds(cell: MaterialCell, dstrain: Tensor, state: Tensor) -> float:
    """CPU time of one call of `step`, over as many as take `SECONDS`; infinite if it fails."""
    calls, begun = 0, time.process_time()
    while (elapsed := time.process_time() - begun) < SECONDS or not calls:
        try:
            cell.step(dstrain, state)
        except FLOATING_FAILURES:
            return float("inf")
        calls += 1
    return elapsed / calls
