"""Boundary-value problems as datasets state them: what is analysed, on which mesh, in which way.

A dataset of Gauss-point histories says in its global attribute `EMBEDDED_ANALYSES` in which
problems a model is to take the place of its ground truth. Reading that needs neither torch nor
finite elements, so that scoring can do without.
"""

import json
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
import xarray as xr
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from granbench.errors import DatasetError

EMBEDDED_ANALYSES = "embedded_analyses"
"""Global attribute: JSON, a list of `EmbeddedAnalysis`."""

NOT_IN_THE_PLANE = "the analyses are in the plane, the records are not"
READS_RECORDS = "the model reads its answers from the records and has none inside an analysis"
"""Why the analyses that a dataset states are not made: for a dataset, for a ceiling."""

EXPLICIT, IMPLICIT = SOLVERS = ("explicit", "implicit")


class PosedProblem(BaseModel):
    """One boundary-value problem with everything that may be chosen in it.

    Parameters
    ----------
    name : label in the files
    problem : a key of `granbench.fem.PROBLEMS`
    mesh : name of one of its meshes
    choices : fields of the problem that are not as by default; the confinement is always stated,
        a pressure in Pa or the fields of a `RandomConfinement`, for by default it depends on the
        model
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]*$")
    problem: str
    mesh: str
    choices: Mapping[str, int | float | str | bool | Mapping[str, int | float]]

    @property
    def confinement(self) -> float:
        """Pressure at the start, Pa."""
        stated: Any = self.choices["confinement"]
        return float(stated["mean"] if isinstance(stated, Mapping) else stated)

    def model_post_init(self, context: object) -> None:
        """Refuse a problem whose confinement is left open."""
        if "confinement" not in self.choices:
            raise ValueError(f"{self.name}: state the confinement, it may not hang on the model")


class EmbeddedAnalysis(PosedProblem):
    """A problem in which a model takes the place of the ground truth.

    Parameters
    ----------
    solvers : that it is analysed with
    outputs : output steps of the explicit solver, and load steps of the implicit one
    points : Gauss points whose stress is compared, evenly spread over their numbers
    modulus : Pa; the explicit time step follows from it, whatever the model's own stiffness
    """

    solvers: tuple[Literal["explicit", "implicit"], ...] = Field(min_length=1)
    outputs: int = Field(ge=1)
    points: int = Field(ge=1)
    modulus: float = Field(gt=0.0)


_LISTED = TypeAdapter(tuple[EmbeddedAnalysis, ...])


def embedded_analyses(records: xr.Dataset) -> tuple[EmbeddedAnalysis, ...]:
    """The analyses that a dataset states; none where it states none.

    Raises
    ------
    DatasetError
        If the attribute is damaged, two have one name, or they differ in outputs or points.
    """
    text = records.attrs.get(EMBEDDED_ANALYSES)
    if text is None:
        return ()
    where = records.attrs.get("dataset", "the dataset")
    try:
        listed = _LISTED.validate_json(str(text))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise DatasetError(
            f"{where}: the attribute {EMBEDDED_ANALYSES!r} is damaged at {place or 'its start'} "
            f"({first['msg']}); fetch the file again"
        ) from error
    if len({analysis.name for analysis in listed}) < len(listed):
        raise DatasetError(f"{where}: two of the {EMBEDDED_ANALYSES} have one name; rename one")
    if len({(analysis.outputs, analysis.points) for analysis in listed}) > 1:
        raise DatasetError(
            f"{where}: the {EMBEDDED_ANALYSES} differ in outputs or points; they are kept together"
        )
    return listed


def spread_points(count: int, kept: int) -> np.ndarray:
    """Numbers (kept,) of `kept` out of `count` Gauss points, evenly spread."""
    return np.linspace(0, count - 1, kept).round().astype(np.int64)


def stated(analyses: tuple[EmbeddedAnalysis, ...]) -> str:
    """The attribute that states some analyses."""
    return json.dumps([analysis.model_dump(mode="json") for analysis in analyses], sort_keys=True)
