"""`score`: every registered axis, from the predictions and the truth alone."""

from collections.abc import Iterator
from functools import partial

import xarray as xr

from granbench.benchmark.axis import Axis
from granbench.benchmark.comparison import align
from granbench.benchmark.metric import METRIC_VERSION
from granbench.benchmark.registry import axes, axis_code, find_part, of_every_axis, plugged_in_axes
from granbench.benchmark.scorecard import ALL, Curve, Scales, Score, Scorecard, rounded
from granbench.benchmark.scored_task import ScoredPredictions, ScoredTask
from granbench.benchmark.task import Task
from granbench.data.normalisation import Normalisation
from granbench.data.splits import split_names


def scored_predictions(
    predictions: xr.Dataset,
    truth: xr.Dataset,
    normalisation: Normalisation,
    task: Task | None = None,
) -> ScoredPredictions:
    """Predictions with the records that they are compared with; arguments as of `score`.

    Raises
    ------
    SubmissionError
        If the predictions do not fit the records.
    """
    return ScoredPredictions(
        predictions,
        ScoredTask.of(align(truth, predictions), task),
        normalisation,
        lambda scored: all(of_every_axis(lambda axis: [axis.is_truth(scored)])),
    )


def score(
    predictions: xr.Dataset,
    truth: xr.Dataset,
    normalisation: Normalisation,
    task: Task | None = None,
) -> Scorecard:
    """Score predictions against the records.

    Parameters
    ----------
    predictions : see `granbench.benchmark.predictions`
    truth : the records of exactly the predicted paths
    normalisation : training standard deviations
    task : gives the embedded analyses, the ground truth and the axes; None for the records alone,
        which have no analyses

    Raises
    ------
    SubmissionError
        If the predictions do not fit the records.
    """
    scored = scored_predictions(predictions, truth, normalisation, task)
    for axis in axes():
        with axis_code(axis):
            axis.check(scored)
    splits = (*split_names(scored.records), ALL)
    std = normalisation.std
    return Scorecard(
        metric_version=METRIC_VERSION,
        normalisation=Scales(
            stress=dict(zip(scored.task.components, map(rounded, std["stress"]), strict=True)),
            void_ratio=rounded(std["void_ratio"]) if "void_ratio" in std else None,
        ),
        scores=tuple(
            _of_task(score, task)
            for split in splits
            for score in of_every_axis(partial(_scores, scored, split))
        ),
        curves=tuple(
            curve
            for curve in of_every_axis(lambda axis: axis.curves(scored))
            if _is_of_task(curve, task)
        ),
    )


def _scores(scored: ScoredPredictions, split: str, axis: Axis) -> Iterator[Score]:
    return axis.scores(scored, split)


def _of_task(score: Score, task: Task | None) -> Score:
    """The score, which does not apply if the task leaves its axis out.

    An axis of another package is part of no task; where it was run, its scores are kept.
    """
    if task is None or score.axis in task.axes or score.status == "not_applicable":
        return score
    if score.status == "scored" and score.axis in plugged_in_axes():
        return score
    place = score.model_dump(include={"axis", "protocol", "split", "group", "metric", "unit", "n"})
    reason = f"this task does not have the axis {score.axis}"
    return Score(**place, status="not_applicable", reason=reason)


def _is_of_task(curve: Curve, task: Task | None) -> bool:
    part = find_part(curve.protocol)
    return task is None or part is None or part.axis in {*task.axes, *plugged_in_axes()}
