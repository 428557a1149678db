"""Small cells for tests of what is done with any cell."""

import torch
import xarray as xr
from torch import Tensor

from granbench.cells.contract import Conditions, MaterialCell, ModuleCell, StateLayout
from granbench.data.adapters import accumulated_strain


class Persistence(MaterialCell):
    """The stress stays what it was."""

    name = "persistence"
    layout = StateLayout.of(stress=3)

    def initial_state(self, conditions: Conditions) -> Tensor:
        return conditions.stress.to(self.dtype)

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        return state.clone(), state


class Secant(torch.nn.Module):
    """Stress grows by a constant stiffness; void ratio follows from the volumetric strain."""

    def forward(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        stress = state[:, :3] + 2e6 * dstrain
        void_ratio = state[:, 3] - (1.0 + state[:, 3]) * dstrain.sum(dim=1)
        return stress, torch.cat([stress, void_ratio.unsqueeze(1)], dim=1)


def secant(name: str = "secant") -> ModuleCell:
    layout = StateLayout.of(stress=3, void_ratio=1)
    return ModuleCell(Secant(), name=name, layout=layout, internals=("void_ratio",))


class Fragile(Persistence):
    """Fails where the axial strain since the start passes a limit: by NaN or by raising."""

    layout = StateLayout.of(stress=3, axial=1)

    def __init__(self, limit: float, raises: bool) -> None:
        self.limit = limit
        self.raises = raises

    def initial_state(self, conditions: Conditions) -> Tensor:
        stress = conditions.stress.to(self.dtype)
        return torch.cat([stress, torch.zeros_like(stress[:, :1])], dim=1)

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        state = state.clone()
        state[:, 3] += dstrain[:, 0]
        broken = state[:, 3] > self.limit
        if self.raises and broken.any():
            raise FloatingPointError("the return mapping did not converge")
        stress = state[:, :3].masked_fill(broken[:, None], torch.nan)
        return stress, state


class Oracle(MaterialCell):
    """Looks its stresses up: finds its start in the records and then counts steps.

    Every recorded state differs in what is known at a start: stress, void ratio and accumulated
    strain.
    """

    name = "oracle"
    layout = StateLayout.of(stress=3, void_ratio=1, path=1, at=1)
    internals = ("void_ratio",)
    reads_records = True

    def __init__(self, dataset: xr.Dataset) -> None:
        self.stress = torch.from_numpy(dataset["stress"].values).double()
        self.void_ratio = torch.from_numpy(dataset["void_ratio"].values).double()
        strain = torch.from_numpy(dataset["strain"].values).double()
        self.known = torch.cat(
            [self.stress / 1e6, self.void_ratio.unsqueeze(-1), accumulated_strain(strain)], dim=-1
        )

    def initial_state(self, conditions: Conditions) -> Tensor:
        void_ratio = conditions.require("initial_void_ratio").unsqueeze(-1)
        start = torch.cat([conditions.stress / 1e6, void_ratio, conditions.past_strain()], dim=-1)
        steps = self.known.shape[1]
        distance = torch.cdist(start, self.known.flatten(0, 1))
        found = distance.argmin(dim=1)
        return self._state(found // steps, found % steps)

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        path = state[:, self.layout["path"]].squeeze(1).long()
        at = state[:, self.layout["at"]].squeeze(1).long() + 1
        state = self._state(path, at)
        return state[:, :3], state

    def _state(self, path: Tensor, at: Tensor) -> Tensor:
        return self.layout.pack(
            stress=self.stress[path, at],
            void_ratio=self.void_ratio[path, at].unsqueeze(1),
            path=path.double().unsqueeze(1),
            at=at.double().unsqueeze(1),
        )
