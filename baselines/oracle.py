"""`oracle`: a cell that is shown the answers. The ceiling of every task, it must score zero."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
import xarray as xr
from torch import Tensor

from granbench.cells.baseline import TrainingRequest
from granbench.cells.contract import Conditions, MaterialCell, StateLayout
from granbench.data.adapters import path_key
from granbench.errors import ModelError
from granbench.records.schema import INTERNALS
from granbench.tensors import COMPONENT_ORDERS, component_order


class OracleCell(MaterialCell):
    """Takes the next stress and internal variables from the records it is scored on.

    It knows path and step from two scalars of the conditions that no model needs, `path_key` and
    `step_index`; everything else follows the contract, so its error must be exactly zero in every
    protocol and metric.

    Parameters
    ----------
    records : the truth
    """

    name = "oracle"
    reads_records = True

    def __init__(self, records: xr.Dataset) -> None:
        self.order = component_order(records["component"].values)
        self.internals = tuple(name for name in INTERNALS if name in records)
        components = len(COMPONENT_ORDERS[self.order])
        widths = {"stress": components, **dict.fromkeys(self.internals, 1)}
        self.layout = StateLayout.of(**widths, path=1, step=1)
        truth = [records["stress"].values]
        truth += [records[name].values[..., None] for name in self.internals]
        self._truth = torch.from_numpy(np.concatenate(truth, axis=-1).astype(np.float64))
        self._row_of = {path_key(name): row for row, name in enumerate(records["path_id"].values)}

    def initial_state(self, conditions: Conditions) -> Tensor:
        """See `MaterialCell.initial_state`.

        Raises
        ------
        ModelError
            If a path is not among the records.
        """
        try:
            rows = [self._row_of[key] for key in conditions.require("path_key").tolist()]
        except KeyError as error:
            raise ModelError(
                "the oracle does not have one of these paths; load it with the whole dataset"
            ) from error
        row = torch.tensor(rows)
        step = conditions.require("step_index").long()
        return self._state(row, step)

    def _state(self, row: Tensor, step: Tensor) -> Tensor:
        place = torch.stack([row, step], dim=-1).to(self.dtype)
        return torch.cat([self._truth[row, step], place], dim=-1)

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `MaterialCell.step`."""
        row = state[:, self.layout["path"]].squeeze(-1).long()
        following = self._state(row, state[:, self.layout["step"]].squeeze(-1).long() + 1)
        return following[:, self.layout["stress"]], following


class OracleBaseline:
    """See `granbench.cells.baseline.Baseline`."""

    name = "oracle"
    title = "Oracle: the truth itself"
    presets: Sequence[str] = ()

    def train(self, request: TrainingRequest) -> Path:
        """There is nothing to train."""
        raise ModelError("oracle has nothing to train; use its name as the model")

    def load(self, folder: Path | None, records: xr.Dataset) -> MaterialCell:
        """See `granbench.cells.baseline.Baseline.load`."""
        return OracleCell(records)


BASELINE = OracleBaseline()
