"""The material cell: the one contract of models, networks and particle specimens."""

from granbench.cells.check import check_cell
from granbench.cells.contract import (
    Conditions,
    History,
    MaterialCell,
    ModuleCell,
    Rollout,
    StateLayout,
)

__all__ = [
    "Conditions",
    "History",
    "MaterialCell",
    "ModuleCell",
    "Rollout",
    "StateLayout",
    "check_cell",
]
