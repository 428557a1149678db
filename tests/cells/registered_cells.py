"""Every registered model and baseline as a cell, with a record that it can follow."""

from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import torch
import xarray as xr
from synthetic_records import synthetic_records

from granbench.cells.baseline import BASELINES, TrainingRequest
from granbench.cells.check.probe import default_start, probe_increments
from granbench.cells.contract import History, MaterialCell
from granbench.data.adapters import history_of
from granbench.models import MODELS

ORDERS = {2: ("plane",), 3: ("principal", "plane", "full")}
"""Component orders of a model by the dimension of its space."""

MODEL_CASES = [
    f"{name} {order}" for name, model in MODELS.items() for order in ORDERS[model.dimension]
]
BASELINE_CASES = list(BASELINES)
CASES = [*MODEL_CASES, *BASELINE_CASES]


@cache
def _records() -> xr.Dataset:
    """Short, but longer than the windows that networks are trained on."""
    return synthetic_records(n_specimens=6, steps=22)


@cache
def cell_of(case: str) -> MaterialCell:
    """The cell of a case; a baseline that needs training is trained as briefly as it allows."""
    if case in MODEL_CASES:
        name, order = case.split()
        return MODELS[name](order=order)
    baseline, records = BASELINES[case], _records()
    if not baseline.presets:
        return baseline.load(None, records)
    out = Path(mkdtemp()) / case
    request = TrainingRequest(records=records, out=out, epochs=1, seconds=0.1)
    return baseline.load(baseline.train(request), records)


@torch.no_grad()
def record_of(case: str, cell: MaterialCell) -> History:
    """Some paths of records for a baseline; for a model, its own along slightly less strain.

    A model is taken into plastic flow, and its record differs from its own prediction along the
    same strain, so that conditioning has something to correct.
    """
    if case in BASELINE_CASES:
        return history_of(_records().isel(path=slice(0, 4), step=slice(0, 8)), cell.dtype)
    increments = 30.0 * probe_increments(cell.order, 4)
    strain = torch.nn.functional.pad(increments.cumsum(dim=1), (0, 0, 1, 0))
    start = default_start(cell)
    true = cell.rollout(0.9 * strain, start)
    return History(strain, true.stress, true.internals, start)


def rounding(cell: MaterialCell) -> float:
    """Relative difference that rounding in batches of other sizes makes along a few steps."""
    return 1e-9 if cell.dtype == torch.float64 else 1e-4
