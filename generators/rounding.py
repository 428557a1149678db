"""Rounding of the numbers in datasets that classical models make.

A record in single precision has seven digits, of which the last are of no use: predictions are
compared with five (`granbench.benchmark.predictions.KEEP_BITS`). Without them the files have half
the size.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granbench.paths.drawn import STRAIN_GRID
from granbench.records.rounding import keep_mantissa, on_grid
from granbench.records.schema import SCHEMA

STRESS_BITS = 16
"""Bits of mantissa of stresses and tangents: an error of at most 2^-17 = 8e-6, half of the rounding
error of predictions."""

ROUNDING = (
    f"numbers without unit are multiples of 2^{int(np.log2(STRAIN_GRID))}, exact in single "
    f"precision; stresses are rounded to {STRESS_BITS} bits of mantissa, a relative error of at "
    f"most 2^-{STRESS_BITS + 1}"
)
"""Text of the global attribute `rounding` of a file."""


def recorded(name: str, values: ArrayLike) -> NDArray[np.float32]:
    """Round the values of a variable as a dataset keeps them; rounding twice changes nothing.

    Variables without unit, such as strain, void ratio and hardening, lie on the grid of the
    strains; the others have `STRESS_BITS` bits of mantissa.

    Parameters
    ----------
    name : of a variable of `granbench.records.schema.SCHEMA`
    values : any shape
    """
    if SCHEMA[name].units == "1":
        return on_grid(values, STRAIN_GRID)
    return keep_mantissa(values, STRESS_BITS)


def rounding_attributes(name: str) -> dict[str, float | int]:
    """Attributes that describe the rounding of a variable in a file."""
    if SCHEMA[name].units == "1":
        return {"grid_spacing": STRAIN_GRID}
    return {"keep_bits": STRESS_BITS}
