"""Finite elements in plane strain with any material cell inside."""

from granbench.fem.analysis import run
from granbench.fem.iteration import ImplicitSettings
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
