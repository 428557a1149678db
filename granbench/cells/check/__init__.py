"""The check that a model keeps the interface of material cells."""

from granbench.cells.check.cell_check import CellCheck, check_cell, checked_cell
from granbench.cells.check.probe import POINTS, probe_increments, spread_rows

__all__ = [
    "POINTS",
    "CellCheck",
    "check_cell",
    "checked_cell",
    "probe_increments",
    "spread_rows",
]
