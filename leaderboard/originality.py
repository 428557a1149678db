"""Copies and near-copies: of the truth, of another row, and of one model under several seeds.

Predictions are compared as numbers, rounded as a predictions file stores them: another attribute,
one changed value or another order of the seeds does not make a new model. A submission that is
flagged here needs a maintainer's reason before the board accepts it. A classical model that is run
again is exempt: fitted to the records of its own law, it reproduces them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from granbench.benchmark.axis import PathSample
from granbench.benchmark.comparison import CEILING
from granbench.benchmark.predictions import evaluated
from granbench.benchmark.registry import find_axis, find_metric, find_part, headline_axis
from granbench.benchmark.scorecard import Score
from granbench.benchmark.scoring import scored_predictions
from granbench.cells.baseline import find_baseline
from granbench.data.normalisation import Normalisation
from granbench.data.replicates import replicate_scatter
from granbench.errors import DatasetError, ModelError
from granbench.models import MODELS

IDENTICAL_SHARE = 0.5
"""Share of equal stored values along whole paths above which two predictions are the same. Two
independent models agree in a value to 15 bits about once in ten thousand times their relative
error."""

EXTRAORDINARY = 1e-6
"""Mean squared error of whole paths, in training variances, below which a model is flagged:
a thousandth of a standard deviation along paths that it was not trained on. The networks on the
board reach 1e-3; lower errors have so far come from the law that made the records, or from the
records themselves."""

CLOSER = 0.01
"""Mean square of the difference of two models over that of their errors, below which one is a copy
of the other: they are ten times closer to each other than to the truth."""

WHITE = 0.3
"""Correlation of the errors of neighbouring steps below which they are noise added to the truth.
A model's error grows and turns along a path: it is above 0.9 for every row of the board."""

SAME_SCORE = 1e-3
"""Largest relative difference of two scores of the same model."""


@dataclass(frozen=True)
class Errors:
    """Predictions of a model along whole paths, and their errors in training standard deviations.

    Parameters
    ----------
    predicted : (seed, path, step, component), as stored, Pa; NaN where a run broke down
    true : (path, step, component), rounded alike
    error : their difference over the training standard deviation, at most `CEILING`
    paths : names, in the order of the axis
    """

    predicted: np.ndarray
    true: np.ndarray
    error: np.ndarray
    paths: tuple[str, ...]


def errors_of(predictions: xr.Dataset, records: xr.Dataset) -> Errors | None:
    """Errors under the protocol that models are ranked by; None where it was left out.

    Parameters
    ----------
    predictions : see `granbench.benchmark.predictions`
    records : the whole dataset of the task
    """
    headline = headline_axis().headline
    samples = _path_samples(predictions, records)
    if headline is None or headline.protocol not in samples:
        return None
    sample = samples[headline.protocol]
    names = predictions["path_id"].values.astype(str)
    order = np.argsort(names)
    predicted, true = sample.predicted[:, order], sample.true[order]
    error = np.clip((predicted - true) / sample.stress_scale, -CEILING, CEILING)
    return Errors(predicted, true, np.nan_to_num(error, nan=CEILING), tuple(names[order]))


def _path_samples(predictions: xr.Dataset, records: xr.Dataset) -> dict[str, PathSample]:
    """Predicted and true stress of every protocol of the axis that models are ranked on."""
    axis = headline_axis()
    normalisation = Normalisation.from_training(records)
    scored = scored_predictions(predictions, evaluated(records), normalisation)
    return {
        part.name: axis.sample(scored, part)
        for part in axis.parts
        if axis.was_run(predictions, part)
    }


def is_classical(baseline: str | None) -> bool:
    """Whether a model that is run again is a classical law, with parameters fitted or given.

    Parameters
    ----------
    baseline : of the submission's model; None where its file holds parameters
    """
    if baseline is None:
        return True
    try:
        return find_baseline(baseline).classical_model in MODELS
    except ModelError:
        return False


def copied_protocols(predictions: xr.Dataset, records: xr.Dataset) -> Iterator[str]:
    """Protocols whose stored values are mostly those of the truth, with the share.

    Parameters
    ----------
    predictions : see `granbench.benchmark.predictions`
    records : the whole dataset of the task
    """
    for name, sample in _path_samples(predictions, records).items():
        for truth in sample.truths:
            same = float((sample.predicted == truth).mean())
            if same > IDENTICAL_SHARE:
                yield f"{100.0 * same:.3g} % of its stresses under {name} are those of the truth"


def near_truth(errors: Errors, records: xr.Dataset) -> Iterator[str]:
    """Reasons why predictions are too close to the truth to come from a model, each a clause.

    Parameters
    ----------
    errors : of the predictions
    records : the whole dataset of the task
    """
    mse = float((errors.error**2).mean(axis=(1, 2, 3)).min())
    floor = _floor(records)
    if mse < floor:
        yield (
            f"its mean squared error along whole paths, {mse:.2g}, is below {floor:.2g}, the "
            "scatter between packings made alike or a thousandth of a standard deviation"
        )
    elif (left := _left_of_scaled_truth(errors)) < EXTRAORDINARY:
        yield f"it is the records times a factor, up to a mean square of {left:.2g}"
    elif (correlation := _along_the_path(errors.error)) < WHITE:
        yield (
            "its errors look like noise added to the records: those of neighbouring steps have a "
            f"correlation of {correlation:.2g}"
        )


def _floor(records: xr.Dataset) -> float:
    try:
        return max(EXTRAORDINARY, replicate_scatter(records).floor_mse)
    except DatasetError:
        return EXTRAORDINARY


def _left_of_scaled_truth(errors: Errors) -> float:
    """Smallest share, over seeds, of the truth's variance that the predictions do not explain.

    The predictions are scaled by a factor and shifted by a constant for each component.
    """
    axes = (0, 1)
    true = errors.true - errors.true.mean(axis=axes)
    variance = (true**2).mean(axis=axes)
    left = []
    for predicted in np.nan_to_num(errors.predicted):
        centred = predicted - predicted.mean(axis=axes)
        square = (centred**2).mean(axis=axes)
        factor = (centred * true).mean(axis=axes) / np.where(square > 0.0, square, 1.0)
        rest = ((true - factor * centred) ** 2).mean(axis=axes)
        left.append(float((rest / np.where(variance > 0.0, variance, 1.0)).mean()))
    return min(left)


def _along_the_path(error: np.ndarray) -> float:
    """Correlation of the errors (seed, path, step, component) of neighbouring steps."""
    square = (error[:, :, 1:] ** 2).sum() * (error[:, :, :-1] ** 2).sum()
    return float((error[:, :, 1:] * error[:, :, :-1]).sum() / np.sqrt(square)) if square else 1.0


def copied_seeds(one: Errors, other: Errors) -> list[tuple[int, int]]:
    """Pairs of positions of seeds, one of each, whose predictions are those of one model.

    Parameters
    ----------
    one, other : errors of the same paths; may be the same object, then of different seeds
    """
    if one.error.shape[1:] != other.error.shape[1:] or one.paths != other.paths:
        return []
    return [
        (first, second)
        for first in range(len(one.error))
        for second in range(len(other.error))
        if (one is not other or first < second) and _copies(one, first, other, second)
    ]


def _copies(one: Errors, first: int, other: Errors, second: int) -> bool:
    mine, theirs = one.error[first], other.error[second]
    if (one.predicted[first] == other.predicted[second]).mean() > IDENTICAL_SHARE:
        return True
    smaller = min(float((mine**2).mean()), float((theirs**2).mean()))
    return float(((mine - theirs) ** 2).mean()) < CLOSER * smaller


def same_scores(one: Sequence[Score], other: Sequence[Score]) -> bool:
    """Whether two scorecards are of the same model, as far as the errors of its seeds show it.

    Used for rows without predictions. It compares the mean errors along recorded paths, for every
    protocol without noise, split, family and component, of each seed of one with each of the other.
    """
    mine, theirs = _mean_errors(one), _mean_errors(other)
    shared = sorted(mine.keys() & theirs.keys())
    if len(shared) < 3 or not any(value for key in shared for value in mine[key]):
        return False
    first = np.array([mine[key] for key in shared])
    second = np.array([theirs[key] for key in shared])
    size = np.maximum(np.abs(first[:, :, None]), np.abs(second[:, None, :]))
    difference = np.abs(first[:, :, None] - second[:, None, :]) / np.where(size > 0.0, size, 1.0)
    return bool((np.median(difference, axis=0) < SAME_SCORE).any())


def _mean_errors(scores: Sequence[Score]) -> dict[tuple[str, ...], tuple[float, ...]]:
    found: dict[tuple[str, ...], tuple[float, ...]] = {}
    for score in scores:
        metric = find_metric(score.axis, score.metric)
        compared = metric is not None and metric.finds_copies and not _seeded(score)
        if compared and score.status == "scored" and score.by_seed:
            found[score.key] = score.by_seed
    return found


def _seeded(score: Score) -> bool:
    """Whether the seed of a deterministic model changes a score."""
    part = find_part(score.protocol)
    return part is not None and part.seeded


def seeds_score_alike(scores: Sequence[Score]) -> bool:
    """Whether a model gives the same answers for all of its seeds, which then only draw the noise.

    Parameters
    ----------
    scores : of a submission; one seed alone shows nothing, and gives False
    """
    compared = [
        score.by_seed for score in scores if score.status == "scored" and _tells_seeds_apart(score)
    ]
    several = [values for values in compared if len(values) > 1]
    return bool(several) and all(len(set(values)) == 1 for values in several)


def _tells_seeds_apart(score: Score) -> bool:
    axis, metric = find_axis(score.axis), find_metric(score.axis, score.metric)
    timed = metric is not None and metric.tolerance.clock is not None
    return axis is not None and axis.tells_models_apart and not timed and not _seeded(score)
