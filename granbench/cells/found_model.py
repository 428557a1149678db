"""A model that was found by its name: its cells, and what is known about them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from granbench.cells.baseline import Baseline
from granbench.cells.contract import MaterialCell


@dataclass(frozen=True)
class FoundModel:
    """A model by its name.

    Parameters
    ----------
    name : what the leaderboard calls it unless another name is given
    cells : its material cell for each seed
    baseline : the registered baseline that it is, if it is one
    training_data : what it was trained on, as far as its files say
    training_seconds : how long each seed was trained, as far as its files say
    folders : where the trained model of each seed lies
    make : makes its cell in any component order, as of a classical model; None for a model that
        has its own
    dimension : of space in which a model with `make` is defined, 2 or 3
    """

    name: str
    cells: Mapping[int, MaterialCell]
    baseline: Baseline | None = None
    training_data: str | None = None
    training_seconds: Mapping[int, float] = field(default_factory=dict)
    folders: Mapping[int, Path] = field(default_factory=dict)
    make: Callable[[str], MaterialCell] | None = None
    dimension: int | None = None

    @property
    def order_is_open(self) -> bool:
        """Whether the caller may still choose the component order, see `in_order`."""
        return self.make is not None

    def in_order(self, order: str) -> "FoundModel":
        """The model in another component order; itself where it has its own.

        Raises
        ------
        ModelError
            If the order is unknown, or the model is not defined in it.
        """
        if self.make is None or order == self.cell.order:
            return self
        return replace(self, cells=dict.fromkeys(self.cells, self.make(order)))

    @property
    def title(self) -> str | None:
        """One line about it for people, where it is a baseline."""
        return None if self.baseline is None else self.baseline.title

    @property
    def trained(self) -> bool:
        """Whether it is anything but a baseline that needs no training."""
        return self.baseline is None or bool(self.baseline.presets)

    @property
    def floor(self) -> bool:
        """Whether it is a reference line of the table by default, as a fitted law is."""
        return self.baseline is not None and self.baseline.floor

    @property
    def cell(self) -> MaterialCell:
        """Its cell for the first seed."""
        return next(iter(self.cells.values()))

    @property
    def parameters(self) -> int:
        """Number of trained or fitted parameters."""
        return self.cell.parameters_count()
