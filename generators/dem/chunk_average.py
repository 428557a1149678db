"""Means over chunks of a run, from the running average of LIGGGHTS.

``fix ave/time`` samples at the steps that are multiples of its interval, and cannot restart without
a set-up. It therefore averages over all samples since the last set-up, and the mean over a chunk
follows from the change of their sum.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from granbench.generators.dem.engine import Liggghts

FIRST_INTERVAL = 10
"""Steps between two samples until `ChunkAverage.interval` is set."""


class ChunkAverage:
    """Mean of some quantities over each chunk of a run.

    Call `start` before the first chunk, after every change of `interval`, and before every other
    run with set-up; call `of_chunk` after every chunk. The attribute `interval` is the number of
    steps from one sample to the next; a chunk is a whole multiple of it.

    Parameters
    ----------
    engine : LIGGGHTS
    name : of the fix that samples
    quantities : (quantity,), names in LIGGGHTS, such as ``c_virial[1]``
    """

    def __init__(self, engine: Liggghts, name: str, quantities: Sequence[str]) -> None:
        self.interval = FIRST_INTERVAL
        self._engine = engine
        self._name = name
        self._quantities = tuple(quantities)
        self._samples = 0
        self._mean = np.zeros(len(self._quantities))
        self._before_first_step = False

    def whole_chunk(self, steps: float) -> int:
        """Return the smallest number of steps of a chunk that is at least `steps`."""
        return max(1, math.ceil(steps / self.interval - 1e-9)) * self.interval

    def start(self, step: int) -> None:
        """Restart the average; the next run must begin at `step`, with a set-up."""
        self._engine.command(
            f"fix {self._name} all ave/time {self.interval} 1 {self.interval} "
            + " ".join(self._quantities)
            + " ave running"
        )
        self._samples = 0
        self._mean = np.zeros(len(self._quantities))
        # A set-up at a multiple of the interval takes a sample before the first step.
        self._before_first_step = step % self.interval == 0

    def stop(self) -> None:
        """Remove the fix."""
        self._engine.command(f"unfix {self._name}")

    def of_chunk(self, steps: int) -> np.ndarray:
        """Return the mean, (quantity,), over the chunk of `steps` since the last call."""
        count = steps // self.interval + self._before_first_step
        self._before_first_step = False
        before = self._samples * self._mean
        self._mean = self._engine.fix_vector(self._name, len(self._quantities))
        self._samples += count
        return (self._samples * self._mean - before) / count
