"""`persistence`: stress and void ratio stay what they were. The floor of every task."""

from collections.abc import Sequence
from pathlib import Path

import xarray as xr
from torch import Tensor

from granbench.baseline import TrainingRequest
from granbench.cell import Conditions, MaterialCell, StateLayout
from granbench.errors import ModelError


class PersistenceCell(MaterialCell):
    """Stress and void ratio do not change, whatever the strain."""

    name = "persistence"
    layout = StateLayout.of(stress=3, void_ratio=1)
    internals = ("void_ratio",)

    def initial_state(self, conditions: Conditions) -> Tensor:
        """See `MaterialCell.initial_state`; the void ratio is needed."""
        void_ratio = conditions.require("initial_void_ratio")[:, None]
        return self.layout.pack(stress=conditions.stress, void_ratio=void_ratio).to(self.dtype)

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `MaterialCell.step`."""
        return state[:, self.layout["stress"]], state


class PersistenceBaseline:
    """See `granbench.baseline.Baseline`."""

    name = "persistence"
    title = "Persistence: nothing changes"
    presets: Sequence[str] = ()

    def train(self, request: TrainingRequest) -> Path:
        """There is nothing to train."""
        raise ModelError("persistence has nothing to train; use its name as the model")

    def load(self, folder: Path | None, records: xr.Dataset) -> MaterialCell:
        """See `granbench.baseline.Baseline.load`."""
        return PersistenceCell()


BASELINE = PersistenceBaseline()
