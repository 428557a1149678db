"""Records as a table of seven inputs and four states for the recurrent networks.

Row n of the table holds the inputs of step n (I_G, the chi of Eq 2.2 up to step n - 1, and the
increment d_eps) and the state at step n (three stresses, void ratio).
"""

from collections.abc import Iterator

import torch
import xarray as xr
from torch import Tensor
from torch.utils.data import default_collate

from granbench.baselines.recurrent_network import INPUTS, STATES, WIDTH, Scaling
from granbench.baselines.training.batches import (
    Batch,
    BatchSource,
    ResidentBatches,
    StreamedBatches,
)
from granbench.data.adapters import WindowDataset, accumulated_strain, history_of
from granbench.errors import ModelError
from granbench.tensors import COMPONENT_ORDERS

RESIDENT_BYTES = 2**30
"""Largest size of a table that is kept in memory; larger data are read in parts."""

PATHS_PER_BLOCK = 64
"""Paths that are read together if not all are in memory."""


def check_records(records: xr.Dataset) -> None:
    """Refuse records without the variables that the networks need.

    Raises
    ------
    ModelError
        If they are not in principal components, or have no void ratio or grading index.
    """
    name = records.attrs.get("dataset", "the dataset")
    labels = tuple(str(label) for label in records["component"].values)
    if labels != COMPONENT_ORDERS["principal"]:
        raise ModelError(
            f"{name}: the recurrent baselines work on principal components "
            f"{', '.join(COMPONENT_ORDERS['principal'])}, but it has {', '.join(labels)}; "
            "use gru, or a dataset such as dem-triaxial"
        )
    for variable in ("void_ratio", "grading_index"):
        if variable not in records.variables:
            raise ModelError(
                f"{name}: variable {variable!r} is missing, but the recurrent baselines need "
                "it; use a dataset with it"
            )


def raw_table(
    strain: Tensor, stress: Tensor, void_ratio: Tensor, grading_index: Tensor, past: Tensor
) -> Tensor:
    """The table of some records or windows, in physical units.

    Parameters
    ----------
    strain, stress : (record, step, component), compression positive, Pa
    void_ratio : (record, step)
    grading_index : (record,)
    past : (record, component), accumulated strain at step 0

    Returns
    -------
    (record, step, `WIDTH`); the increment of row 0 is zero
    """
    increment = torch.cat([torch.zeros_like(strain[:, :1]), strain.diff(dim=1)], dim=1)
    travelled = past[:, None] + accumulated_strain(strain)
    before = torch.cat([past[:, None], travelled[:, :-1]], dim=1)
    index = grading_index[:, None, None].expand(-1, strain.shape[1], 1)
    return torch.cat([index, before, increment, stress, void_ratio[..., None]], dim=-1)


def tables(records: xr.Dataset) -> Iterator[Tensor]:
    """The raw tables of all paths, block by block, (path, step, `WIDTH`), float64."""
    for first in range(0, records.sizes["path"], PATHS_PER_BLOCK):
        block = history_of(records.isel(path=slice(first, first + PATHS_PER_BLOCK)))
        yield raw_table(
            block.strain,
            block.stress,
            block.internals["void_ratio"],
            block.conditions.require("grading_index"),
            block.conditions.past_strain(),
        )


def fit_scaling(scaling: Scaling, training: xr.Dataset, lag: int) -> None:
    """Set means and scales from the training paths, block by block.

    Parameters
    ----------
    scaling : is set in place
    training : the training split
    lag : steps over which the change of the state is measured for `Scaling.change_scale`
    """
    inputs, states, changes = _Moments(), _Moments(), _Moments()
    for table in tables(training):
        inputs.add(table[:, 1:, INPUTS])
        states.add(table[..., STATES])
        changes.add(table[:, lag:, STATES] - table[:, :-lag, STATES])
    scaling.set(
        mean=torch.cat([inputs.mean, states.mean]),
        scale=torch.cat([inputs.deviation, states.deviation]),
        change=changes.root_mean_square,
    )


class _Moments:
    """Mean and deviation of columns, added up in float64 over blocks."""

    def __init__(self) -> None:
        self._count = 0
        self._sum: Tensor = torch.zeros(())
        self._squares: Tensor = torch.zeros(())

    def add(self, values: Tensor) -> None:
        rows = values.reshape(-1, values.shape[-1])
        self._count += len(rows)
        self._sum = self._sum + rows.sum(dim=0)
        self._squares = self._squares + rows.square().sum(dim=0)

    @property
    def mean(self) -> Tensor:
        return self._sum / self._count

    @property
    def deviation(self) -> Tensor:
        return (self._squares / self._count - self.mean.square()).clamp(min=0.0).sqrt()

    @property
    def root_mean_square(self) -> Tensor:
        return (self._squares / self._count).sqrt()


def as_batch(table: Tensor) -> Batch:
    """Inputs, start and targets of standardised windows.

    Parameters
    ----------
    table : (window, length + 1, `WIDTH`)

    Returns
    -------
    inputs (window, length, 7); start (window, 5): I_G and the state at the window's start;
    targets (window, length, 4)
    """
    start = torch.cat([table[:, 0, :1], table[:, 0, STATES]], dim=-1)
    return table[:, 1:, INPUTS], start, table[:, 1:, STATES]


def window_source(
    records: xr.Dataset,
    scaling: Scaling,
    length: int,
    device: torch.device,
    *,
    resident_bytes: int | None = None,
) -> BatchSource:
    """All windows of `length` predicted steps of some paths, taken at every step.

    Parameters
    ----------
    records : one split
    scaling : already fitted
    length : predicted steps of a window
    device : of the batches
    resident_bytes : records with a larger table are read from their file in parts;
        `RESIDENT_BYTES` if None
    """
    paths, steps = records.sizes["path"], records.sizes["step"]
    starts = steps - length
    limit = RESIDENT_BYTES if resident_bytes is None else resident_bytes
    if paths * steps * WIDTH * torch.float32.itemsize > limit:
        scaling_here = scaling.on_cpu()
        return StreamedBatches(
            WindowDataset(records, length=length, dtype=torch.float64),
            lambda items: as_batch(scaling_here.standardise(_window_table(items))),
            device,
            items_per_record=starts,
            records_together=PATHS_PER_BLOCK,
        )
    rows = torch.cat([scaling.on_cpu().standardise(table) for table in tables(records)])
    rows = rows.reshape(paths * steps, WIDTH).to(device)
    offsets = torch.arange(length + 1, device=device)

    def gather(windows: Tensor) -> Batch:
        first = windows // starts * steps + windows % starts
        return as_batch(rows[first[:, None] + offsets])

    return ResidentBatches(gather, paths * starts, device)


def _window_table(items: list[dict[str, Tensor]]) -> Tensor:
    windows = default_collate(items)
    return raw_table(
        windows["strain"],
        windows["stress"],
        windows["void_ratio"],
        windows["grading_index"],
        windows["accumulated_strain"],
    )
