"""Means over chunks of a run, from the one running average that LIGGGHTS keeps.

``fix ave/time`` samples at the steps that are multiples of its interval, and cannot be told to
begin anew without a set-up. So it averages over all samples since the last set-up, and a chunk's
mean is what the chunk has added to their sum.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from granbench.generators.dem.engine import Liggghts

FIRST_INTERVAL = 10
"""Steps between two samples until `ChunkAverage.interval` is set."""


class ChunkAverage:
    """Mean of some of the engine's quantities over each chunk of a run.

    `start` comes before the first chunk, after every change of `interval`, and wherever else the
    next run makes a set-up; `of_chunk` after every chunk.

    Parameters
    ----------
    engine : the engine that samples
    name : of the fix that it samples by
    quantities : (quantity,), LIGGGHTS' names for what is sampled, such as ``c_virial[1]``

    Attributes
    ----------
    interval : steps from one sample to the next; a chunk is a whole multiple of it
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
        """Return the smallest number of steps, at least `steps`, that a chunk may have."""
        return max(1, math.ceil(steps / self.interval - 1e-9)) * self.interval

    def start(self, step: int) -> None:
        """Begin anew; the next run has to begin at `step`, with a set-up."""
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
        """Take the fix out of the engine again."""
        self._engine.command(f"unfix {self._name}")

    def of_chunk(self, steps: int) -> np.ndarray:
        """Return the mean (quantity,) over the chunk of `steps` run since the last call."""
        count = steps // self.interval + self._before_first_step
        self._before_first_step = False
        before = self._samples * self._mean
        self._mean = self._engine.fix_vector(self._name, len(self._quantities))
        self._samples += count
        return (self._samples * self._mean - before) / count
