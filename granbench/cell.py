"""The names of `granbench.cells` under the module that held them before."""

from granbench.cells.contract import (
    Conditions,
    History,
    MaterialCell,
    ModuleCell,
    Rollout,
    StateLayout,
)

__all__ = ["Conditions", "History", "MaterialCell", "ModuleCell", "Rollout", "StateLayout"]
