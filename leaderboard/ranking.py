"""Who is ranked, and who shares a rank.

A model is ranked with three seeds, or if it has one answer whatever the seed. Two models share a
rank where the paths that were scored cannot tell them apart: the 95 % interval of the mean
difference of their errors, path by path and drawn by specimen, holds zero; or, where the errors of
single paths are not at hand, their own intervals overlap.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from granbench.benchmark.bootstrap import Resampling, weighted_mean
from granbench.benchmark.metric import Direction
from granbench.benchmark.predictions import evaluated, open_predictions
from granbench.benchmark.registry import headline_axis
from granbench.benchmark.scorecard import Score
from granbench.errors import GranbenchError
from granbench.leaderboard.admission import MINIMUM_SEEDS
from granbench.leaderboard.originality import errors_of, is_classical, seeds_score_alike
from granbench.leaderboard.rows import Row
from granbench.leaderboard.submission import Submission
from granbench.leaderboard.submitted_task import records_of, task_of


@dataclass(frozen=True)
class RankedErrors:
    """Squared errors of a model along whole paths, mean over steps, components and seeds.

    Parameters
    ----------
    value : (path,), in training variances
    paths, specimens, splits : (path,), their labels, in the order of the names
    """

    value: np.ndarray
    paths: np.ndarray
    specimens: np.ndarray
    splits: np.ndarray


RankedErrorsByName = Mapping[str, RankedErrors]


def answers_once(submission: Submission) -> bool:
    """Whether a model has one answer for all of its seeds, which then only drive the noise."""
    return seeds_score_alike(submission.scores)


def is_ranked(submission: Submission) -> bool:
    """Whether a submission takes part in the ranking: a model whose seeds say how far luck goes."""
    return submission.role == "model" and not few_seeds(submission)


def few_seeds(submission: Submission) -> bool:
    """Whether a trained model was evaluated for fewer seeds than the board needs."""
    model = submission.model
    if model is not None and model.files and not is_classical(model.baseline):
        # One network under several seeds says nothing about the luck of a seed.
        return len(submission.seeds) < MINIMUM_SEEDS or answers_once(submission)
    return len(submission.seeds) < MINIMUM_SEEDS


def standing(submission: Submission) -> str:
    """What a row says of its seeds, "" where there is nothing to say."""
    if few_seeds(submission):
        count = 1 if answers_once(submission) else len(submission.seeds)
        return f"{count} seed{'s' if count != 1 else ''}, not ranked"
    return "deterministic" if answers_once(submission) else ""


def path_errors(rows: Iterable[Row]) -> dict[str, RankedErrors]:
    """Errors of single paths by model, of the rows that have predictions and records at hand.

    Parameters
    ----------
    rows : of one task and version
    """
    found: dict[str, RankedErrors] = {}
    with_predictions = [row for row in rows if row.submission.predictions is not None]
    if len(with_predictions) < 2:
        return found
    first = with_predictions[0]
    try:
        task = task_of(first.submission, first.file)
        with records_of(task, first.file) as whole:
            records = task.view(whole)
            scored = evaluated(records)
            order = np.argsort(scored["path_id"].values.astype(str))
            labels = [scored[name].values.astype(str)[order] for name in _LABELS]
            for row in with_predictions:
                assert row.submission.predictions is not None
                file = row.file.parent / row.submission.predictions.file
                errors = errors_of(open_predictions(file), records)
                if errors is not None:
                    value = (errors.error**2).mean(axis=(0, 2, 3))
                    found[row.submission.name] = RankedErrors(value, *labels)
    except GranbenchError:
        return {}  # then the intervals of the rows decide
    return found


_LABELS = ("path_id", "specimen", "split")


def worse(value: float, direction: Direction) -> float:
    """A number that grows as a value gets worse."""
    if direction == "target 1":
        return abs(value - 1.0)
    return -value if direction == "higher" else value


def shared_ranks(
    scores: Mapping[str, Score],
    split: str,
    errors: RankedErrorsByName,
    direction: Direction = "lower",
) -> dict[str, str]:
    """Ranks by name, such as "1", or "2=" where a rank is shared.

    Parameters
    ----------
    scores : of the ranked models, with a value each
    split : of the records
    errors : of single paths, where they are at hand
    direction : which values are better
    """
    names = sorted(scores, key=lambda name: (worse(scores[name].value or 0.0, direction), name))
    tied: Callable[[str, str], bool] = partial(_tied, scores, split, errors)
    numbers: dict[str, int] = {}
    leader = ""
    for place, name in enumerate(names, start=1):
        if leader and tied(leader, name):
            numbers[name] = numbers[leader]
        else:
            leader, numbers[name] = name, place
    counts = list(numbers.values())
    return {
        name: f"{number}=" if counts.count(number) > 1 else str(number)
        for name, number in numbers.items()
    }


def _tied(
    scores: Mapping[str, Score], split: str, errors: RankedErrorsByName, one: str, other: str
) -> bool:
    headline = headline_axis().headline
    paired = headline is not None and scores[one].metric == headline.metric
    if paired and one in errors and other in errors:
        return _no_difference(errors[one], errors[other], split)
    return overlapping(scores[one], scores[other])


def _no_difference(one: RankedErrors, other: RankedErrors, split: str) -> bool:
    """Whether zero lies within the interval of the mean difference over paths."""
    inside = one.splits == split
    difference = (one.value - other.value)[inside]
    if not difference.any():
        return True
    resampling = Resampling.by_specimen(one.specimens[inside])
    interval = resampling.interval(partial(weighted_mean, difference))
    return interval is not None and bool(interval[0] <= 0.0 <= interval[1])


def overlapping(one: Score, other: Score) -> bool:
    """Whether the intervals of two scores overlap; equal values always do."""
    if one.value == other.value:
        return True
    ends = (one.low, one.high, other.low, other.high)
    if any(end is None for end in ends):
        return False
    low, high, other_low, other_high = (float(end) for end in ends if end is not None)
    return low <= other_high and other_low <= high


def ranked_last(rows: Sequence[tuple[float | None, str, bool, bool]]) -> list[int]:
    """Order of rows by value, those of few seeds after every ranked one.

    Parameters
    ----------
    rows : value, name, whether ranked, whether of few seeds
    """

    def key(place: int) -> tuple[bool, float, str]:
        value, name, _, _ = rows[place]
        return (value is None, value or 0.0, name)

    ordered = sorted((i for i, row in enumerate(rows) if not row[3]), key=key)
    few = sorted((i for i, row in enumerate(rows) if row[3]), key=key)
    ranked = [at for at, i in enumerate(ordered) if rows[i][2] and rows[i][0] is not None]
    for place in few:
        at = ranked[-1] + 1 if ranked else 0
        while at < len(ordered) and key(ordered[at]) < key(place):
            at += 1
        ordered.insert(at, place)
    return ordered
