"""The axis: one way in which a model is evaluated.

An axis says how it predicts, which variables it writes into the predictions file, its metrics, how
its tables look, what the ground truth scores and how closely a second computation must agree. It
lives in one folder and is registered under the entry-point group `granbench.axes`; see
`granbench.benchmark.registry`. Evaluation, scoring, validation, tables, the board and the
documentation go through the registered axes and name none of them.

Scoring must run without torch, so the module that is registered imports what predicts only inside
of `Axis.predict`.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import xarray as xr

from granbench.benchmark.axis_parts import Group, Highlight, Part, PathSample, Stored
from granbench.benchmark.metric import Metric, NotApplicable
from granbench.benchmark.package_code import package_code
from granbench.benchmark.presentation import BoardView, ModelView, Section, TextTable
from granbench.benchmark.scorecard import ALL, Curve, Score, rounded
from granbench.benchmark.scored_task import ScoredPredictions, ScoredTask

if TYPE_CHECKING:
    from granbench.benchmark.evaluation_run import EvaluationRun
    from granbench.cells.contract import Conditions, MaterialCell


__all__ = ["Axis", "Group", "Highlight", "Part", "PathSample", "Stored"]


class Axis(ABC):
    """One axis of the benchmark, or a family of axes that are predicted and scored alike.

    Attributes
    ----------
    name : as in `Metric.axis`, and for a single axis as in `Score.axis`
    names : the names that can be chosen in an evaluation; several for a family of axes
    title : for people
    order : place in the scorecard and in the tables; an axis of another package comes last
    since : the version of the metrics that brought it
    parts : its protocols, checks or solvers; one named like the axis where there is nothing to tell
        apart
    own_metrics : its metrics, without those of other packages
    layout : variables of the predictions file that it writes
    labels : coordinates that it writes, with the labels that they may have
    json_attributes : global attributes of the predictions file that hold a JSON object
    against_records : whether its errors are zero for the records, and for them alone
    tells_models_apart : whether models with equal scores of every seed are one model
    needs_analyses : whether it applies only to tasks with boundary-value problems
    headline : the score that models are ranked by, whose samples are `PathSample`; None where it is
        on another axis
    highlights : scores for short tables, such as those of the README
    """

    name: str
    title: str
    order: int = 100
    since: str = "1.0"
    parts: tuple[Part, ...] = ()
    own_metrics: tuple[Metric, ...] = ()
    layout: ClassVar[Mapping[str, Stored]] = {}
    labels: ClassVar[Mapping[str, Sequence[str]]] = {}
    json_attributes: tuple[str, ...] = ()
    against_records: bool = False
    tells_models_apart: bool = False
    needs_analyses: bool = False
    headline: Highlight | None = None
    highlights: tuple[Highlight, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """See `Axis`."""
        return (self.name,)

    def metrics(self, components: Sequence[str] | None = None) -> tuple[Metric, ...]:
        """All metrics, those of other packages last.

        Parameters
        ----------
        components : labels of the stress components, which some metrics are given for; None:
            such a metric stays one
        """
        from granbench.benchmark.registry import plugged_in_metrics

        others = tuple(metric for metric in plugged_in_metrics() if metric.axis == self.name)
        found = self.own_metrics + others
        if components is None:
            return found
        return tuple(one for metric in found for one in metric.of_components(components))

    # How it predicts

    def obstacle(self, task: ScoredTask, reads_records: bool = False) -> str | None:
        """Why the axis does not apply to a task or a kind of model, or None.

        Parameters
        ----------
        task : the scored records and the analyses
        reads_records : whether the model looks its answers up in the records
        """
        return None

    @abstractmethod
    def predict(self, run: "EvaluationRun") -> xr.Dataset:
        """What every seed of a model says: variables of `layout` with their coordinates.

        Attributes of the dataset become attributes of the file. What shows in a file that the axis
        was run must be there whatever the model, see `was_run`.

        Parameters
        ----------
        run : the cells, the records, the chosen axes

        Raises
        ------
        ModelError
            If a cell raises an error.
        """

    def rounds(self, chosen: Sequence[str]) -> int:
        """How many times `predict` reports progress for one seed, for the chosen axes."""
        return 1

    def start(
        self, cell: "MaterialCell", task: ScoredTask
    ) -> "tuple[Conditions] | tuple[Conditions, Any] | None":
        """Where a cell starts on this axis, for the check of the cell.

        Returns
        -------
        The conditions, and strain increments where it matters; None where it starts as records do
        """
        return None

    def answers(self, predicted: xr.Dataset) -> list[np.ndarray] | None:
        """What each seed answered, without what the seed itself draws.

        Parameters
        ----------
        predicted : what `predict` returned, or a predictions file

        Returns
        -------
        An array for each seed, equal for seeds that are one model; None where nothing is known
        """
        return None

    # What it writes

    def file_complaints(self, predictions: xr.Dataset) -> Iterator[str]:
        """What is wrong with the variables of a file, beyond names, dimensions and types.

        Values are not read. Names, dimensions and types are checked by `layout` before.
        """
        yield from ()

    def label_complaints(self, predictions: xr.Dataset) -> Iterator[str]:
        """What is wrong with the values of a file's coordinates, beyond `labels`."""
        yield from ()

    # How it scores

    @abstractmethod
    def was_run(self, predictions: xr.Dataset, part: Part) -> bool:
        """Whether predictions hold a part of the axis."""

    def check(self, scored: ScoredPredictions) -> None:
        """Refuse predictions that do not fit the task; called before anything is scored.

        Raises
        ------
        SubmissionError
            If a variable is missing, something else was evaluated than the task asks for, or
            something was left out that applies.
        """
        return

    def is_truth(self, scored: ScoredPredictions) -> bool:
        """Whether the predictions are the records, as far as the axis can tell."""
        return True

    def check_ground_truth(self, scored: ScoredPredictions) -> None:
        """Compute again what the predictions say of the ground truth, and refuse anything else.

        Raises
        ------
        SubmissionError
            If a stored value is not what the ground truth gives.
        """
        return

    @abstractmethod
    def sample(self, scored: ScoredPredictions, part: Part) -> Any:
        """What the statistics of a part are computed from; called only where the part was run.

        Raises
        ------
        NotApplicable
            If the part does not apply to the task or the model.
        """

    @abstractmethod
    def places(self, scored: ScoredPredictions, split: str) -> Iterable[tuple[Part, Group]]:
        """The parts and groups of a split that have scores, in the order of the scorecard.

        Parameters
        ----------
        scored : the predictions
        split : one of the records, or "all" for scores that belong to no split
        """

    def scores(self, scored: ScoredPredictions, split: str) -> Iterator[Score]:
        """Every score of a split, in the order of the scorecard.

        Parameters
        ----------
        scored : the predictions, after `check`
        split : one of the records, or "all" for scores that belong to no split
        """
        metrics = self.metrics(scored.task.components)
        for part, group in self.places(scored, split):
            for metric in metrics:
                if metric.applies_to(part) and (group.name == ALL or metric.by_group):
                    yield self.score(scored, part, metric, group)

    def score(self, scored: ScoredPredictions, part: Part, metric: Metric, group: Group) -> Score:
        """One score: a value with its interval, or the reason why there is none."""
        place: dict[str, Any] = {
            "axis": part.axis, "protocol": part.name, "split": group.split, "group": group.name,
            "metric": metric.name, "unit": metric.unit, "n": group.n,
        }  # fmt: skip
        if not self.was_run(scored.predictions, part):
            reason = f"axis {part.axis} was left out of the evaluation"
            return Score(**place, status="not_run", reason=reason)
        try:
            scored.sample(self, part)  # code of the axis, not of the metric
            with package_code(f"metric {metric.name!r}", metric.package):
                values = scored.values(self, part, metric.statistic)
                if metric.component is not None:
                    values = values[..., metric.component]
                values = values[:, group.rows]
                found = metric.estimate(values)
                low, high = (None, None) if found is None else group.interval(metric, values)
        except NotApplicable as reason:
            return Score(**place, status="not_applicable", reason=str(reason))
        if found is None:
            return Score(**place, status="not_applicable", reason=metric.undefined)
        value, by_seed = found
        return Score(
            **place,
            status="scored",
            value=rounded(value),
            low=low,
            high=high,
            by_seed=tuple(rounded(single) for single in by_seed),
        )

    def curves(self, scored: ScoredPredictions) -> Iterator[Curve]:
        """Errors against steps, where the axis has such curves."""
        yield from ()

    def lost_results(self, scores: Sequence[Score]) -> set[tuple[str, str]]:
        """Protocol and group of results that rounding decides, so that no digit comes out again.

        Parameters
        ----------
        scores : of one model, recomputed ones: a claim may not excuse others
        """
        return set()

    # How it is shown

    def text_tables(self, model: ModelView, split: str) -> Iterator[TextTable | str]:
        """Tables and sentences for the terminal.

        Parameters
        ----------
        model : the scores of one model, without those that were not run
        split : one of the records, or "all" for what belongs to no split
        """
        from granbench.benchmark.standard_tables import text_tables

        yield from text_tables(self, model, split)

    def board_sections(self, board: BoardView) -> Iterator[Section]:
        """Tables and charts of several models on a task's page; nothing where no model was run."""
        from granbench.benchmark.standard_tables import board_sections

        yield from board_sections(self, board)

    def glossary(self, board: BoardView) -> Iterator[tuple[str, str]]:
        """Terms on the page of a task, and their definitions in one sentence."""
        from granbench.benchmark.standard_tables import glossary

        yield from glossary(self, board)

    def section(self) -> str:
        """The section of docs/scoring.md, in Markdown; the heading first."""
        from granbench.benchmark.standard_tables import section

        return section(self)

    def measured_tables(self, models: Sequence[ModelView]) -> dict[str, str]:
        """Tables of a few models for the section, in Markdown, by the name of their marker.

        The text stands in the section between ``<!-- NAME:begin -->`` and ``<!-- NAME:end -->``.
        """
        return {}
