"""Records as torch tensors: whole paths, and windows of them for a `DataLoader`."""

import hashlib
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
import xarray as xr
from torch import Tensor
from torch.utils.data import Dataset

from granbench.cells.contract import Conditions, History
from granbench.data.normalisation import Normalisation
from granbench.errors import ConfigurationError
from granbench.records.schema import INTERNALS
from granbench.tensors import component_order, mean_stress

__all__ = [
    "INTERNALS",
    "Normalisation",
    "SequenceDataset",
    "WindowDataset",
    "accumulated_strain",
    "conditions_of",
    "history_of",
    "history_of_batch",
    "path_key",
]

SPECIMEN_SCALARS = (
    "grading_index",
    "d_min",
    "d_max",
    "d50",
    "coefficient_of_uniformity",
    "coefficient_of_curvature",
    "preparation_friction",
)
"""Scalars of a specimen that a model may use. The loading programme (b, family) is not among them:
a model sees it as strain only."""

BYTES_IN_MEMORY = 256_000_000
"""Size of the paths that a window dataset keeps in memory; it reads the others again."""


def accumulated_strain(strain: Tensor) -> Tensor:
    """chi of Eq 2.2: absolute strain increments added up from step 0.

    Parameters
    ----------
    strain : (..., step, component), cumulative

    Returns
    -------
    (..., step, component), zero at step 0, never decreasing
    """
    increments = strain.diff(dim=-2).abs()
    return torch.cat([torch.zeros_like(strain[..., :1, :]), increments.cumsum(dim=-2)], dim=-2)


def _tensor(variable: xr.DataArray, dtype: torch.dtype) -> Tensor:
    # A copy: cached values must not be shared with the tensor of a caller.
    return torch.tensor(np.asarray(variable.values, dtype=np.float64), dtype=dtype)


def _specimen_scalars(ds: xr.Dataset, dtype: torch.dtype) -> dict[str, Tensor]:
    return {name: _tensor(ds[name], dtype) for name in SPECIMEN_SCALARS if name in ds.coords}


def _initial_scalars(
    stress: Tensor, internals: Mapping[str, Tensor], order: str
) -> dict[str, Tensor]:
    scalars = {"initial_mean_stress": mean_stress(stress, order), **internals}
    if "void_ratio" in internals:
        scalars["initial_void_ratio"] = internals["void_ratio"]
    return scalars


def path_key(path_id: str) -> float:
    """A number that identifies a path: 48 bits of SHA-256 of its id, exact as float64.

    It stays the same in every selection of a dataset's paths, unlike a position.
    """
    return float(int.from_bytes(hashlib.sha256(str(path_id).encode()).digest()[:6], "big"))


def _place(ds: xr.Dataset, start: int) -> dict[str, Tensor]:
    """Record and step, float64: for the oracle; a model has no use for them."""
    keys = torch.tensor([path_key(name) for name in ds["path_id"].values], dtype=torch.float64)
    return {"path_key": keys, "step_index": torch.full_like(keys, float(start))}


def conditions_of(ds: xr.Dataset, start: int = 0, dtype: torch.dtype = torch.float64) -> Conditions:
    """The conditions of every path at its step `start`.

    Parameters
    ----------
    ds : records; every path becomes one point
    start : step at which the prediction begins, from 0 to the last but one

    Returns
    -------
    Conditions with the recorded stress (path, component); the scalars `initial_mean_stress`
    (of the recorded components), `initial_void_ratio` and every internal variable of the
    records *at that step*, the specimen's (`SPECIMEN_SCALARS`), and for the oracle `path_key`
    and `step_index`; and the accumulated strain up to it

    Raises
    ------
    ConfigurationError
        If no step follows `start`.
    """
    if not 0 <= start < ds.sizes["step"] - 1:
        raise ConfigurationError(
            f"start step {start} is outside 0 ... {ds.sizes['step'] - 2} of the records"
        )
    stress = _tensor(ds["stress"].isel(step=start), dtype)
    internals = {name: _tensor(ds[name].isel(step=start), dtype) for name in _internals(ds)}
    past = accumulated_strain(_tensor(ds["strain"].isel(step=slice(0, start + 1)), dtype))[:, -1]
    scalars = _initial_scalars(stress, internals, component_order(_labels(ds)))
    if "initial_void_ratio" in ds.coords and start == 0:
        scalars.setdefault("initial_void_ratio", _tensor(ds["initial_void_ratio"], dtype))
    return Conditions(stress, scalars | _specimen_scalars(ds, dtype) | _place(ds, start), past)


def _labels(ds: xr.Dataset) -> tuple[str, ...]:
    return tuple(str(label) for label in ds["component"].values)


def _internals(ds: xr.Dataset) -> list[str]:
    return [name for name in INTERNALS if name in ds]


def history_of(ds: xr.Dataset, dtype: torch.dtype = torch.float64) -> History:
    """The whole true record of every path, with its conditions at step 0."""
    internals = {name: _tensor(ds[name], dtype) for name in _internals(ds)}
    return History(
        strain=_tensor(ds["strain"], dtype),
        stress=_tensor(ds["stress"], dtype),
        internals=internals,
        conditions=conditions_of(ds, dtype=dtype),
    )


class WindowDataset(Dataset):
    """Windows of `length` strain increments, taken every `stride` steps of every path.

    An item holds ``length + 1`` recorded states: the known start and those to predict. It is
    a dictionary of tensors that a `DataLoader` can batch:

    - `strain`, `stress` (length + 1, component); strain is counted from the start of the path
    - `void_ratio` and the other internal variables (length + 1,) that the dataset has
    - `accumulated_strain` (component,), chi at the window's start
    - the specimen's scalars (), see `SPECIMEN_SCALARS`

    `history_of_batch` turns a batch into the `History` that a material cell understands.
    Paths are read when they are needed, and the latest are kept up to `BYTES_IN_MEMORY`, so a
    dataset may be larger than the memory: sample such a dataset path by path, since a random order
    over all windows reads a path for almost every window.

    Parameters
    ----------
    ds : records, opened lazily or in memory
    length : predicted steps of a window (20 in Sec 2.2.3)
    stride : steps from one window's start to the next
    dtype : floating type of the tensors

    Raises
    ------
    ConfigurationError
        If a path is shorter than a window.
    """

    def __init__(
        self,
        ds: xr.Dataset,
        length: int = 20,
        stride: int = 1,
        dtype: torch.dtype = torch.float32,
    ) -> None:
        if length < 1 or stride < 1:
            raise ConfigurationError(
                f"window length {length} and stride {stride} must both be at least 1"
            )
        if length > ds.sizes["step"] - 1:
            raise ConfigurationError(
                f"a window of {length} steps does not fit a path of {ds.sizes['step'] - 1}; "
                "use a shorter one"
            )
        self.order = component_order(_labels(ds))
        self.length = length
        self.starts = np.arange(0, ds.sizes["step"] - length, stride)
        self.path_count = ds.sizes["path"]
        self._ds = ds
        self._dtype = dtype
        self._series = ("strain", "stress", *_internals(ds))
        self._scalars = _specimen_scalars(ds, dtype)
        self._paths: OrderedDict[int, dict[str, Tensor]] = OrderedDict()
        self._bytes = 0

    def __len__(self) -> int:
        return self.path_count * len(self.starts)

    def __getitem__(self, index: int) -> dict[str, Tensor]:
        if not -len(self) <= index < len(self):
            raise IndexError(f"window {index} of {len(self)}")
        path, window = divmod(index % len(self), len(self.starts))
        start = int(self.starts[window])
        record = self._path(path)
        item = {name: record[name][start : start + self.length + 1] for name in self._series}
        item["accumulated_strain"] = record["accumulated_strain"][start]
        return item | {name: scalars[path] for name, scalars in self._scalars.items()}

    def _path(self, path: int) -> dict[str, Tensor]:
        if path in self._paths:
            self._paths.move_to_end(path)
            return self._paths[path]
        row = self._ds.isel(path=path)
        record = {name: _tensor(row[name], self._dtype) for name in self._series}
        record["accumulated_strain"] = accumulated_strain(record["strain"])
        self._paths[path] = record
        self._bytes += _bytes(record)
        while self._bytes > BYTES_IN_MEMORY and len(self._paths) > 1:
            _, oldest = self._paths.popitem(last=False)
            self._bytes -= _bytes(oldest)
        return record

    def batch(self, indices: Sequence[int]) -> dict[str, Tensor]:
        """Several items stacked, as a `DataLoader` would give them."""
        items = [self[index] for index in indices]
        return {name: torch.stack([item[name] for item in items]) for name in items[0]}


def _bytes(record: Mapping[str, Tensor]) -> int:
    return sum(series.nbytes for series in record.values())


class SequenceDataset(WindowDataset):
    """Whole paths as items, in the form of `WindowDataset`."""

    def __init__(self, ds: xr.Dataset, dtype: torch.dtype = torch.float32) -> None:
        super().__init__(ds, length=ds.sizes["step"] - 1, dtype=dtype)


def history_of_batch(batch: Mapping[str, Any], order: str = "principal") -> History:
    """A batch of windows as the record from which a material cell starts and by which it is driven.

    Parameters
    ----------
    batch : of a `DataLoader` over a `WindowDataset`: the first dimension of every tensor is the
        window
    order : component order, `WindowDataset.order`

    Returns
    -------
    History over (window, step, component), whose conditions are those at the windows' starts
    """
    stress = batch["stress"]
    internals = {name: batch[name] for name in INTERNALS if name in batch}
    at_start = {name: series[:, 0] for name, series in internals.items()}
    scalars = _initial_scalars(stress[:, 0], at_start, order)
    scalars |= {name: batch[name] for name in SPECIMEN_SCALARS if name in batch}
    conditions = Conditions(stress[:, 0], scalars, batch["accumulated_strain"])
    return History(batch["strain"], stress, internals, conditions)
