"""The material cell and what belongs to its interface."""

from granbench.cells.contract.conditions import Conditions, History, MissingScalarError
from granbench.cells.contract.material_cell import (
    CONTRACT_ATTRIBUTES,
    FLOATING_FAILURES,
    MaterialCell,
    Rollout,
)
from granbench.cells.contract.module_cell import ModuleCell
from granbench.cells.contract.state_layout import StateLayout

__all__ = [
    "CONTRACT_ATTRIBUTES",
    "FLOATING_FAILURES",
    "Conditions",
    "History",
    "MaterialCell",
    "MissingScalarError",
    "ModuleCell",
    "Rollout",
    "StateLayout",
]
