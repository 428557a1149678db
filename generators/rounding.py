"""How finely the numbers of a `gp-*` dataset are kept.

A record in single precision has seven digits, of which the last are of no use: predictions are
compared with five (`granbench.benchmark.predictions.KEEP_BITS`). Without them the files have half
the size.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granbench.paths.drawn import STRAIN_GRID
from granbench.records.rounding import keep_mantissa, on_grid
from granbench.records.schema import SCHEMA

KEEP_BITS = 16
"""Bits of mantissa of what has a unit, stresses and tangents: 2^-17 = 8e-6 off at most, half of
what predictions are off."""

ROUNDING = (
    f"numbers without unit are multiples of 2^{int(np.log2(STRAIN_GRID))}, exact in single "
    f"precision; stresses are rounded to {KEEP_BITS} bits of mantissa, a relative error of at "
    f"most 2^-{KEEP_BITS + 1}; what is recorded at step 0 is exactly what the model started from"
)
"""For the attributes of a file."""


def recorded(name: str, values: ArrayLike) -> NDArray[np.float32]:
    """The values of a variable as a dataset keeps them.

    What has no unit - strains, void ratio, hardening - lies on the grid of the strains; the rest
    has `KEEP_BITS` bits of mantissa. Applying it twice changes nothing.

    Parameters
    ----------
    name : of a variable of `granbench.records.schema.SCHEMA`
    values : any shape
    """
    if SCHEMA[name].units == "1":
        return on_grid(values, STRAIN_GRID)
    return keep_mantissa(values, KEEP_BITS)


def rounding_attributes(name: str) -> dict[str, float | int]:
    """What the file says about the rounding of a variable."""
    if SCHEMA[name].units == "1":
        return {"grid_spacing": STRAIN_GRID}
    return {"keep_bits": KEEP_BITS}
