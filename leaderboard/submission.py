"""The submission: one JSON file with the scores of a model and what is needed to check them."""

import hashlib
import json
import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    StringConstraints,
    ValidationError,
    model_validator,
)

from granbench.benchmark.scorecard import Curve, Scales, Score
from granbench.errors import ConfigurationError, SubmissionError
from granbench.files.json_reading import LARGEST_INTEGER, read_json_object
from granbench.files.whole_file import whole_file

SCHEMA_FILE = Path(__file__).parent / "submission.schema.json"

Sha256 = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]
Line = Annotated[
    str, StringConstraints(min_length=1, max_length=400, pattern=r"^[^\x00-\x1f\x7f-\x9f]+$")
]
Word = Annotated[
    str, StringConstraints(min_length=1, max_length=100, pattern=r"^[^\x00-\x1f\x7f-\x9f]+$")
]
BaselineName = Annotated[str, StringConstraints(max_length=64, pattern=r"^[a-z0-9][a-z0-9-]*$")]
Seed = Annotated[int, Field(ge=0, le=LARGEST_INTEGER)]
MOST_SEEDS = 100
MOST_AUTHORS = 100
MOST_FILES = 3 * MOST_SEEDS
MOST_SCORES = 20_000
"""The largest task has about 1,000 scores."""


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class DatasetReference(_Record):
    """The dataset that was scored on, to the last bit."""

    name: Line
    version: Annotated[str, StringConstraints(pattern=r"^\d+\.\d+\.\d+(\+[0-9A-Za-z.-]+)?$")]
    content_sha256: Sha256 = Field(description="hash of its values")
    split_sha256: Sha256 = Field(description="hash of its frozen split")


class PredictionsReference(_Record):
    """The predictions file beside the submission."""

    file: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*\.nc$")] = Field(
        description="name only, the file lies in the same folder"
    )
    sha256: Sha256
    bytes: int = Field(gt=0)


class ModelFile(_Record):
    """One file of a model that lies beside the submission; it holds data, no code."""

    path: Annotated[
        str,
        StringConstraints(
            pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*(/\d+)?/[a-z]+\.(json|safetensors)$"
        ),
    ] = Field(description="from the submission's folder: NAME.model/[SEED/]FILE")
    seed: Seed | None = Field(default=None, description="whose it is; null: of every seed")
    sha256: Sha256
    bytes: int = Field(gt=0, le=50_000_000)


class ModelReference(_Record):
    """The model itself, which validation runs again: only data and GranBench's own code.

    Either the parameters of a classical model, one file; or a baseline of GranBench, with the
    files of every seed where it was trained.
    """

    baseline: (
        Annotated[str, StringConstraints(max_length=64, pattern=r"^[a-z0-9][a-z0-9-]*$")] | None
    ) = Field(default=None, description="name of a baseline of GranBench; null: a classical model")
    files: tuple[ModelFile, ...] = Field(default=(), max_length=MOST_FILES)

    @model_validator(mode="after")
    def _whole(self) -> "ModelReference":
        if self.baseline is None and [file.seed for file in self.files] != [None]:
            raise ValueError("without a baseline it needs one parameter file, of every seed")
        if self.baseline is not None and any(file.seed is None for file in self.files):
            raise ValueError("every file of a trained baseline needs its seed")
        if len({file.path for file in self.files}) < len(self.files):
            raise ValueError("a file is named twice")
        return self


class Environment(_Record):
    """What the model ran in; no host names."""

    granbench: Word
    python: Word
    numpy: Word
    torch: Word
    machine: Word = Field(description="kind of machine")

    @classmethod
    def here(cls) -> "Environment":
        """This process' environment."""
        return cls(
            granbench=_version("granbench"),
            python=platform.python_version(),
            numpy=_version("numpy"),
            torch=_version("torch"),
            machine=f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
        )


class Acceptance(_Record):
    """What the board recorded when it accepted a row."""

    digest: Sha256 = Field(
        description="of the row and of the files that its scores rest on; checked when the site is "
        "built"
    )
    word: Line | None = Field(
        default=None, description="why a maintainer accepted what the checks had flagged"
    )


class About(_Record):
    """What a submitter states about a model."""

    name: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9 ._+-]{0,63}$")]
    title: Line | None = Field(default=None, description="one line about the model")
    role: Literal["model", "floor", "ceiling"] = Field(
        default="model", description="floors and ceilings frame the table and are not ranked"
    )
    authors: tuple[Line, ...] = Field(min_length=1, max_length=MOST_AUTHORS)
    code: (
        Annotated[
            str, StringConstraints(max_length=400, pattern=r"^https?://[^\s\x00-\x1f\x7f-\x9f]+$")
        ]
        | None
    ) = Field(default=None, description="where the model's code is")
    parameters: int | None = Field(
        default=None, ge=0, le=LARGEST_INTEGER, description="trained or fitted parameters"
    )
    training_data: Line
    licence: Line
    command: Line

    @classmethod
    def checked(cls, **fields: Any) -> "About":
        """The same from fields, with a one-sentence error.

        Raises
        ------
        ConfigurationError
            If a field does not follow the schema.
        """
        try:
            return cls(**fields)
        except ValidationError as error:
            raise ConfigurationError(f"the submission's {first_complaint(error)}") from error


class Submission(About):
    """A row of the leaderboard, with everything needed to check it."""

    schema_version: Literal["1.0", "1.1", "1.2"] = "1.2"
    metric_version: Word
    task: Line
    task_version: Annotated[str, StringConstraints(pattern=r"^\d+\.\d+\.\d+$")] | None = Field(
        default=None, description="version of the task; null: 1.0.0"
    )
    dataset: DatasetReference
    seeds: tuple[Seed, ...] = Field(min_length=1, max_length=MOST_SEEDS)
    deterministic: bool | None = Field(
        default=None,
        description="true: one and the same model under every seed, which only draws the noise",
    )
    environment: Environment
    predictions: PredictionsReference | None = Field(
        default=None, description="or else `model`; one of the two is the evidence for the scores"
    )
    model: ModelReference | None = None
    badge: Literal["claimed", "rescored", "rerun"] = Field(
        default="claimed",
        description="as submitted; recomputed from the predictions; run again by the maintainers",
    )
    normalisation: Scales
    scores: tuple[Score, ...] = Field(min_length=1, max_length=MOST_SCORES)
    curves: tuple[Curve, ...] = Field(default=(), max_length=MOST_SCORES)
    acceptance: Acceptance | None = None

    @property
    def board(self) -> tuple[str, str]:
        """Name and version of the board page that shows it: of its task and its dataset."""
        version = self.dataset.version
        return self.task, version if self.task_version is None else (
            f"{version}+task.{self.task_version}"
        )

    @model_validator(mode="after")
    def _has_evidence(self) -> "Submission":
        if (self.predictions is None) == (self.model is None):
            raise ValueError("it needs either `predictions` or `model` as evidence for its scores")
        return self

    @model_validator(mode="after")
    def _nothing_twice(self) -> "Submission":
        for what, keys in (
            ("seed", list(self.seeds)),
            ("score", [score.key for score in self.scores]),
            ("curve", [curve.key for curve in self.curves]),
        ):
            seen: set[Any] = set()
            for key in keys:
                if key in seen:
                    text = " / ".join(key) if isinstance(key, tuple) else str(key)
                    raise ValueError(f"{what} {text} appears more than once")
                seen.add(key)
        return self


def read_submission(path: Path) -> Submission:
    """Read a submission file strictly.

    Raises
    ------
    SubmissionError
        If it is missing, is refused by `granbench.files.json_reading.read_json`, or breaks the
        schema.
    """
    content = read_json_object(path, SubmissionError, remedy=_REMEDY)
    try:
        return Submission.model_validate(content)
    except ValidationError as error:
        raise SubmissionError(f"{path}: {first_complaint(error)}") from error


_REMEDY = "give the file that `granbench evaluate` wrote"


def write_submission(submission: Submission, path: Path) -> None:
    """Write a submission under a temporary name, then rename it; one score a line.

    Raises
    ------
    SubmissionError
        If the folder cannot be written to.
    """
    content = submission.model_dump(mode="json", exclude_none=True)
    parts = []
    for key, value in content.items():
        if key in ("scores", "curves"):
            rows = ",\n".join(
                "    " + json.dumps(row, ensure_ascii=False, allow_nan=False) for row in value
            )
            rendered = f"[\n{rows}\n  ]" if rows else "[]"
        else:
            rendered = json.dumps(value, ensure_ascii=False, allow_nan=False, indent=2)
            rendered = rendered.replace("\n", "\n  ")
        parts.append(f"  {json.dumps(key)}: {rendered}")
    with whole_file(path, SubmissionError) as partial:
        partial.write_text("{\n" + ",\n".join(parts) + "\n}\n", encoding="utf-8")


def schema_text() -> str:
    """The published JSON Schema of a submission."""
    schema = Submission.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "GranBench submission"
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def file_digest(path: Path) -> str:
    """SHA-256 of a file's bytes, hexadecimal."""
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def first_complaint(error: ValidationError) -> str:
    """The first error that pydantic found: the field and what is wrong with it."""
    first = error.errors()[0]
    place = ".".join(str(part) for part in first["loc"])
    message = first["msg"].removeprefix("Value error, ")
    if first["type"] in ("model_type", "dict_type"):  # pydantic names Python types here
        message = "must be a JSON object"
    more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
    return f"field {place}: {message}{more}" if place else f"{message}{more}"
