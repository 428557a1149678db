"""Linear elasticity in the plane, and cells that differ from it by the one law that they break."""

import torch
from torch import Tensor

from granbench.cells.contract import Conditions, MaterialCell, ModuleCell, StateLayout

SHEAR, LAME = 8e5, 4e5


def elastic(dstrain: Tensor, shear: float = SHEAR) -> Tensor:
    unit = torch.tensor([1.0, 1.0, 0.0], dtype=dstrain.dtype)
    return 2.0 * shear * dstrain + LAME * (dstrain @ unit)[:, None] * unit


class Elastic(torch.nn.Module):
    def forward(self, dstrain: Tensor, stress: Tensor) -> Tensor:
        return stress + elastic(dstrain)


class StiffInShear(torch.nn.Module):
    """Stiffer along the diagonals than along the axes, both of which it treats in the same way."""

    def forward(self, dstrain: Tensor, stress: Tensor) -> Tensor:
        return stress + elastic(dstrain) * torch.tensor([1.0, 1.0, 1.5], dtype=stress.dtype)


class StiffAlongY(torch.nn.Module):
    def forward(self, dstrain: Tensor, stress: Tensor) -> Tensor:
        return stress + elastic(dstrain) * torch.tensor([1.0, 1.5, 1.0], dtype=stress.dtype)


class Generous(torch.nn.Module):
    """Returns more work in dilation than it took in compression."""

    def forward(self, dstrain: Tensor, stress: Tensor) -> Tensor:
        compressed = (dstrain[:, :2].sum(dim=1, keepdim=True) > 0.0).to(stress.dtype)
        return stress + (1.0 + 0.2 * compressed) * elastic(dstrain)


class Restless(torch.nn.Module):
    """Loses a hundredth of its stress in every zero increment."""

    def forward(self, dstrain: Tensor, stress: Tensor) -> Tensor:
        still = (dstrain == 0.0).all(dim=1, keepdim=True).to(stress.dtype)
        return (1.0 - 0.01 * still) * stress + elastic(dstrain)


class Relaxing(torch.nn.Module):
    """Loses a hundredth of its stress with every call, as a network does that counts steps."""

    def forward(self, dstrain: Tensor, stress: Tensor) -> Tensor:
        return 0.99 * stress + elastic(dstrain)


class Coarse(torch.nn.Module):
    """Stiffer under large increments than under small ones."""

    def forward(self, dstrain: Tensor, stress: Tensor) -> Tensor:
        multiplicity = torch.tensor([1.0, 1.0, 2.0], dtype=stress.dtype)
        size = (multiplicity * dstrain**2).sum(dim=1, keepdim=True).clamp(min=1e-30).sqrt()
        return stress + (1.0 + size / 1e-2) * elastic(dstrain)


def cell(module: torch.nn.Module, dtype: torch.dtype = torch.float64) -> ModuleCell:
    return ModuleCell(module, name=type(module).__name__.lower(), order="plane", dtype=dtype)


class WrongTangent(ModuleCell):
    """Its stress is right, its own tangent a tenth too stiff."""

    def __init__(self) -> None:
        super().__init__(Elastic(), name="wrong-tangent", order="plane", dtype=torch.float64)

    def tangent(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        stress, after, tangent = super().tangent(dstrain, state)
        return stress, after, 1.1 * tangent


class Numeric(MaterialCell):
    """Linear elasticity computed outside torch, so that nothing can differentiate it."""

    name = "numeric"
    order = "plane"
    layout = StateLayout.of(stress=3)

    def initial_state(self, conditions: Conditions) -> Tensor:
        return conditions.stress.to(self.dtype)

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        stress = torch.from_numpy(
            state.numpy() + elastic(torch.from_numpy(dstrain.numpy())).numpy()
        )
        return stress, stress


class Mortal(Numeric):
    """Fails at 1 % of accumulated strain, by NaN or by raising; before that it is elastic."""

    name = "mortal"
    layout = StateLayout.of(stress=3, accumulated=1)

    def __init__(self, raises: bool) -> None:
        self.raises = raises

    def initial_state(self, conditions: Conditions) -> Tensor:
        return torch.nn.functional.pad(conditions.stress.to(self.dtype), (0, 1))

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        accumulated = state[:, 3:] + dstrain.abs().sum(dim=1, keepdim=True)
        broken = accumulated > 1e-2
        if self.raises and broken.any():
            raise FloatingPointError("the return mapping did not converge")
        stress = (state[:, :3] + elastic(dstrain)).masked_fill(broken, torch.nan)
        return stress, torch.cat([stress, accumulated], dim=1)
