"""The boundary-value problems by name."""

from granbench.fem.problems.catalogue import PROBLEMS, chosen_from_text, find_problem
from granbench.fem.problems.problem import Problem

__all__ = ["PROBLEMS", "Problem", "chosen_from_text", "find_problem"]
