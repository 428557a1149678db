"""The boundary-value problems by name."""

from granbench.fem.problems.choices import chosen_from_text
from granbench.fem.problems.problem import Problem
from granbench.fem.problems.registry import PROBLEMS, find_problem

__all__ = ["PROBLEMS", "Problem", "chosen_from_text", "find_problem"]
