"""Small problems and cells for the finite-element tests."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor

from granbench.cells.contract import ModuleCell
from granbench.fem import PlaneMesh, Problem, rectangle
from granbench.fem.loading import Loading, LoadingHistory, Prescribed

LAME, SHEAR = 3e6, 2e6
STIFFNESS = np.array(
    [[LAME + 2 * SHEAR, LAME, 0.0], [LAME, LAME + 2 * SHEAR, 0.0], [0.0, 0.0, 2 * SHEAR]]
)
"""Plane strain, for strain with its tensor shear component, Pa."""


class Elastic(torch.nn.Module):
    """Hooke's law in plane strain."""

    def forward(self, dstrain: Tensor, stress: Tensor) -> Tensor:
        matrix = torch.from_numpy(STIFFNESS).to(dstrain.dtype)
        return torch.addmm(stress.T, matrix, dstrain.T).T


def elastic_cell(dtype: torch.dtype = torch.float64) -> ModuleCell:
    return ModuleCell(Elastic(), name="elastic", order="plane", dtype=dtype)


@dataclass(frozen=True)
class Body(Problem):
    """A body with loading of the test's own."""

    name: ClassVar[str] = "body"
    title: ClassVar[str] = "A body"
    drive: ClassVar[str] = "a displacement"
    reaction: ClassVar[str] = "a force"
    length: ClassVar[str] = "a length"
    meshes: ClassVar[Mapping[str, Callable[[], PlaneMesh]]] = {}
    default_mesh: ClassVar[str] = ""

    act: Loading
    pressure: float = 0.0

    @property
    def drive_length(self) -> float:
        return 1.0

    def loading(self, mesh: PlaneMesh) -> Loading:
        return self.act

    def initial_stress(self, positions: np.ndarray, density: float) -> np.ndarray:
        return np.outer((1.0, 1.0, 0.0), np.full(len(positions), self.pressure))

    def configuration(self) -> dict[str, object]:
        return {}


def bounded_by(
    x: Callable[[np.ndarray], np.ndarray], y: Callable[[np.ndarray], np.ndarray]
) -> Loading:
    """A displacement on the whole boundary of a rectangle, reached in one second."""
    names = ("left", "right", "bottom", "top")
    moves = tuple(Prescribed(name, x=x, y=y) for name in names)
    return Loading(moves, LoadingHistory((0.0, 1.0), (0.0, 1.0)))


def distorted(element: str, columns: int = 3, rows: int = 4) -> PlaneMesh:
    """A rectangle whose inner corners are moved; all edges stay straight."""
    mesh = rectangle(1.0, 1.5, columns, rows, element)
    nodes = mesh.geometry.p.T.copy()
    inner = (nodes[:, 0] % 1.0 > 1e-9) & (nodes[:, 1] % 1.5 > 1e-9)
    shift = np.random.default_rng(1).uniform(-0.07, 0.07, nodes.shape)
    nodes[inner] += shift[inner]
    moved = type(mesh.geometry)(np.ascontiguousarray(nodes.T), mesh.geometry.t)
    return PlaneMesh(moved.with_boundaries(mesh.geometry.boundaries), element)
