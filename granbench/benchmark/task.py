"""The task: what a model is scored on.

A task names a dataset and says which splits of it are for training, validation and test, what a
model is given at the start of a path, which axes are scored, in which boundary-value problems the
model takes the place of the ground truth, and what it may be trained on. One dataset can serve
several tasks. `granbench.benchmark.task_registry.find_task` finds a task by its name.
"""

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import xarray as xr
from pydantic import ValidationError, model_validator

from granbench.benchmark.axis import Axis
from granbench.benchmark.predictions import evaluated
from granbench.benchmark.registry import axes, axes_for, axis_names, chosen_axes, plugged_in_axes
from granbench.benchmark.task_context import context_of, unused_context
from granbench.benchmark.task_parts import (
    OOD,
    TEST,
    TRAIN,
    VALIDATION,
    Line,
    Names,
    Splits,
    TaskDataset,
    TaskPart,
    TrainingData,
    TruthModel,
    Version,
)
from granbench.data.normalisation import Normalisation
from granbench.data.splits import MissingSplitError, split_names
from granbench.errors import ConfigurationError, DatasetError
from granbench.fem.statement import EmbeddedAnalysis
from granbench.files.validation import first_fault
from granbench.records.schema import GROUND_TRUTH

FIRST_VERSION = "1.0.0"


class Task(TaskPart):
    """What a model is scored on; a published version never changes.

    Parameters
    ----------
    id, version : the name, and a semantic version
    summary : one sentence for people
    dataset : the records
    splits : what each split is for
    context : quantities that a model is given at the start of a path: `stress`,
        `initial_mean_stress`, internal variables, and constants of the specimen
    axes : the axes that are scored, see `granbench.benchmark.registry.axis_names`
    analyses : boundary-value problems of the axis `embedded`
    ground_truth : the model that made the records; None for measured or simulated ones
    training_data : all that a model may be trained on
    """

    id: Line
    version: Version
    summary: Line
    dataset: TaskDataset
    splits: Splits
    context: Names
    axes: Names
    analyses: tuple[EmbeddedAnalysis, ...] = ()
    ground_truth: TruthModel | None = None
    training_data: tuple[TrainingData, ...]

    @model_validator(mode="after")
    def _check(self) -> "Task":
        needed = axes_for(self.axes)
        known = [name for axis in needed for name in axis.names]
        if unknown := [name for name in self.axes if name not in known]:
            raise ValueError(f"axes: unknown axis {unknown[0]!r}; use {', '.join(known)}")
        analysed = axes_with_analyses(needed)
        if any(name in self.axes for name in analysed) != bool(self.analyses):
            raise ValueError(
                f"axes and analyses: the axis {', '.join(analysed)} needs analyses, and analyses "
                "need the axis; give both or neither"
            )
        if self.analyses and self.ground_truth is None:
            raise ValueError("ground_truth: is missing, but the analyses are compared with it")
        names = [analysis.name for analysis in self.analyses]
        if len(set(names)) < len(names):
            raise ValueError(f"analyses: two have one name ({', '.join(names)}); rename one")
        if len({(analysis.outputs, analysis.points) for analysis in self.analyses}) > 1:
            raise ValueError(
                "analyses: outputs and points must be the same for all, because the results are "
                "stored in one array"
            )
        for at, data in enumerate(self.training_data):
            scored = [name for name in data.splits if name in self.splits.scored]
            if data.dataset == self.dataset.name and scored:
                raise ValueError(
                    f"training_data.{at}.splits: models are scored on {scored[0]!r}; leave it out"
                )
        return self

    @classmethod
    def of_records(cls, records: xr.Dataset, file: str | None = None) -> "Task":
        """The task of a file of records alone: its splits, and no analyses.

        Parameters
        ----------
        records : the whole dataset
        file : where it lies

        Raises
        ------
        DatasetError
            If there is nothing to train or to score on, or an attribute is damaged.
        """
        name, version = (str(records.attrs.get(key, "")) for key in ("dataset", "version"))
        found = split_names(records)
        left_out = {*axes_with_analyses(), *plugged_in_axes()}
        fields: dict[str, Any] = {
            "id": name,
            "version": FIRST_VERSION,
            "summary": f"The records of {name} {version}",
            "dataset": {
                "name": name, "version": version, "file": file,
                "content_sha256": str(records.attrs.get("content_sha256", "")),
            },
            "splits": {
                "training": [split for split in found if split == TRAIN],
                "validation": [split for split in found if split == VALIDATION],
                "test": [split for split in found if split == TEST],
                "ood": [split for split in found if split.startswith(OOD)],
            },
            "context": context_of(records),
            "axes": [name for name in axis_names() if name not in left_out],
            "training_data": [
                {"dataset": name, "version": version,
                 "splits": [split for split in found if split in (TRAIN, VALIDATION)]},
            ],
        }  # fmt: skip
        if GROUND_TRUTH in records.attrs:
            fields["ground_truth"] = _ground_truth_of(records)
        try:
            return cls.model_validate(fields)
        except ValidationError as error:
            raise DatasetError(f"{file or name}: {first_fault(error)}") from error

    def chosen_axes(self, names: Iterable[str]) -> tuple[str, ...]:
        """The named axes, in the order of the benchmark.

        An axis that another package registers can be named for any task.

        Raises
        ------
        ConfigurationError
            If the task does not have one of them; the text lists those it has.
        """
        chosen = chosen_axes(names)
        allowed = {*self.axes, *plugged_in_axes()}
        if missing := [name for name in chosen if name not in allowed]:
            raise ConfigurationError(
                f"task {self.id} has no axis {missing[0]!r}; it has {', '.join(self.axes)}"
            )
        return chosen

    def view(self, records: xr.Dataset) -> xr.Dataset:
        """The records as the task uses them.

        Paths of splits that the task does not list are left out, the others are called `train`,
        `validation`, `test` and `ood-...`; constants of the specimen that are not part of the
        context are dropped; the attribute `ground_truth` is that of the task.

        Raises
        ------
        DatasetError
            If the records are not the dataset of the task, lack a split, or give another context.
        """
        self._require_dataset(records)
        split, roles = records["split"].values.astype(str), self.splits.roles()
        for name in roles:
            if name not in split:
                raise DatasetError(
                    f"task {self.id}: splits: {self.dataset.name} {self.dataset.version} has no "
                    f"split {name!r}; it has {', '.join(split_names(records))}"
                )
        for data in self.training_data:
            own = (data.dataset, data.version) == (self.dataset.name, self.dataset.version)
            if own and (missing := [name for name in data.splits if name not in split]):
                raise DatasetError(
                    f"task {self.id}: training_data: {data.dataset} {data.version} has no split "
                    f"{missing[0]!r}; it has {', '.join(split_names(records))}"
                )
        unused = unused_context(records, self.context, self.id)
        found = records.drop_vars(unused)
        if set(roles) != set(split):
            found = found.isel(path=np.flatnonzero(np.isin(split, list(roles))))
        if any(name != role for name, role in roles.items()):
            names = [roles[name] for name in found["split"].values.astype(str)]
            named = xr.Variable("path", np.asarray(names, dtype=object), found["split"].attrs)
            found = found.assign_coords(split=named)
        return with_ground_truth(found, self)

    def scored(self, records: xr.Dataset) -> xr.Dataset:
        """The paths of the whole dataset that models are scored on; see `view`."""
        return evaluated(self.view(records))

    def trainable(self, records: xr.Dataset) -> xr.Dataset:
        """The paths of the whole dataset that a model may see while it is trained; see `view`.

        Raises
        ------
        DatasetError
            If the task does not allow training on its own records.
        """
        listed = (*self.splits.training, *self.splits.validation)
        allowed = {
            name
            for data in self.training_data
            if (data.dataset, data.version) == (self.dataset.name, self.dataset.version)
            for name in data.splits
        }
        if refused := [name for name in listed if name not in allowed]:
            may = "; ".join(
                f"{data.dataset} {data.version}, {', '.join(data.splits)}"
                for data in self.training_data
            )
            raise DatasetError(
                f"task {self.id}: training_data does not allow the split {refused[0]!r} of "
                f"{self.dataset.name} {self.dataset.version}; it allows {may or 'no data'}"
            )
        view = self.view(records)
        seen = np.isin(view["split"].values.astype(str), (TRAIN, VALIDATION))
        return view.isel(path=np.flatnonzero(seen))

    @contextmanager
    def naming_missing_splits(self) -> Iterator[None]:
        """Say that the task lists no split for validation where training fails without one.

        Raises
        ------
        DatasetError
            In place of the error about the dataset.
        """
        try:
            yield
        except MissingSplitError as error:
            if error.split != VALIDATION or self.splits.validation:
                raise
            raise DatasetError(
                f"task {self.id}: splits.validation is empty, but this model is trained with a "
                "validation split; list one in the task"
            ) from error

    def normalisation(self, records: xr.Dataset) -> Normalisation:
        """Means and standard deviations of the training splits of the whole dataset."""
        return Normalisation.from_training(self.view(records))

    def _require_dataset(self, records: xr.Dataset) -> None:
        wanted = {
            "dataset": self.dataset.name,
            "version": self.dataset.version,
            "content_sha256": self.dataset.content_sha256,
        }
        for name, value in wanted.items():
            found = str(records.attrs.get(name))
            if found != value:
                field = {"dataset": "name"}.get(name, name)
                raise DatasetError(
                    f"task {self.id}: dataset.{field} is {value}, but the records have {found}; "
                    "give the dataset that the task names, or correct the task"
                )


def axes_with_analyses(among: Iterable[Axis] | None = None) -> list[str]:
    """Names of the axes that need analyses.

    Parameters
    ----------
    among : axes to search; None for all that are registered
    """
    searched = axes() if among is None else among
    return [name for axis in searched if axis.needs_analyses for name in axis.names]


def with_ground_truth(records: xr.Dataset, task: Task | None) -> xr.Dataset:
    """The records with the ground truth of a task; as they are without one."""
    if task is None:
        return records
    if task.ground_truth is not None:
        return records.assign_attrs({GROUND_TRUTH: task.ground_truth.as_attribute()})
    without = records.copy()
    without.attrs.pop(GROUND_TRUTH, None)
    return without


def _ground_truth_of(records: xr.Dataset) -> dict[str, Any]:
    try:
        stated = json.loads(str(records.attrs[GROUND_TRUTH]))
        return {name: stated[name] for name in TruthModel.model_fields if name in stated}
    except (ValueError, TypeError) as error:
        raise DatasetError(
            f"{records.attrs.get('dataset', 'the dataset')}: its attribute {GROUND_TRUTH!r} is not "
            "a JSON object with a model and its parameters; fetch or generate the dataset again"
        ) from error
