"""Reversals of a curve, which must be kept when it is thinned.

A cyclic test that is thinned evenly loses its reversals: a model that follows the remaining points
unloads late, too little or not at all, and responds with other stiffnesses.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

NOISE_MARGIN = 4.0
"""Smallest change of direction that is not noise, in standard deviations of the noise."""

PRESCRIBED_BOUNDS = (1e-4, 0.02)
MEASURED_BOUNDS = (5e-3, 0.1)
"""Limits of the smallest change of direction that counts as a reversal, as fractions of the scale.
Small loops of a prescribed series count as well."""

WHITE = 0.6745 * 6.0**0.5
"""Median absolute second difference of white noise of standard deviation one."""


def noise(series: Floats) -> float:
    """Standard deviation of the white noise on a smooth series, (row,)."""
    if len(series) < 3:
        return 0.0
    return float(np.median(np.abs(np.diff(series, 2)))) / WHITE


def reversals(series: Floats, least: float) -> Rows:
    """Rows at which a series reverses by more than `least`, without the first and the last row.

    A row counts when the series has gone back from it by more than `least`.

    Parameters
    ----------
    series : (row,)
    least : smallest change that counts, in the unit of the series
    """
    found: list[int] = []
    low = high = 0
    rising: bool | None = None
    for row in range(1, len(series)):
        value = series[row]
        if rising is not False and value >= series[high]:
            high = row
        if rising is not True and value <= series[low]:
            low = row
        if rising is not False and series[high] - value > least:
            if high:
                found.append(high)
            rising, low = False, row
        elif rising is not True and value - series[low] > least:
            if low:
                found.append(low)
            rising, high = True, row
    return np.array(found, dtype=np.int64)


def turning_rows(
    prescribed: Iterable[tuple[Floats, float]], measured: Iterable[tuple[Floats, float]]
) -> Rows:
    """Rows of a record that must be kept when it is thinned, with the first and the last.

    Parameters
    ----------
    prescribed : series that are prescribed, each (row,), with its scale, a typical range
    measured : series that are measured, in the same way; series with NaN are left out
    """
    kept: set[int] = set()
    rows = 1
    for series_of, (lower, upper) in ((prescribed, PRESCRIBED_BOUNDS), (measured, MEASURED_BOUNDS)):
        for series, scale in series_of:
            rows = len(series)
            if scale > 0.0 and np.isfinite(series).all():
                least = min(max(NOISE_MARGIN * noise(series), lower * scale), upper * scale)
                kept |= set(reversals(series, least).tolist())
    return np.array(sorted(kept | {0, rows - 1}), dtype=np.int64)


def spread_places(lengths: Floats, kept: Rows, count: int) -> Floats:
    """Positions that are spread evenly along a curve and include all rows that must be kept.

    Parameters
    ----------
    lengths : (row,), length of the curve up to each row, increasing
    kept : sorted rows, with the first and the last
    count : number of positions

    Returns
    -------
    (n,), in rows, not always whole numbers; n is larger than `count` if more rows must be kept
    """
    extra = count - len(kept)
    if extra <= 0:
        return kept.astype(float)
    rows = np.arange(len(lengths))
    shares = np.diff(lengths[kept])
    quota = extra * shares / shares.sum()
    between = np.floor(quota).astype(int)
    rest = np.argsort(between - quota, kind="stable")[: extra - int(between.sum())]
    between[rest] += 1
    parts: list[Floats] = []
    for begin, end, number in zip(kept[:-1], kept[1:], between, strict=True):
        wanted = np.linspace(lengths[begin], lengths[end], number + 2)[:-1]
        parts.append(np.concatenate([[begin], np.interp(wanted[1:], lengths, rows)]))
    return np.concatenate([*parts, [float(kept[-1])]])


def spread_rows(lengths: Floats, kept: Rows, count: int) -> Rows:
    """Rows next to the positions of `spread_places`; sorted, each once."""
    return np.unique(np.rint(spread_places(lengths, kept, count))).astype(np.int64)


def shown_rows(x: ArrayLike, y: ArrayLike, count: int) -> list[int]:
    """Rows of a curve that are marked in a figure: about `count` of them, with every reversal.

    Parameters
    ----------
    x, y : (row,); rows with a value that is not finite are left out
    count : approximate number of rows
    """
    parts = [np.asarray(part, dtype=np.float64) for part in (x, y)]
    known = np.flatnonzero(np.isfinite(parts[0]) & np.isfinite(parts[1]))
    if len(known) <= count:
        return [int(row) for row in known]
    kept = turning_rows((), [(part[known], float(np.ptp(part[known]))) for part in parts])
    return [
        int(row) for row in known[spread_rows(np.arange(len(known), dtype=np.float64), kept, count)]
    ]
