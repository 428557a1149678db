"""`score`: every axis of the benchmark, from the predictions and the truth alone."""

from collections.abc import Iterator, Sequence

import xarray as xr

from granbench.benchmark.applicability import reads_records
from granbench.benchmark.axes.along_paths.scores import curves, scores_of_split
from granbench.benchmark.axes.cost.scores import cost_scores
from granbench.benchmark.axes.embedded.scores import embedded_scores
from granbench.benchmark.axes.physics.scores import physics_scores, physics_statistics
from granbench.benchmark.metrics import METRIC_VERSION
from granbench.benchmark.protocols import EMBEDDED, PROTOCOLS
from granbench.benchmark.reduction import split_order
from granbench.benchmark.scorecard import ALL, Scales, Score, Scorecard, rounded
from granbench.benchmark.statistics import align, path_statistics
from granbench.benchmark.task import Task, with_ground_truth
from granbench.data.normalisation import Normalisation
from granbench.errors import SubmissionError
from granbench.records.schema import GROUND_TRUTH

NO_ANALYSES = "this task has no boundary-value problem with a ground-truth cell"
NO_TRUTH = "this task has no ground-truth cell"
READS_RECORDS = "the model reads its answers from the records, which have none for noised strain"


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
    truth = align(with_ground_truth(truth, task), predictions)
    analyses = () if task is None else task.analyses
    components = [str(label) for label in truth["component"].values]
    std = normalisation.std
    statistics = path_statistics(predictions, truth, normalisation)
    reads = reads_records(predictions, statistics)
    of_analyses, curves_of_analyses = embedded_scores(
        predictions, truth, normalisation, reads, analyses
    )
    return Scorecard(
        metric_version=METRIC_VERSION,
        normalisation=Scales(
            stress=dict(zip(components, map(rounded, std["stress"]), strict=True)),
            void_ratio=rounded(std["void_ratio"]) if "void_ratio" in std else None,
        ),
        scores=tuple(
            _on_axes(score, task)
            for score in _scores(predictions, truth, statistics, normalisation, of_analyses, reads)
        ),
        curves=(
            *(
                curve
                for curve in curves(statistics)
                if task is None or PROTOCOLS[curve.protocol].axis in task.axes
            ),
            *curves_of_analyses,
        ),
    )


def _scores(
    predictions: xr.Dataset,
    truth: xr.Dataset,
    statistics: xr.Dataset,
    normalisation: Normalisation,
    embedded: Sequence[Score],
    reads: bool,
) -> Iterator[Score]:
    no_truth = None if GROUND_TRUTH in truth.attrs else NO_TRUTH
    physics = physics_statistics(predictions, truth, normalisation, reads)
    no_noised_truth = no_truth or _no_noised_truth(predictions, reads)
    for split in split_order(truth["split"].values.astype(str)):
        yield from scores_of_split(statistics, split, no_noised_truth)
        yield from physics_scores(physics, split)
        if not embedded:
            yield Score(
                axis=EMBEDDED, protocol=EMBEDDED, split=split, metric=ALL,
                status="not_applicable", reason=NO_ANALYSES,
            )  # fmt: skip
    yield from embedded
    yield from cost_scores(predictions, no_truth, reads)


def _on_axes(score: Score, task: Task | None) -> Score:
    """The score, which does not apply if the task leaves its axis out."""
    if task is None or score.axis in task.axes or score.status == "not_applicable":
        return score
    place = score.model_dump(include={"axis", "protocol", "split", "group", "metric", "unit", "n"})
    reason = f"this task does not have the axis {score.axis}"
    return Score(**place, status="not_applicable", reason=reason)


def _no_noised_truth(predictions: xr.Dataset, reads: bool) -> str | None:
    """Why there is no truth for noised strain where there is a ground truth, or None."""
    if reads:
        return READS_RECORDS
    protocols = predictions["protocol"].values if "protocol" in predictions.coords else ()
    noised = predictions["noise"].values if "noise" in predictions.coords else ()
    missing = {name for name in protocols if str(name).startswith("noise")} - set(noised)
    if missing:
        raise SubmissionError(
            f"the predictions lack the ground truth along the strain of {min(missing)}; run "
            "`granbench evaluate` again"
        )
    return None
