"""Statements of boundary-value problems: which problem, on which mesh, analysed in which way.

A task lists the analyses in which a model takes the place of its ground truth. Reading such a list
needs neither torch nor finite elements, so that scores can be computed without them.
"""

import json
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

EMBEDDED_ANALYSES = "embedded_analyses"
"""Global attribute of generated Gauss-point histories: JSON, a list of `EmbeddedAnalysis`.

It documents what the generator proposes. The analyses that are scored are those of the task.
"""

NOT_IN_THE_PLANE = "the analyses are in the plane, the records are not"
READS_RECORDS = "the model reads its answers from the records and has none inside an analysis"
"""Reasons why the analyses of a task are left out."""

EXPLICIT, IMPLICIT = SOLVERS = ("explicit", "implicit")


class ProblemStatement(BaseModel):
    """One boundary-value problem with every choice that it leaves.

    Parameters
    ----------
    name : label in the files
    problem : a key of `granbench.fem.PROBLEMS`
    mesh : name of one of its meshes
    choices : fields of the problem that differ from their defaults. `confinement` is required,
        because its default depends on the model: a pressure in Pa, or the fields of a
        `RandomConfinement`
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
        """Refuse a statement without `confinement`."""
        if "confinement" not in self.choices:
            raise ValueError(f"{self.name}: choices must give the confinement, a pressure in Pa")


class EmbeddedAnalysis(ProblemStatement):
    """A boundary-value problem in which a model takes the place of the ground truth.

    Parameters
    ----------
    solvers : the solvers that it is analysed with
    outputs : number of output steps of the explicit solver, and of load steps of the implicit one
    points : number of Gauss points whose stress is compared, evenly spread over their numbers
    modulus : Pa; sets the explicit time step, whatever the stiffness of the model
    """

    solvers: tuple[Literal["explicit", "implicit"], ...] = Field(min_length=1)
    outputs: int = Field(ge=1)
    points: int = Field(ge=1)
    modulus: float = Field(gt=0.0)


def spread_points(count: int, kept: int) -> np.ndarray:
    """Numbers (kept,) of `kept` out of `count` Gauss points, evenly spread."""
    return np.linspace(0, count - 1, kept).round().astype(np.int64)


def as_attribute(analyses: tuple[EmbeddedAnalysis, ...]) -> str:
    """The text of the attribute `EMBEDDED_ANALYSES`."""
    return json.dumps([analysis.model_dump(mode="json") for analysis in analyses], sort_keys=True)
