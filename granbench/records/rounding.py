"""Rounding of recorded values, because float32 has more digits than most of them need.

Meaningless digits do not compress. Rounding twice changes nothing, the results are exact in single
precision, and the last bits of exp and matmul, which differ from machine to machine, are rounded
away.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

MANTISSA_BITS = 23
"""Stored bits of the mantissa of a float32."""


def on_grid(values: ArrayLike, spacing: float) -> NDArray[np.float32]:
    """Round values to multiples of a spacing, ties to even; NaN stays NaN.

    Parameters
    ----------
    values : any shape
    spacing : a power of two. Multiples up to 2^24 of it are exact, and so are their differences.
    """
    rounded = np.round(np.asarray(values, dtype=np.float64) / spacing) * spacing
    return rounded.astype(np.float32)


def keep_mantissa(values: ArrayLike, bits: int) -> NDArray[np.float32]:
    """Round values to some bits of mantissa, ties to even; NaN stays NaN.

    Values that are too large for float32 become NaN.

    Parameters
    ----------
    values : any shape
    bits : number of stored bits, fewer than `MANTISSA_BITS`; the relative error is at most
        2^-(bits + 1)
    """
    with np.errstate(over="ignore"):
        single = np.ascontiguousarray(values, dtype=np.float32)
    drop = np.uint32(MANTISSA_BITS - bits)
    stored = single.view(np.uint32)
    half = (np.uint32(1) << (drop - np.uint32(1))) - np.uint32(1)
    rounded = stored + half + ((stored >> drop) & np.uint32(1))
    rounded &= ~((np.uint32(1) << drop) - np.uint32(1))
    result = rounded.view(np.float32)
    return np.where(np.isfinite(single) & np.isfinite(result), result, np.float32(np.nan))
