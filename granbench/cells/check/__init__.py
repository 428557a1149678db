"""The check that a model keeps the interface of material cells."""

from granbench.cells.check.cell_check import CellCheck
from granbench.cells.check.checked_use import check_cell, checked_cell
from granbench.cells.check.probe import POINTS, probe_increments, spread_rows
from granbench.cells.check.repeatability import DifferentResultsError, MixedRowsError

__all__ = [
    "POINTS",
    "CellCheck",
    "DifferentResultsError",
    "MixedRowsError",
    "check_cell",
    "checked_cell",
    "probe_increments",
    "spread_rows",
]
