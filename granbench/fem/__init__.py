"""Finite elements in plane strain with any material cell inside.

The names are imported when they are first used: what a dataset states of its problems
(`granbench.fem.statement`) and mesh files are read without torch.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from granbench.fem.analysis import run
    from granbench.fem.implicit_settings import ImplicitSettings
    from granbench.fem.mesh import PlaneMesh
    from granbench.fem.problems import PROBLEMS, Problem, find_problem
    from granbench.fem.result import Analysis
    from granbench.fem.structured import rectangle
    from granbench.fem.time_step import ExplicitSettings

__all__ = [
    "PROBLEMS",
    "Analysis",
    "ExplicitSettings",
    "ImplicitSettings",
    "PlaneMesh",
    "Problem",
    "find_problem",
    "rectangle",
    "run",
]

_MODULES = {
    "PROBLEMS": "problems",
    "Analysis": "result",
    "ExplicitSettings": "time_step",
    "ImplicitSettings": "implicit_settings",
    "PlaneMesh": "mesh",
    "Problem": "problems",
    "find_problem": "problems",
    "rectangle": "structured",
    "run": "analysis",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
