"""The material cell: the one interface of classical models, networks and particle specimens."""

from granbench.cells.check import check_cell
from granbench.cells.contract import (
    Conditions,
    History,
    MaterialCell,
    ModuleCell,
    Rollout,
    StateLayout,
)
from granbench.cells.wrapper import CellWrapper

__all__ = [
    "CellWrapper",
    "Conditions",
    "History",
    "MaterialCell",
    "ModuleCell",
    "Rollout",
    "StateLayout",
    "check_cell",
]
