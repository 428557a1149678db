"""Leaderboard: submissions, their validation, and the static site."""

from granbench.leaderboard.submission import Submission, read_submission
from granbench.leaderboard.validation import validate

__all__ = ["Submission", "read_submission", "validate"]
