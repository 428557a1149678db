"""Check that a table holds one test, without a second one or a row of averages."""

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError
from granbench.tables.tables import Table

BACK = 0.25
"""Share of the range of the axial strain by which no single row of a steady test falls."""
BACK_TO_START = 0.05
"""The same for a row that returns to the axial strain of the first row."""
AT_START = 0.02
"""Share of the range within which an axial strain equals that of the first row."""
NOISE = 0.05
"""Share of the total forward strain by which the strain of a steady test may fall."""
ROWS_BEFORE = 3


def check_one_test(table: Table, axial: NDArray[np.float64]) -> None:
    """Refuse a row at which the axial strain of an otherwise steady test jumps back.

    Cycles do not jump: they reverse over several rows, or in steps as long as those before.

    Parameters
    ----------
    table : for the places of its rows
    axial : axial strain, (row,)

    Raises
    ------
    DatasetError
        Naming the row.
    """
    for strain in (axial, -axial):
        row = _jump(strain)
        if row is not None:
            raise DatasetError(
                f"{table.source}, {table.places[row]}: the axial strain jumps back from "
                f"{axial[row - 1]:.6g} to {axial[row]:.6g} in one row of a steady test; does a "
                "second test begin here, or is this row an average? Put every test into a file of "
                "its own and remove rows that were not measured; if the specimen was unloaded, "
                "give the rows in between"
            )


def _jump(strain: NDArray[np.float64]) -> int | None:
    """The first row at which a strain that otherwise rises jumps back, or None."""
    extent = float(np.ptp(strain))
    steps = np.diff(strain)
    if extent == 0.0 or len(steps) < ROWS_BEFORE:
        return None
    to_start = np.abs(strain[1:] - strain[0]) <= AT_START * extent
    jumps = -steps > np.where(to_start, BACK_TO_START, BACK) * extent
    jumps[: ROWS_BEFORE - 1] = False
    forward = np.clip(steps, 0.0, None)
    falls = np.clip(-steps[~jumps], 0.0, None).sum()
    if not jumps.any() or falls > NOISE * forward.sum():
        return None
    row = int(jumps.argmax())
    # Forward steps as long as the one back belong to a coarse cycle.
    return row + 1 if forward[:row].max() <= 0.5 * -steps[row] else None
