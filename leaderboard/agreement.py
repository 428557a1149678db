"""How closely numbers have to agree that were computed again."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from granbench.benchmark.axes.embedded.metrics import SPEED
from granbench.benchmark.axes.physics.checks import CHECKS
from granbench.benchmark.protocols import COST, EMBEDDED, PHYSICS
from granbench.benchmark.scorecard import ALL, Curve, Score, Scorecard
from granbench.errors import SubmissionError
from granbench.leaderboard.submission import Submission

REACTION_ERROR = "reaction_error"
TIMED = "update_"
"""Begins the metrics of the cost axis that are measured with a clock."""
OF_LOST = (REACTION_ERROR, "volumetric_strain_error", "point_stress_mse")
"""Errors that are compared by a factor where a model has lost an analysis. The ratio of the largest
accelerations is not compared there: it is 1000 for a run that fails, and rounding decides whether
it fails."""
IN_STEPS = ("reached_share", "error_point_growth")
"""Metrics of analyses that count output steps, or follow from counts of points in them."""
SHARES_OF_PATHS = ("diverged_share", "failed_share", "violated_share", "kink_share")
"""A path, or what few points of it are checked, counts or does not."""


LOST = 0.2
"""Error of the reaction, with any seed, beyond which a model has lost an analysis. It is chaotic
then: rounding decides at which step it fails, and whether. `gru-change` on fem-ime, evaluated again
with the same weights and its sums in another order, failed elsewhere: implicit errors of the
reaction of 1.80 (biaxial) and 4.33 (wall) became 0.87 and 2.51."""


@dataclass(frozen=True)
class Agreement:
    """Between claimed numbers and those of the maintainers.

    Parameters
    ----------
    source : what the latter come from, for messages
    relative, absolute : tolerances; the larger counts
    one_more : whether a share of paths may differ by one of them, and a median step by one step
    share : by which a share of steps may differ
    of_checks : share of a physics check's tolerance by which its violation may differ
    of_analyses : share of an embedded score, or of 1 where it is a share, by which it may differ
    of_lost : factor between two errors of curves and stress in an analysis that the model has
        lost, see `LOST`, its square where they are squares. 1 for no such exception
    of_lost_shares : by which a share of points or steps in such an analysis may differ
    clock : factor between two timings
    """

    source: str
    relative: float
    absolute: float
    one_more: bool = False
    share: float = 0.0
    of_checks: float = 0.0
    of_analyses: float = 0.0
    of_lost: float = 1.0
    of_lost_shares: float = 0.0
    clock: float = 1.0

    def holds(self, score: Score, claimed: float | None, again: float | None) -> bool:
        """Whether two values of a score agree."""
        if claimed is None or again is None:
            return claimed is again
        if _timed(score):
            ratio = claimed / again if again > 0.0 else math.inf
            return self.close(claimed, again) or 1.0 / self.clock <= ratio <= self.clock
        return self.close(claimed, again, self._slack(score, again))

    def close(self, claimed: float | None, again: float | None, slack: float = 0.0) -> bool:
        """Whether two numbers agree, apart from what they mean."""
        if claimed is None or again is None:
            return claimed is again
        return math.isclose(
            claimed, again, rel_tol=self.relative, abs_tol=max(self.absolute, slack)
        )

    def _slack(self, score: Score, again: float) -> float:
        if score.axis == EMBEDDED:
            counted = score.metric.endswith("_share") or score.metric in IN_STEPS
            return self.of_analyses * (1.0 if counted else abs(again))
        if self.one_more and score.unit == "step":
            return 1.0
        if self.one_more and score.metric in SHARES_OF_PATHS:
            return 1.0 / max(score.n, 1)
        if score.metric.endswith("_share"):
            return self.share
        if score.axis == PHYSICS and score.protocol in CHECKS:
            # Where nothing is allowed, a share of a path's steps is counted: a few of them.
            return self.of_checks * (CHECKS[score.protocol].tolerance or 0.1)
        return 0.0


RESCORED = Agreement("the predictions", relative=1e-6, absolute=1e-15)
"""Scores carry nine digits; sums in another order on another machine agree to twelve."""

RERUN = Agreement(
    "the model, run again",
    relative=1e-3,
    absolute=1e-8,
    one_more=True,
    share=1e-3,
    of_checks=0.1,
    of_analyses=0.02,
    of_lost=3.0,
    of_lost_shares=0.5,
    clock=10.0,
)
"""The last bits of a run differ between machines, 1e-16 in double and 1e-7 in single precision a
step; error control and recurrent networks enlarge that, and what is rounded to 15 bits then moves
by 3e-5 now and then: some 1e-9 in a squared error. A value that lies on a limit may fall on its
other side. A thousandth decides no ranking. Through the thousands of steps of an analysis a
difference of 1e-13 stayed 1e-13 with the classical models and 1e-7 with a network 2e-7, as long as
it followed the truth (`LOST`); one of 90 output steps, or of 64 points, may still fall on the other
side of a limit. Clocks of machines, and of one machine on a busy day, differ by a few times; ten is
a claim about another model."""


def _timed(score: Score) -> bool:
    """Whether a score is measured with a clock."""
    if score.axis == EMBEDDED:
        return score.metric.endswith(SPEED)
    return score.axis == COST and score.metric.startswith(TIMED)


def compare(
    submission: Submission, card: Scorecard, path: object, how: Agreement
) -> tuple[str, ...]:
    """Refuse a submission unless every score, curve and scale agrees.

    In an analysis that the model has lost, numbers need only be of the right order; the board shows
    the recomputed ones.

    Returns
    -------
    Labels of the scores and curves of lost analyses that did not come out again

    Raises
    ------
    SubmissionError
        Naming the first that is missing, is not one of this benchmark, or differs.
    """
    lost = lost_analyses(card.scores) if how.of_lost > 1.0 else set()
    not_reproduced = []
    claimed = {item.key: item for item in submission.scores}
    for score_again in card.scores:
        label = " / ".join(score_again.key)
        if score_again.key not in claimed:
            raise SubmissionError(f"{path}: score {label} is missing; submit every score")
        chaotic = (score_again.protocol, score_again.group) in lost
        compared = _difference_of_lost if chaotic else _difference
        difference = compared(claimed[score_again.key], score_again, how)
        if chaotic and not difference and _difference(claimed[score_again.key], score_again, how):
            not_reproduced.append(label)
        del claimed[score_again.key]
        if difference:
            raise SubmissionError(f"{path}: score {label} cannot be reproduced: {difference}")
    if claimed:
        label = " / ".join(next(iter(claimed)))
        raise SubmissionError(f"{path}: score {label} is not one of this benchmark; remove it")
    curves = {item.key: item for item in submission.curves}
    for curve_again in card.curves:
        label = " / ".join(curve_again.key)
        if curve_again.key not in curves:
            raise SubmissionError(f"{path}: curve {label} is missing; submit every curve")
        slack = how.of_analyses if curve_again.metric == "error_point_share" else 0.0
        curve = curves.pop(curve_again.key)
        same = _same_curve(curve, curve_again, how, slack)
        if not same and (curve_again.protocol, curve_again.group) in lost:
            not_reproduced.append(f"curve {label}")
            same = _same_on_average(curve, curve_again, how)
        if not same:
            raise SubmissionError(f"{path}: curve {label} cannot be reproduced from {how.source}")
    if curves:
        label = " / ".join(next(iter(curves)))
        raise SubmissionError(f"{path}: curve {label} is not one of this benchmark; remove it")
    scales, again = submission.normalisation, card.normalisation
    same = scales.stress.keys() == again.stress.keys() and all(
        RESCORED.close(scales.stress[name], again.stress[name]) for name in again.stress
    )
    if not (same and RESCORED.close(scales.void_ratio, again.void_ratio)):
        raise SubmissionError(
            f"{path}: normalisation is not the standard deviation of the training split"
        )
    return tuple(not_reproduced)


def lost_analyses(scores: Sequence[Score]) -> set[tuple[str, str]]:
    """Protocol and group of every analysis that a model has lost, and of means over such.

    Parameters
    ----------
    scores : recomputed ones: a claim of being lost would excuse the others
    """
    lost = {
        (score.protocol, score.group)
        for score in scores
        if score.axis == EMBEDDED and score.metric == REACTION_ERROR
        and max((score.value or 0.0, *score.by_seed)) > LOST
    }  # fmt: skip
    return lost | {(protocol, ALL) for protocol, _ in lost}


def _difference_of_lost(claimed: Score, again: Score, how: Agreement) -> str | None:
    found = f"its value is {claimed.value}, but {again.value} from {how.source}"
    if difference := _other_field(claimed, again, ("unit", "n"), how):
        return difference
    if claimed.value is None or again.value is None:
        # A run that ends early has no time; whether this one does, rounding decides.
        return None if _timed(again) or claimed.value is again.value else found
    if len(claimed.by_seed) != len(again.by_seed) or not math.isclose(
        claimed.value, sum(claimed.by_seed) / len(claimed.by_seed), rel_tol=1e-6, abs_tol=1e-9
    ):
        return "its value is not the mean of its values by seed"
    if again.metric.endswith("_share") and not 0.0 <= claimed.value <= 1.0:
        return f"its value is {claimed.value}; a share is from 0 to 1"
    if _timed(again):
        return None if how.holds(again, claimed.value, again.value) else found
    if again.metric.endswith("_share"):
        far = abs(claimed.value - again.value) > how.of_lost_shares
        return f"{found}, too far off even for an analysis that is lost" if far else None
    if again.metric not in OF_LOST:
        return None
    factor = how.of_lost**2 if again.metric.endswith("_mse") else how.of_lost
    one, other = sorted((claimed.value, again.value))
    if other > factor * one:
        return f"{found}, more than a factor of {factor:g} off even for an analysis that is lost"
    return None


def _other_field(claimed: Score, again: Score, fields: Sequence[str], how: Agreement) -> str | None:
    for field in fields:
        one, other = getattr(claimed, field), getattr(again, field)
        if one != other:
            return f"its {field} is {one!r}, but {other!r} from {how.source}"
    return None


def _difference(claimed: Score, again: Score, how: Agreement) -> str | None:
    if difference := _other_field(claimed, again, ("status", "unit", "n", "reason"), how):
        return difference
    for field in ("value", "low", "high"):
        one, other = getattr(claimed, field), getattr(again, field)
        if not how.holds(again, one, other):
            return f"its {field} is {one}, but {other} from {how.source}"
    if len(claimed.by_seed) != len(again.by_seed) or not all(
        how.holds(again, *pair) for pair in zip(claimed.by_seed, again.by_seed, strict=True)
    ):
        return f"its values by seed differ from those from {how.source}"
    return None


def _same_curve(claimed: Curve, again: Curve, how: Agreement, slack: float) -> bool:
    return (claimed.horizon, claimed.n, claimed.unit) == (
        again.horizon,
        again.n,
        again.unit,
    ) and all(
        _all_close(getattr(claimed, name), getattr(again, name), how, slack)
        for name in ("value", "low", "high")
    )


def _same_on_average(claimed: Curve, again: Curve, how: Agreement) -> bool:
    """Whether two curves of shares in a lost analysis are of one order."""
    return (claimed.horizon, claimed.n, claimed.unit) == (again.horizon, again.n, again.unit) and (
        all(0.0 <= value <= 1.0 for value in claimed.value)
        and abs(sum(claimed.value) - sum(again.value)) <= how.of_lost_shares * len(again.value)
        and (len(claimed.low), len(claimed.high)) == (len(again.low), len(again.high))
    )


def _all_close(
    ones: Sequence[float], others: Sequence[float], how: Agreement, slack: float
) -> bool:
    return len(ones) == len(others) and all(
        how.close(one, other, slack) for one, other in zip(ones, others, strict=True)
    )
