"""The task: what a model is scored on.

A task names a dataset and says which splits of it are for training, validation and test, what a
model is given at the start of a path, which axes are scored, in which boundary-value problems the
model takes the place of the ground truth, and what it may be trained on. One dataset can serve
several tasks. `granbench.benchmark.task_registry.find_task` finds a task by its name.
"""

import json
from collections.abc import Iterable, Mapping
from typing import Annotated, Any

import numpy as np
import xarray as xr
from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator

from granbench.benchmark.predictions import evaluated
from granbench.benchmark.registry import axes, axis_names, chosen_axes, plugged_in_axes
from granbench.data.normalisation import Normalisation
from granbench.data.splits import split_names
from granbench.errors import ConfigurationError, DatasetError
from granbench.fem.statement import EmbeddedAnalysis
from granbench.records.schema import GROUND_TRUTH, INTERNALS

FIRST_VERSION = "1.0.0"
TRAIN, VALIDATION, TEST, OOD = "train", "validation", "test", "ood-"
"""Names of the splits in `Task.view`; a split out of distribution begins with the last one."""

Line = Annotated[
    str, StringConstraints(min_length=1, max_length=400, pattern=r"^[^\x00-\x1f\x7f-\x9f]+$")
]
Names = Annotated[tuple[Line, ...], Field(min_length=1)]
Sha256 = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]
Version = Annotated[str, StringConstraints(pattern=r"^\d+\.\d+\.\d+$")]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class TaskDataset(_Part):
    """The records of a task, to the last bit.

    Parameters
    ----------
    name, version : as in the registry of datasets, or as the file names itself
    content_sha256 : hash of the values, see `granbench.records.content_hashes`
    file : netCDF file beside the task's YAML file, for a dataset that is not registered
    """

    name: Line
    version: Line
    content_sha256: Sha256
    file: Line | None = None


class Splits(_Part):
    """Splits of the dataset by what they are for; a split that is not listed is not used.

    Parameters
    ----------
    training, validation : for the weights, and for the choice among trained models
    test, ood : for the scores: paths of the kind that was trained on, and of other kinds
    """

    training: Names
    validation: tuple[Line, ...] = ()
    test: tuple[Line, ...] = ()
    ood: tuple[Line, ...] = ()

    @property
    def scored(self) -> tuple[str, ...]:
        """The splits that models are scored on."""
        return (*self.test, *self.ood)

    def roles(self) -> dict[str, str]:
        """Name of each listed split in `Task.view`, by its name in the file."""
        return (
            dict.fromkeys(self.training, TRAIN)
            | dict.fromkeys(self.validation, VALIDATION)
            | dict.fromkeys(self.test, TEST)
            | {name: name if name.startswith(OOD) else f"{OOD}{name}" for name in self.ood}
        )

    @model_validator(mode="after")
    def _check(self) -> "Splits":
        listed = [*self.training, *self.validation, *self.scored]
        if twice := [name for name in listed if listed.count(name) > 1]:
            raise ValueError(f"split {twice[0]!r} is listed twice; list each split once")
        if not self.scored:
            raise ValueError("test and ood are both empty; name a split to score models on")
        return self


class TruthModel(_Part):
    """The classical model that made the records.

    Parameters
    ----------
    model : name of the law, see `granbench models`
    parameters : by name, SI units
    parameter_set : published set that `parameters` replace some values of; None: all are given
    units : by parameter name, checked against the law; may be left out
    """

    model: Line
    parameters: Mapping[str, float] = {}
    parameter_set: Line | None = None
    units: Mapping[str, str] = {}

    def as_attribute(self) -> str:
        """The text of the attribute `ground_truth` of a dataset."""
        return json.dumps(self.model_dump(mode="json", exclude_defaults=True))


class TrainingData(_Part):
    """Records that a model may be trained on.

    Parameters
    ----------
    dataset, version : as in the registry of datasets
    splits : those that are allowed
    """

    dataset: Line
    version: Line
    splits: Names


class Task(_Part):
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
        known = axis_names()
        if unknown := [name for name in self.axes if name not in known]:
            raise ValueError(f"axes: unknown axis {unknown[0]!r}; use {', '.join(known)}")
        analysed = axes_with_analyses()
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
        except ValueError as error:
            raise DatasetError(f"{file or name}: {complaint(error)}") from error

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
        unused = self._unused_context(records)
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

    def _unused_context(self, records: xr.Dataset) -> list[str]:
        """Constants of the specimen that the records have and the context does not list."""
        given = context_of(records)
        if missing := [name for name in self.context if name not in given]:
            raise DatasetError(
                f"task {self.id}: context: {self.dataset.name} has no {missing[0]!r} at the start "
                f"of a path; it has {', '.join(given)}"
            )
        left_out = [name for name in given if name not in self.context]
        if always := [name for name in left_out if name not in records.coords or _starts(name)]:
            raise DatasetError(
                f"task {self.id}: context: lacks {always[0]!r}, which every model is given; add it"
            )
        return left_out


def axes_with_analyses() -> list[str]:
    """Names of the axes that need analyses."""
    return [name for axis in axes() if axis.needs_analyses for name in axis.names]


def with_ground_truth(records: xr.Dataset, task: Task | None) -> xr.Dataset:
    """The records with the ground truth of a task; as they are without one."""
    if task is None:
        return records
    if task.ground_truth is not None:
        return records.assign_attrs({GROUND_TRUTH: task.ground_truth.as_attribute()})
    without = records.copy()
    without.attrs.pop(GROUND_TRUTH, None)
    return without


def context_of(records: xr.Dataset) -> tuple[str, ...]:
    """Quantities that records give to a model at the start of a path."""
    from granbench.data.adapters import SPECIMEN_SCALARS

    void_ratio = ["initial_void_ratio"] if "void_ratio" in records else []
    return (
        "stress",
        "initial_mean_stress",
        *void_ratio,
        *(name for name in INTERNALS if name in records),
        *(name for name in SPECIMEN_SCALARS if name in records.coords),
    )


def complaint(error: ValueError) -> str:
    """The first thing that is wrong with a task: the field, and what it must be."""
    errors = getattr(error, "errors", None)
    if errors is None:
        return str(error)
    first = errors()[0]
    field = ".".join(map(str, first["loc"]))
    text = first["msg"].removeprefix("Value error, ")
    return f"{field}: {text}" if field else text


def _starts(name: str) -> bool:
    return name.startswith("initial_")


def _ground_truth_of(records: xr.Dataset) -> dict[str, Any]:
    try:
        stated = json.loads(str(records.attrs[GROUND_TRUTH]))
        return {name: stated[name] for name in TruthModel.model_fields if name in stated}
    except (ValueError, TypeError) as error:
        raise DatasetError(
            f"{records.attrs.get('dataset', 'the dataset')}: its attribute {GROUND_TRUTH!r} is not "
            "a JSON object with a model and its parameters; fetch or generate the dataset again"
        ) from error
