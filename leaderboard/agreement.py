"""How closely numbers have to agree that were computed again.

How far a number may differ where its model was run again is said by its metric, see
`granbench.benchmark.tolerance`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from granbench.benchmark.predictions_check import UNKNOWN_REMEDY
from granbench.benchmark.registry import (
    find_axis,
    find_metric,
    find_part,
    is_plugged_in,
    of_every_axis,
)
from granbench.benchmark.scorecard import ALL, Curve, Score, Scorecard
from granbench.benchmark.tolerance import VALUE, Tolerance
from granbench.errors import SubmissionError
from granbench.leaderboard.submission import Submission


@dataclass(frozen=True)
class Agreement:
    """How closely claimed numbers must agree with those of the maintainers.

    Parameters
    ----------
    source : what the latter come from, for messages
    relative, absolute : tolerances of every number; the larger counts
    rerun : whether the model was run again, so that the tolerance of each metric counts too
    """

    source: str
    relative: float
    absolute: float
    rerun: bool = False

    def holds(self, score: Score, claimed: float | None, again: float | None) -> bool:
        """Whether two values of a score agree."""
        if claimed is None or again is None:
            return claimed is again
        tolerance = tolerance_of(score.axis, score.metric)
        if self.rerun and tolerance.clock is not None:
            ratio = claimed / again if again > 0.0 else math.inf
            return self.close(claimed, again) or 1.0 / tolerance.clock <= ratio <= tolerance.clock
        part = find_part(score.protocol)
        limit = None if part is None else part.limit
        slack = tolerance.slack(again, score.n, limit) if self.rerun else 0.0
        return self.close(claimed, again, slack)

    def close(self, claimed: float | None, again: float | None, slack: float = 0.0) -> bool:
        """Whether two numbers agree, apart from what they mean."""
        if claimed is None or again is None:
            return claimed is again
        return math.isclose(
            claimed, again, rel_tol=self.relative, abs_tol=max(self.absolute, slack)
        )


RESCORED = Agreement("the predictions", relative=1e-6, absolute=1e-15)
"""Scores carry nine digits; sums in another order on another machine agree to twelve."""

RERUN = Agreement("the model, run again", relative=1e-3, absolute=1e-8, rerun=True)
"""The last bits of a run differ between machines, 1e-16 in double and 1e-7 in single precision a
step; error control and recurrent networks enlarge that, and what is rounded to 15 bits then moves
by 3e-5 now and then: some 1e-9 in a squared error. A value that lies on a limit may fall on its
other side. A thousandth decides no ranking."""


def tolerance_of(axis: str, metric: str) -> Tolerance:
    """How far two computations of a metric may differ.

    Parameters
    ----------
    axis : name of the axis of a score
    metric : its name; one that no axis has, such as "all", is compared as a value
    """
    found = find_metric(axis, metric)
    return VALUE if found is None else found.tolerance


def compare(
    submission: Submission, card: Scorecard, path: object, how: Agreement
) -> tuple[str, ...]:
    """Refuse a submission unless every score, curve and scale agrees.

    Where rounding decides a result (`Axis.lost_results`), numbers need only be of the right order;
    the board shows the recomputed ones. A submission may lack the scores and curves of metrics and
    axes that other packages bring.

    Returns
    -------
    Labels of the scores and curves of such results that did not come out again

    Raises
    ------
    SubmissionError
        Naming the first that is missing, is not one of this benchmark, or differs.
    """
    lost = lost_results(card.scores) if how.rerun else set()
    not_reproduced = []
    claimed = {item.key: item for item in submission.scores}
    for score_again in card.scores:
        label = " / ".join(score_again.key)
        if score_again.key not in claimed:
            if is_plugged_in(score_again.axis, score_again.metric):
                continue
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
        label, unknown = " / ".join(next(iter(claimed))), next(iter(claimed.values()))
        reason = _why_unknown(unknown.axis, unknown.metric)
        raise SubmissionError(f"{path}: score {label} {reason}")
    curves = {item.key: item for item in submission.curves}
    for curve_again in card.curves:
        label = " / ".join(curve_again.key)
        if curve_again.key not in curves:
            part = find_part(curve_again.protocol)
            if part is not None and is_plugged_in(part.axis, curve_again.metric):
                continue
            raise SubmissionError(f"{path}: curve {label} is missing; submit every curve")
        curve = curves.pop(curve_again.key)
        same = _same_curve(curve, curve_again, how)
        if not same and (curve_again.protocol, curve_again.group) in lost:
            not_reproduced.append(f"curve {label}")
            same = _same_on_average(curve, curve_again)
        if not same:
            raise SubmissionError(f"{path}: curve {label} cannot be reproduced from {how.source}")
    if curves:
        label, (protocol, *_, metric) = " / ".join(next(iter(curves))), next(iter(curves))
        part = find_part(protocol)
        reason = _why_unknown(None if part is None else part.axis, metric, protocol)
        raise SubmissionError(f"{path}: curve {label} {reason}")
    scales, again = submission.normalisation, card.normalisation
    same = scales.stress.keys() == again.stress.keys() and all(
        RESCORED.close(scales.stress[name], again.stress[name]) for name in again.stress
    )
    if not (same and RESCORED.close(scales.void_ratio, again.void_ratio)):
        raise SubmissionError(
            f"{path}: normalisation is not the standard deviation of the training split"
        )
    return tuple(not_reproduced)


def _why_unknown(axis: str | None, metric: str, protocol: str = "") -> str:
    """Why no score or curve of that name was computed again, and what to do.

    Parameters
    ----------
    axis : of the score; None for a curve whose protocol belongs to no axis
    metric : of the score or curve
    protocol : of a curve
    """
    if axis is None:
        missing = f"protocol {protocol!r}"
    elif find_axis(axis) is None:
        missing = f"axis {axis!r}"
    elif metric != ALL and find_metric(axis, metric) is None:
        missing = f"metric {metric!r}"
    else:
        return "is not one of this benchmark; remove it"
    return f"cannot be computed again: no installed package defines the {missing}; {UNKNOWN_REMEDY}"


def lost_results(scores: Sequence[Score]) -> set[tuple[str, str]]:
    """Protocol and group of results that rounding decides, on every axis.

    Parameters
    ----------
    scores : recomputed ones: a claim may not excuse others
    """
    return set(of_every_axis(lambda axis: axis.lost_results(scores)))


def _difference_of_lost(claimed: Score, again: Score, how: Agreement) -> str | None:
    found = f"its value is {claimed.value}, but {again.value} from {how.source}"
    tolerance = tolerance_of(again.axis, again.metric)
    lost = tolerance.lost
    if difference := _other_field(claimed, again, ("unit", "n"), how):
        return difference
    if claimed.value is None or again.value is None:
        # A run that ends early has no time; whether this one does, rounding decides.
        timed = tolerance.clock is not None
        return None if timed or claimed.value is again.value else found
    if len(claimed.by_seed) != len(again.by_seed) or not math.isclose(
        claimed.value, sum(claimed.by_seed) / len(claimed.by_seed), rel_tol=1e-6, abs_tol=1e-9
    ):
        return "its value is not the mean of its values by seed"
    if tolerance.clock is not None:
        return None if how.holds(again, claimed.value, again.value) else found
    if lost.absolute is not None:
        if not 0.0 <= claimed.value <= 1.0:
            return f"its value is {claimed.value}; a share is from 0 to 1"
        far = abs(claimed.value - again.value) > lost.absolute
        return f"{found}, too far off even for an analysis that is lost" if far else None
    if lost.factor is None:
        return None
    one, other = sorted((claimed.value, again.value))
    if other > lost.factor * one:
        return (
            f"{found}, more than a factor of {lost.factor:g} off even for an analysis that is lost"
        )
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


def _tolerance_of_curve(curve: Curve) -> Tolerance:
    part = find_part(curve.protocol)
    return VALUE if part is None else tolerance_of(part.axis, curve.metric)


def _same_curve(claimed: Curve, again: Curve, how: Agreement) -> bool:
    slack = _tolerance_of_curve(again).absolute if how.rerun else 0.0
    return (claimed.horizon, claimed.n, claimed.unit) == (
        again.horizon,
        again.n,
        again.unit,
    ) and all(
        _all_close(getattr(claimed, name), getattr(again, name), how, slack)
        for name in ("value", "low", "high")
    )


def _same_on_average(claimed: Curve, again: Curve) -> bool:
    """Whether two curves of shares in a lost analysis are of one order."""
    allowed = _tolerance_of_curve(again).lost.absolute
    return allowed is not None and (
        (claimed.horizon, claimed.n, claimed.unit) == (again.horizon, again.n, again.unit)
        and all(0.0 <= value <= 1.0 for value in claimed.value)
        and abs(sum(claimed.value) - sum(again.value)) <= allowed * len(again.value)
        and (len(claimed.low), len(claimed.high)) == (len(again.low), len(again.high))
    )


def _all_close(
    ones: Sequence[float], others: Sequence[float], how: Agreement, slack: float
) -> bool:
    return len(ones) == len(others) and all(
        how.close(one, other, slack) for one, other in zip(ones, others, strict=True)
    )
