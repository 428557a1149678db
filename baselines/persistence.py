"""`persistence`: stress and void ratio stay constant; a reference line of every task."""

from collections.abc import Sequence
from pathlib import Path

import xarray as xr
from torch import Tensor

from granbench.cells.baseline import TrainingRequest
from granbench.cells.contract import Conditions, MaterialCell, StateLayout
from granbench.errors import ModelError
from granbench.tensors import COMPONENT_ORDERS, component_order


class PersistenceCell(MaterialCell):
    """Stress and void ratio do not change with the strain.

    Parameters
    ----------
    order : component order
    has_void_ratio : whether the records have a void ratio that is to be predicted
    """

    name = "persistence"

    def __init__(self, order: str = "principal", *, has_void_ratio: bool = True) -> None:
        self.order = order
        self.internals = ("void_ratio",) if has_void_ratio else ()
        components = len(COMPONENT_ORDERS[order])
        self.layout = StateLayout.of(stress=components, **dict.fromkeys(self.internals, 1))

    def initial_state(self, conditions: Conditions) -> Tensor:
        """See `MaterialCell.initial_state`; a void ratio that is predicted is needed."""
        known = {name: conditions.require(f"initial_{name}")[:, None] for name in self.internals}
        return self.layout.pack(stress=conditions.stress, **known).to(self.dtype)

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `MaterialCell.step`."""
        return state[:, self.layout["stress"]], state


class PersistenceBaseline:
    """See `granbench.cells.baseline.Baseline`."""

    name = "persistence"
    title = "Persistence: nothing changes"
    presets: Sequence[str] = ()

    def train(self, request: TrainingRequest) -> Path:
        """There is nothing to train."""
        raise ModelError("persistence has nothing to train; use its name as the model")

    def load(self, folder: Path | None, records: xr.Dataset) -> MaterialCell:
        """See `granbench.cells.baseline.Baseline.load`."""
        order = component_order(records["component"].values)
        return PersistenceCell(order, has_void_ratio="void_ratio" in records)


BASELINE = PersistenceBaseline()
