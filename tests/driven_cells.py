"""Cells for element tests: elasticity in any order, a small network, a cell with a limit."""

import torch
from torch import Tensor

from granbench.cells.contract import Conditions, MaterialCell, ModuleCell, StateLayout
from granbench.tensors import normal_mask

BULK, SHEAR = 40e6, 24e6
YOUNG = 9.0 * BULK * SHEAR / (3.0 * BULK + SHEAR)
POISSON = (3.0 * BULK - 2.0 * SHEAR) / (2.0 * (3.0 * BULK + SHEAR))
CONSTRAINED = BULK + 4.0 / 3.0 * SHEAR


def elastic_stiffness(order: str) -> Tensor:
    """(component, component), Pa; plane components in plane strain."""
    normal = torch.tensor(normal_mask(order), dtype=torch.float64)
    lame = BULK - 2.0 / 3.0 * SHEAR
    return lame * torch.outer(normal, normal) + 2.0 * SHEAR * torch.eye(len(normal))


class Elastic(torch.nn.Module):
    def __init__(self, order: str) -> None:
        super().__init__()
        self.register_buffer("stiffness", elastic_stiffness(order))

    def forward(self, dstrain: Tensor, stress: Tensor) -> Tensor:
        return stress + dstrain @ self.stiffness


def elastic(order: str = "principal", dtype: torch.dtype = torch.float64) -> ModuleCell:
    return ModuleCell(Elastic(order), name="elastic", order=order, dtype=dtype)


class Learnt(Elastic):
    """A network with a hidden state, added to an elastic part.

    It is neither isotropic nor independent of the size of the increments.
    """

    def __init__(self, order: str) -> None:
        super().__init__(order)
        count = len(self.stiffness)
        generator = torch.Generator().manual_seed(3)
        self.inward = torch.nn.Parameter(torch.randn(2 * count, 6, generator=generator))
        self.outward = torch.nn.Parameter(0.1 * torch.randn(6, count, generator=generator))

    def forward(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        count = dstrain.shape[1]
        stress, hidden = state[:, :count], state[:, count:]
        inputs = torch.cat([200.0 * dstrain, stress / 1e6], dim=1)
        hidden = torch.tanh(inputs @ self.inward + hidden)
        softened = dstrain @ self.stiffness * (1.0 + hidden @ self.outward)
        return stress + softened, torch.cat([stress + softened, hidden], dim=1)


def learnt(order: str = "principal", dtype: torch.dtype = torch.float32) -> ModuleCell:
    layout = StateLayout.of(stress=len(normal_mask(order)), hidden=6)
    return ModuleCell(Learnt(order), name="learnt", order=order, layout=layout, dtype=dtype)


class Limited(MaterialCell):
    """Elastic, but it fails where an increment, or the axial strain, is beyond a limit."""

    name = "limited"
    layout = StateLayout.of(stress=3, axial=1)
    internals = ("axial",)

    def __init__(
        self, largest_increment: float = 1.0, largest_strain: float = 1.0, raises: bool = False
    ) -> None:
        self.largest_increment = largest_increment
        self.largest_strain = largest_strain
        self.raises = raises

    def initial_state(self, conditions: Conditions) -> Tensor:
        return self.layout.pack(
            stress=conditions.stress, axial=torch.zeros_like(conditions.stress[:, 0])
        )

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        axial = state[:, 3] + dstrain[:, 0]
        lost = (dstrain.abs().amax(dim=1) > self.largest_increment) | (axial > self.largest_strain)
        if self.raises and lost.any():
            raise ArithmeticError("beyond the limit")
        stress = state[:, :3] + dstrain @ elastic_stiffness("principal")
        stress = stress.masked_fill(lost[:, None], torch.nan)
        return stress, self.layout.pack(stress=stress, axial=axial)
