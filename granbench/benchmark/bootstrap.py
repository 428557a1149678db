"""95 % bootstrap intervals, clustered by specimen.

Paths of one specimen share its packing and are not independent, so specimens are drawn with
replacement and each brings all its paths and all seeds. The interval says how far the score
depends on which specimens were tested; the spread over seeds is reported apart. Fewer than three
specimens say nothing of their scatter: there is no interval then.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

RESAMPLES = 2000
SEED = 20230
LEVEL = 0.95
MINIMUM_SPECIMENS = 3
"""Fewer have no interval: two drawn from two give either one alone or their mean, and the interval
would only repeat the two values."""


@dataclass(frozen=True)
class Resampling:
    """Number of times that each path appears in each resample.

    Parameters
    ----------
    weights : (resample, path), integers as float
    specimens : number of different specimens, see `MINIMUM_SPECIMENS`
    """

    weights: np.ndarray
    specimens: int

    @classmethod
    def by_specimen(cls, specimens: np.ndarray, resamples: int = RESAMPLES) -> "Resampling":
        """Resampling of paths (path,) by their specimen label.

        The raw bits of PCG64 are used because NumPy promises never to change them, so that an
        interval is reproduced by any version.
        """
        labels, cluster = np.unique(specimens.astype(str), return_inverse=True)
        raw = np.random.PCG64(SEED).random_raw(resamples * len(labels))
        drawn = (raw % np.uint64(len(labels))).astype(np.int64).reshape(resamples, len(labels))
        counts = np.zeros((resamples, len(labels)))
        np.add.at(counts, (np.arange(resamples)[:, None], drawn), 1.0)
        return cls(counts[:, cluster], len(labels))

    def interval(
        self, estimate: Callable[[np.ndarray], np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Percentile interval (low, high) of an estimate, each (...).

        None if there are fewer specimens than `MINIMUM_SPECIMENS`.

        Parameters
        ----------
        estimate : maps weights (resample, path) to values (resample, ...)
        """
        if self.specimens < MINIMUM_SPECIMENS:
            return None
        ranked = np.sort(estimate(self.weights), axis=0)
        # Order statistics without interpolation: infinite values must not become NaN.
        last = len(ranked) - 1
        tail = 0.5 * (1.0 - LEVEL)
        return ranked[round(tail * last)], ranked[round((1.0 - tail) * last)]


def weighted_mean(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Mean over paths of values (path, ...) for each resample: (resample, ...)."""
    return np.tensordot(weights, values, axes=1) / weights.sum(axis=1).reshape(
        -1, *[1] * (values.ndim - 1)
    )


def weighted_median(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Median over paths of values (path,), each repeated weights (resample, path) times."""
    order = np.argsort(values, kind="stable")
    cumulative = np.cumsum(weights[:, order], axis=1)
    total = cumulative[:, -1]
    lower = (cumulative <= (np.floor((total - 1.0) / 2.0))[:, None]).sum(axis=1)
    upper = (cumulative <= (np.floor(total / 2.0))[:, None]).sum(axis=1)
    ranked = values[order]
    low, high = ranked[lower], ranked[upper]
    return np.where(low == high, low, 0.5 * (low + high))
