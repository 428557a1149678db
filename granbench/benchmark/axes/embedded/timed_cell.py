"""A cell inside an analysis, whose calls are timed and counted."""

import time
from typing import final

from torch import Tensor

from granbench.cells.contract import MaterialCell
from granbench.cells.robust_runs import CellMethod
from granbench.cells.wrapper import CellWrapper
from granbench.errors import AnalysisError


@final
class TimedCell(CellWrapper, same_model=True):
    """A cell that returns what the wrapped one returns, to the last bit.

    Parameters
    ----------
    cell : the model
    limit : calls after which an analysis is stopped; None for no limit. A count is the same on
        every machine, which a time would not be.

    Attributes
    ----------
    seconds : CPU time that the model took so far
    calls : of `step` and `tangent` so far
    """

    def __init__(self, cell: MaterialCell, limit: int | None = None) -> None:
        super().__init__(cell)
        self.seconds, self.calls = 0.0, 0
        self._limit = limit

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `MaterialCell.step`."""
        stress, after = self._timed(self.wrapped.step, dstrain, state)
        return stress, after

    def tangent(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """See `MaterialCell.tangent`."""
        stress, after, tangent = self._timed(self.wrapped.tangent, dstrain, state)
        return stress, after, tangent

    def _timed(self, method: CellMethod, dstrain: Tensor, state: Tensor) -> tuple[Tensor, ...]:
        self.calls += 1
        if self._limit is not None and self.calls > self._limit:
            raise AnalysisError(
                f"the analysis with {self.name} is given up after {self._limit} updates: its load "
                "steps converge too seldom"
            )
        begin = time.process_time()
        try:
            return method(dstrain, state)
        finally:
            self.seconds += time.process_time() - begin
