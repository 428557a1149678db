"""Small tasks with boundary-value problems, for tests of the embedded axis."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
import xarray as xr
from plane_records import plane_records
from torch import Tensor

from granbench.benchmark.registry import axis_names
from granbench.benchmark.task import Task
from granbench.cells.contract import ModuleCell, StateLayout
from granbench.fem.statement import EMBEDDED_ANALYSES, SOLVERS, EmbeddedAnalysis, as_attribute
from granbench.models.classical import ClassicalCell
from granbench.models.ground_truth import described
from granbench.models.j2 import J2

OUTPUTS = 8
STRAIN = 2e-3
"""Driving strain at the end; a smooth specimen of the elastic truth has it everywhere."""


def analysis(name: str, **changes: Any) -> EmbeddedAnalysis:
    """A smooth biaxial test without confinement on the coarse mesh."""
    choices: Mapping[str, Any] = {
        "ends": "smooth", "confinement": 0.0, "end_strain": STRAIN, "speed": 0.02,
    }  # fmt: skip
    given = {
        "problem": "biaxial", "mesh": "coarse", "solvers": SOLVERS, "outputs": OUTPUTS,
        "points": 8, "modulus": 2.1e6,
    }  # fmt: skip
    chosen = choices | changes.pop("choices", {})
    return EmbeddedAnalysis(name=name, choices=chosen, **given | changes)


SMOOTH = analysis("smooth")
ROUGH = analysis("rough", choices={"ends": "rough", "end_strain": 0.25 * STRAIN})


def elastic_truth() -> J2:
    """J2 with a yield stress that is never met: E and nu as in the thesis."""
    return J2({"yield_stress": 1e9})


def embedding_records(
    truth: ClassicalCell | None = None,
    analyses: tuple[EmbeddedAnalysis, ...] = (SMOOTH, ROUGH),
) -> xr.Dataset:
    """A few short records with a ground truth, and the analyses of their task; see `task_of`."""
    records = plane_records().drop_vars("tangent")
    split = records["split"].values.astype(str)
    rows = [np.flatnonzero(split == name)[:3] for name in ("train", "test")]
    few = records.isel(path=np.concatenate(rows), step=slice(0, 12))
    cell = truth or elastic_truth()
    return few.assign_attrs(
        {"ground_truth": json.dumps(described(cell)), EMBEDDED_ANALYSES: as_attribute(analyses)}
    )


def task_of(records: xr.Dataset) -> Task:
    """The task of `embedding_records`: what is in the file, and the analyses of its attribute."""
    sealed = {"content_sha256": "0" * 64, **records.attrs}
    alone = Task.of_records(records.assign_attrs(sealed))
    listed = json.loads(records.attrs[EMBEDDED_ANALYSES])
    analyses = tuple(EmbeddedAnalysis.model_validate(fields) for fields in listed)
    return alone.model_copy(update={"axes": axis_names(), "analyses": analyses})


class Elastic(torch.nn.Module):
    """Isotropic elasticity that breaks when eps_yy goes beyond a limit."""

    def __init__(self, share: float = 1.0, limit: float = np.inf) -> None:
        super().__init__()
        values = elastic_truth().values()
        bulk, shear = share * values["bulk_modulus"], share * values["shear_modulus"]
        same, other = bulk + shear, bulk - shear
        matrix = [[same, other, 0.0], [other, same, 0.0], [0.0, 0.0, 2.0 * shear]]
        self.matrix = torch.nn.Parameter(torch.tensor(matrix, dtype=torch.float64))
        self.limit = limit

    def forward(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """Stress and state after an increment; the state holds stress and strain."""
        stress = state[:, :3] + dstrain @ self.matrix
        strain = state[:, 3:] + dstrain
        stress = torch.where(strain[:, 1:2] > self.limit, torch.nan, stress)
        return stress, torch.cat([stress, strain], dim=1)


class Untraceable(Elastic):
    """The same through NumPy, which torch cannot differentiate."""

    def forward(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """Stress and state after an increment."""
        stress, after = super().forward(dstrain, state)
        stress.numpy()
        return stress, after


def cell(module: torch.nn.Module, dtype: torch.dtype = torch.float64) -> ModuleCell:
    """A cell that carries stress and strain."""
    layout = StateLayout.of(stress=3, strain=3)
    return ModuleCell(module, name="test-cell", order="plane", layout=layout, dtype=dtype)
