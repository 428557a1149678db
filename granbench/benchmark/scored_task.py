"""What an axis works on: the records with what the task says of them, and predictions of them."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from granbench.benchmark.metric import NotApplicable, Statistic
from granbench.data.normalisation import Normalisation
from granbench.errors import DatasetError, SubmissionError
from granbench.records.schema import GROUND_TRUTH

if TYPE_CHECKING:
    from granbench.benchmark.axis import Axis, Part
    from granbench.benchmark.task import Task
    from granbench.fem.statement import EmbeddedAnalysis
    from granbench.models.classical import ClassicalCell

NO_GROUND_TRUTH = "this task has no ground-truth cell"


@dataclass(frozen=True)
class ScoredTask:
    """What an evaluation sees of a task: the scored records, their ground truth, the analyses.

    Parameters
    ----------
    records : the scored paths
    analyses : boundary-value problems in which a model takes the place of the ground truth
    """

    records: xr.Dataset
    analyses: "tuple[EmbeddedAnalysis, ...]" = ()

    @classmethod
    def of(cls, records: xr.Dataset, task: "Task | None") -> "ScoredTask":
        """The records under a task; the only place where an evaluation reads a task.

        Parameters
        ----------
        records : the scored paths
        task : gives the analyses and the ground truth; None for the records alone
        """
        from granbench.benchmark.task import with_ground_truth

        return cls(with_ground_truth(records, task), () if task is None else task.analyses)

    @property
    def has_ground_truth(self) -> bool:
        """Whether a model made the records."""
        return GROUND_TRUTH in self.records.attrs

    @cached_property
    def ground_truth(self) -> "ClassicalCell | None":
        """The model that made the records; None where it was not a model.

        Raises
        ------
        DatasetError
            If the records describe no model that there is.
        """
        from granbench.models.ground_truth import ground_truth_cell  # needs torch

        return ground_truth_cell(self.records)

    def require_ground_truth(self) -> "ClassicalCell":
        """The model that made the records.

        Raises
        ------
        DatasetError
            If no model made them.
        """
        if self.ground_truth is None:
            raise DatasetError("the records name no ground truth; use a dataset that a model made")
        return self.ground_truth

    @property
    def components(self) -> list[str]:
        """Labels of the stress components."""
        return [str(label) for label in self.records["component"].values]

    @property
    def name(self) -> str:
        """Name of the dataset, for messages."""
        return str(self.records.attrs.get("dataset", "the dataset"))


@dataclass(frozen=True)
class ScoredPredictions:
    """Predictions with the records that they are compared with.

    Samples and statistics are computed when they are first asked for, and once.

    Parameters
    ----------
    predictions : see `granbench.benchmark.predictions`
    task : its records are in the order of the predicted paths
    normalisation : training standard deviations
    is_truth : whether the predictions are the records, as far as the axes can tell
    """

    predictions: xr.Dataset
    task: ScoredTask
    normalisation: Normalisation
    is_truth: "Callable[[ScoredPredictions], bool]" = lambda scored: True
    _known: dict[tuple[str, ...], Any] = field(default_factory=dict, repr=False, compare=False)

    @property
    def records(self) -> xr.Dataset:
        """The scored records."""
        return self.task.records

    @cached_property
    def reads_records(self) -> bool:
        """Whether the model looks its answers up in the records, as a ceiling does.

        Raises
        ------
        SubmissionError
            If the predictions say so, but are not the records.
        """
        if not self.predictions.attrs.get("reads_records"):
            return False
        if not self.is_truth(self):
            raise SubmissionError(
                "the predictions say that the model reads its answers from the records "
                "(reads_records), but they are not the records; run `granbench evaluate` again"
            )
        return True

    def sample(self, axis: "Axis", part: "Part") -> Any:
        """What the statistics of a protocol, check or solver are computed from, see `Axis.sample`.

        Raises
        ------
        NotApplicable
            If the part does not apply to the task or the model.
        """
        return self._once((axis.name, part.name), lambda: axis.sample(self, part))

    def values(self, axis: "Axis", part: "Part", statistic: Statistic) -> np.ndarray:
        """A statistic of all paths (or analyses), (seed, path) or (seed, path, component).

        Raises
        ------
        NotApplicable
            If it does not exist.
        """
        return self._once(
            (axis.name, part.name, statistic.name),
            lambda: np.asarray(statistic.compute(self.sample(axis, part))),
        )

    def _once(self, key: tuple[str, ...], compute: Callable[[], Any]) -> Any:
        if key not in self._known:
            try:
                self._known[key] = compute()
            except NotApplicable as reason:
                self._known[key] = reason
        found = self._known[key]
        if isinstance(found, NotApplicable):
            raise NotApplicable(*found.args)
        return found
