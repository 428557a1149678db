"""Parts of a task: its dataset, its splits, its ground truth, and what it may be trained on."""

import json
import re
from collections.abc import Mapping
from typing import Annotated

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    model_validator,
)

TRAIN, VALIDATION, TEST, OOD = "train", "validation", "test", "ood-"
"""Names of the splits in `Task.view`; a split out of distribution begins with the last one."""

SHOWN = 60
"""Characters of a wrong value that an error shows."""

LONGEST_LINE = 400


def _line(text: str) -> str:
    if not text:
        raise ValueError("the text is empty; write one")
    if len(text) > LONGEST_LINE:
        raise ValueError(f"the text has more than {LONGEST_LINE} characters; shorten it")
    if re.search(r"[\x00-\x1f\x7f-\x9f]", text):
        raise ValueError(
            "the text has a line break or another control character; write it on one line"
        )
    return text


def _some(names: tuple[str, ...]) -> tuple[str, ...]:
    if not names:
        raise ValueError("the list is empty; add at least one name")
    return names


def _version(value: object) -> object:
    if isinstance(value, str) and re.fullmatch(r"[0-9]+\.[0-9]+\.[0-9]+", value):
        return value
    raise ValueError(f"{str(value)[:SHOWN]!r} must be three numbers, such as 1.0.0")


def _sha256(value: object) -> object:
    if isinstance(value, str) and re.fullmatch(r"[0-9a-f]{64}", value):
        return value
    raise ValueError("must be the 64 digits and letters (a to f) of a SHA-256 hash, in quotes")


Line = Annotated[str, AfterValidator(_line)]
Names = Annotated[tuple[Line, ...], AfterValidator(_some)]
Sha256 = Annotated[str, BeforeValidator(_sha256)]
Version = Annotated[str, BeforeValidator(_version)]


class TaskPart(BaseModel):
    """A part of a task, which never changes and has no other fields than those stated."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class TaskDataset(TaskPart):
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


class Splits(TaskPart):
    """Splits of the dataset by what they are for; a split that is not listed is not used.

    Parameters
    ----------
    training, validation : for the weights, and for the choice among trained models
    test, ood : for the scores: paths of the kind that was trained on, and of other kinds; one of
        the two may be empty
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


class TruthModel(TaskPart):
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
        content = self.model_dump(mode="json", exclude_defaults=True)
        content.setdefault("parameters", {})
        return json.dumps(content)


class TrainingData(TaskPart):
    """Records that a model may be trained on.

    Parameters
    ----------
    dataset, version : as in the registry of datasets
    splits : those that are allowed
    """

    dataset: Line
    version: Line
    splits: Names
