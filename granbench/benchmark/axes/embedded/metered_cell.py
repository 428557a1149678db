"""A cell inside an analysis: timed and counted."""

import time
from collections.abc import Callable
from typing import final

from torch import Tensor

from granbench.cells.contract import Conditions, MaterialCell
from granbench.errors import AnalysisError

Answer = Callable[[Tensor, Tensor], tuple[Tensor, ...]]


@final
class MeteredCell(MaterialCell):
    """A cell whose answers are its own, to the last bit.

    Parameters
    ----------
    cell : the model
    limit : calls after which an analysis is given up; None for no limit. A count is the same on
        every machine, which a time would not be.

    Attributes
    ----------
    seconds : CPU time that the model took so far
    calls : of `step` and `tangent` so far
    """

    def __init__(self, cell: MaterialCell, limit: int | None = None) -> None:
        self.name, self.order, self.dtype = cell.name, cell.order, cell.dtype
        self.layout, self.internals = cell.layout, cell.internals
        self.cheap_tangent = cell.cheap_tangent
        self.seconds, self.calls = 0.0, 0
        self._cell, self._limit = cell, limit

    def initial_state(self, conditions: Conditions) -> Tensor:
        """See `MaterialCell.initial_state`."""
        return self._cell.initial_state(conditions)

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `MaterialCell.step`."""
        stress, after = self._timed(self._cell.step, dstrain, state)
        return stress, after

    def tangent(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """See `MaterialCell.tangent`."""
        stress, after, tangent = self._timed(self._cell.tangent, dstrain, state)
        return stress, after, tangent

    def _timed(self, answer: Answer, dstrain: Tensor, state: Tensor) -> tuple[Tensor, ...]:
        self.calls += 1
        if self._limit is not None and self.calls > self._limit:
            raise AnalysisError(
                f"the analysis with {self.name} is given up after {self._limit} updates: its load "
                "steps converge too seldom"
            )
        begin = time.process_time()
        try:
            return answer(dstrain, state)
        finally:
            self.seconds += time.process_time() - begin
