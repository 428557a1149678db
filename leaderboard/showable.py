"""Checks of a submission that was not validated, so that a page can show it."""

from itertools import pairwise
from pathlib import Path

from granbench.benchmark.scorecard import ALL, Curve, Score
from granbench.errors import SubmissionError
from granbench.leaderboard.submission import Submission

LARGEST = 1e12
"""Largest score. Errors are at most 100, times a year, numbers of parameters a billion."""

LONGEST_HORIZON = 1_000_000
MOST_SCORES = 20_000


def require_showable(submission: Submission, file: Path) -> None:
    """Make sure that a page can show a submission, whatever it claims.

    Parameters
    ----------
    submission : with the badge `claimed`
    file : where it was read from, for the message

    Raises
    ------
    SubmissionError
        If a score or curve cannot come from an evaluation; the text names the first one.
    """
    if len(submission.scores) + len(submission.curves) > MOST_SCORES:
        raise _refused(file, f"it has more than {MOST_SCORES:,} scores and curves")
    if not any(score.split != ALL for score in submission.scores):
        raise _refused(file, "none of its scores belongs to a split")
    if submission.parameters is not None and submission.parameters > LARGEST:
        raise _refused(file, f"field parameters is above {LARGEST:g}")
    for score in submission.scores:
        if complaint := _of_score(score):
            raise _refused(file, f"score {' / '.join(score.key)}: {complaint}")
    for curve in submission.curves:
        if complaint := _of_curve(curve):
            raise _refused(file, f"curve {' / '.join(curve.key)}: {complaint}")


def _refused(file: Path, what: str) -> SubmissionError:
    return SubmissionError(
        f"{file}: {what[:300]}, which `granbench evaluate` does not write; evaluate the model again"
    )


def _of_score(score: Score) -> str | None:
    # What belongs to no split, and an axis as a whole that does not apply, count no paths.
    if score.split != ALL and score.metric != ALL and score.n < 1:
        return "n must be at least 1"
    if score.n > LARGEST:
        return f"n is above {LARGEST:g}"
    numbers = [score.value, score.low, score.high, *score.by_seed]
    if any(number is not None and abs(number) > LARGEST for number in numbers):
        return f"a value is beyond {LARGEST:g}"
    if score.status == "scored" and not score.by_seed:
        return "it has no values by seed"
    return None


def _of_curve(curve: Curve) -> str | None:
    horizon = curve.horizon
    if not horizon or horizon[0] < 1 or horizon[-1] > LONGEST_HORIZON:
        return f"its horizon must have steps from 1 to {LONGEST_HORIZON:,}"
    if any(one >= other for one, other in pairwise(horizon)):
        return "its horizon must increase"
    if any(not 0.0 <= number <= LARGEST for number in (*curve.value, *curve.low, *curve.high)):
        return f"its values must lie between 0 and {LARGEST:g}"
    return None
