"""Models that each break one rule of material cells, as models of users do, and which rule."""

import os
import random
import time

import numpy as np
import torch
from torch import Tensor

from granbench.cells.contract import Conditions, MaterialCell, ModuleCell, StateLayout

STIFFNESS = 30e6
COUNTS = {"calls": 0}
DRAWS = np.random.default_rng(0)


class Module(torch.nn.Module):
    """Linear elasticity without Poisson's effect; the modules below it break a rule."""

    def forward(self, dstrain: Tensor, stress: Tensor) -> Tensor:
        return stress + STIFFNESS * dstrain


class AddsInPlace(Module):
    def forward(self, dstrain, stress):
        stress += STIFFNESS * dstrain
        return stress


class ScalesStrainInPlace(Module):
    def forward(self, dstrain, stress):
        dstrain *= STIFFNESS
        return stress.add_(dstrain)


class WritesThroughNumpy(Module):
    @torch.no_grad()
    def forward(self, dstrain, stress):
        stress.numpy()[:] += STIFFNESS * dstrain.numpy()
        return stress


class ReturnsItsBuffer(Module):
    def __init__(self):
        super().__init__()
        self.scratch = torch.zeros(0)

    def forward(self, dstrain, stress):
        if len(self.scratch) != len(stress):
            self.scratch = torch.zeros_like(stress)
        self.scratch.copy_(stress + STIFFNESS * dstrain)
        return self.scratch


class ReturnsAView(Module):
    def forward(self, dstrain, stress):
        return torch.add(stress, dstrain, alpha=STIFFNESS, out=stress)[:]


class DropsOut(Module):
    def __init__(self):
        super().__init__()
        self.drop = torch.nn.Dropout(0.5)

    def forward(self, dstrain, stress):
        return stress + STIFFNESS * self.drop(dstrain)


class NormalisesInTraining(Module):
    def __init__(self):
        super().__init__()
        self.norm = torch.nn.BatchNorm1d(3, affine=False)
        self.norm.running_var.fill_(1.0 - 1e-5)

    def forward(self, dstrain, stress):
        return stress + STIFFNESS * self.norm(dstrain)


class DependsOnItsMode(Module):
    def forward(self, dstrain, stress):
        return stress + STIFFNESS * dstrain * (1.5 if self.training else 1.0)


class ComputesItsGradient(Module):
    """A potential whose derivative is the stress, as in hyperelastic networks."""

    def forward(self, dstrain, stress):
        with torch.enable_grad():
            strain = dstrain.detach().requires_grad_()
            energy = 0.5 * STIFFNESS * (strain**2).sum()
            (change,) = torch.autograd.grad(energy, strain, create_graph=True)
        return stress + change


class UsesInferenceMode(Module):
    @torch.inference_mode()
    def forward(self, dstrain, stress):
        return stress + STIFFNESS * dstrain


HARMLESS = [
    Module, AddsInPlace, ScalesStrainInPlace, WritesThroughNumpy, ReturnsItsBuffer, ReturnsAView,
    DropsOut, NormalisesInTraining, DependsOnItsMode, ComputesItsGradient, UsesInferenceMode,
]  # fmt: skip
"""Modules that are corrected: all of them score as `Module` does."""


class RemembersStrain(Module):
    def __init__(self):
        super().__init__()
        self.history = None

    def forward(self, dstrain, stress):
        size = dstrain.abs().sum(dim=1, keepdim=True)
        known = self.history is not None and len(self.history) == len(size)
        self.history = self.history + size if known else size
        return stress + STIFFNESS * dstrain / (1.0 + 50.0 * self.history)


class CountsCalls(Module):
    calls = 0

    def forward(self, dstrain, stress):
        self.calls += 1
        return stress + STIFFNESS * dstrain * (1.0 + 0.01 * self.calls)


class CountsInABuffer(Module):
    def __init__(self):
        super().__init__()
        self.register_buffer("count", torch.zeros(()))

    def forward(self, dstrain, stress):
        self.count += 1.0
        return stress + STIFFNESS * dstrain / self.count


class KeepsHidden(Module):
    """A recurrent network that keeps its hidden state in the module."""

    def __init__(self):
        super().__init__()
        torch.manual_seed(0)
        self.cell = torch.nn.GRUCell(3, 3)
        self.hidden = {}

    def forward(self, dstrain, stress):
        before = self.hidden.get(len(dstrain))
        self.hidden[len(dstrain)] = self.cell(1e3 * dstrain, before)
        return stress + STIFFNESS * dstrain * (1.0 + self.hidden[len(dstrain)])


class RemembersGlobally(Module):
    def forward(self, dstrain, stress):
        COUNTS["calls"] += 1
        return stress + STIFFNESS * dstrain * (1.0 + 0.01 * COUNTS["calls"])


class RemembersInItsClass(Module):
    seen: list = []

    def forward(self, dstrain, stress):
        self.seen.append(len(dstrain))
        return stress + STIFFNESS * dstrain / len(self.seen)


MEMORIES = {
    RemembersStrain: "module.history",
    CountsCalls: "module.calls",
    CountsInABuffer: "module.count",
    KeepsHidden: "module.hidden",
    RemembersGlobally: "module.COUNTS.calls",
    RemembersInItsClass: "module.seen",
}
"""Modules with a memory outside of the state, and where it is."""


class DrawsFromTorch(Module):
    def forward(self, dstrain, stress):
        return stress + STIFFNESS * dstrain * (1.0 + 0.1 * torch.rand(len(dstrain), 1))


class DropsOutAlways(Module):
    def forward(self, dstrain, stress):
        return stress + STIFFNESS * torch.nn.functional.dropout(dstrain, 0.2, training=True)


class DrawsFromNumpy(Module):
    def forward(self, dstrain, stress):
        return stress + STIFFNESS * dstrain * (1.0 + 0.1 * np.random.rand())  # noqa: NPY002


class DrawsFromPython(Module):
    def forward(self, dstrain, stress):
        return stress + STIFFNESS * dstrain * (1.0 + 0.1 * random.random())


class DrawsFromItsOwn(Module):
    def __init__(self):
        super().__init__()
        self.generator = np.random.default_rng(1)

    def forward(self, dstrain, stress):
        return stress + STIFFNESS * dstrain * (1.0 + 0.1 * self.generator.random())


class DrawsFromItsModule(Module):
    def forward(self, dstrain, stress):
        return stress + STIFFNESS * dstrain * (1.0 + 0.1 * DRAWS.random())


RANDOM = [
    DrawsFromTorch, DropsOutAlways, DrawsFromNumpy, DrawsFromPython, DrawsFromItsOwn,
    DrawsFromItsModule,
]  # fmt: skip


class NormalisesTheBatch(Module):
    def __init__(self):
        super().__init__()
        self.norm = torch.nn.BatchNorm1d(3, track_running_stats=False)

    def forward(self, dstrain, stress):
        if len(dstrain) == 1:
            return stress + STIFFNESS * dstrain
        return stress + STIFFNESS * self.norm(dstrain)


class DividesByTheLargest(Module):
    def forward(self, dstrain, stress):
        return stress + 1e4 * dstrain / dstrain.abs().max()


class SubtractsTheMean(Module):
    def forward(self, dstrain, stress):
        return stress + STIFFNESS * (dstrain - 0.1 * dstrain.mean(dim=0))


class FollowsTheFirst(Module):
    def forward(self, dstrain, stress):
        return stress + STIFFNESS * dstrain[:1].expand_as(dstrain)


class KnowsTheBatchSize(Module):
    def forward(self, dstrain, stress):
        return stress + STIFFNESS * dstrain * len(dstrain)


class CachesByBatchSize(Module):
    def __init__(self):
        super().__init__()
        self.cache = {}

    def forward(self, dstrain, stress):
        return stress + self.cache.setdefault(len(dstrain), STIFFNESS * dstrain)


MIXED = [
    CachesByBatchSize,
    NormalisesTheBatch, DividesByTheLargest, SubtractsTheMean, FollowsTheFirst, KnowsTheBatchSize,
]  # fmt: skip


class HardensItself(Module):
    """Plasticity whose hardening variable is the module's own: it is written only at yield."""

    def __init__(self):
        super().__init__()
        self.plastic = None

    def forward(self, dstrain, stress):
        if self.plastic is None or len(self.plastic) != len(dstrain):
            self.plastic = torch.zeros(len(dstrain), 1, dtype=dstrain.dtype)
        trial = stress + STIFFNESS * dstrain
        mean = trial.mean(dim=1, keepdim=True)
        deviator = trial - mean
        size = (1.5 * (deviator**2).sum(dim=1, keepdim=True)).sqrt()
        beyond = (size - (5e5 + 5e6 * self.plastic)).clamp(min=0.0)
        if bool((beyond > 0.0).any()):
            self.plastic = (self.plastic + beyond / 90e6).detach()
        return mean + deviator * (1.0 - beyond / size.clamp(min=1.0))


class KeepsTheLargest(Module):
    """The largest stress of all calls and points is one number, whatever the size of the batch."""

    def __init__(self):
        super().__init__()
        self.largest = 5e5

    def forward(self, dstrain, stress):
        size = stress.abs().amax(dim=1, keepdim=True)
        soft = torch.where((size > 5e5) & (size < self.largest), 0.5, 1.0).to(stress)
        self.largest = max(self.largest, float(size.max()))
        return stress + soft * STIFFNESS * dstrain


class CountsAtYield(Module):
    def __init__(self):
        super().__init__()
        self.yielded = {"times": 0}

    def forward(self, dstrain, stress):
        self.yielded["times"] += int((stress.abs().amax(dim=1) > 5e5).sum())
        return stress + STIFFNESS * dstrain / (1.0 + 1e-3 * self.yielded["times"])


LATE_MEMORIES = {
    HardensItself: "module.plastic",
    KeepsTheLargest: "module.largest",
    CountsAtYield: "module.yielded.times",
}
"""Modules with a memory that is written only at large stress, and where it is."""


class DrawsAtYield(Module):
    def forward(self, dstrain, stress):
        large = bool(stress.abs().max() > 5e5)
        return stress + STIFFNESS * dstrain * (1.0 + (0.3 * torch.rand(1) if large else 0.0))


class DrawsForSomePoints(Module):
    def forward(self, dstrain, stress):
        large = (stress.amax(dim=1) > 5e5).nonzero().flatten()
        factor = torch.ones(len(stress), 1, dtype=stress.dtype)
        if len(large):
            factor[large] += 0.05 * torch.from_numpy(np.random.rand(len(large), 1)).to(factor)  # noqa: NPY002
        return stress + STIFFNESS * dstrain * factor


class DrawsOnLargeSteps(Module):
    def forward(self, dstrain, stress):
        large = bool(dstrain.abs().max() > 5e-4)
        return stress + STIFFNESS * dstrain * (1.0 + (0.1 * random.random() if large else 0.0))


LATE_RANDOM = [DrawsAtYield, DrawsForSomePoints, DrawsOnLargeSteps]
"""Modules that draw random numbers only at large stress or in large steps."""


def softening(dstrain, stress, substeps):
    """Explicit substeps of a stiffness that falls with stress, so that their number matters."""
    for _ in range(substeps):
        stiffness = STIFFNESS / (1.0 + stress.abs().amax(dim=1, keepdim=True) / 3e5)
        stress = stress + stiffness * dstrain / substeps
    return stress


class SubstepsOfTheBatch(Module):
    def forward(self, dstrain, stress):
        return softening(dstrain, stress, 1 + int(dstrain.abs().max() / 4e-4))


class SubstepsOfTheLargestStress(Module):
    def forward(self, dstrain, stress):
        return softening(dstrain, stress, 1 + int(stress.abs().max() > 5e5))


class SharesItsYield(Module):
    """One point beyond yield softens all others; the number of calls has no effect."""

    calls = 0

    def forward(self, dstrain, stress):
        self.calls += 1
        soft = 0.5 if bool((stress.amax(dim=1) > 5e5).any()) else 1.0
        return stress + soft * STIFFNESS * dstrain


LATE_MIXED = [SubstepsOfTheBatch, SubstepsOfTheLargestStress, SharesItsYield]
"""Modules whose points depend on each other only at large stress or in large steps."""


class DrawsFromTheSystem(Module):
    def forward(self, dstrain, stress):
        return stress + STIFFNESS * dstrain * (1.0 + 0.1 * os.urandom(1)[0] / 255.0)


class DependsOnTheClock(Module):
    def forward(self, dstrain, stress):
        return stress + STIFFNESS * dstrain * (1.0 + 0.1 * (time.perf_counter() * 1e4 % 1.0))


UNSEEN = [DrawsFromTheSystem, DependsOnTheClock]
"""Modules whose results change, although nothing that they hold does."""


class BuildsAtYield(Module):
    """A cache that is built at the first use and changes no result."""

    def __init__(self):
        super().__init__()
        self.factors = {}

    def forward(self, dstrain, stress):
        if bool(stress.abs().max() > 5e5):
            self.factors.setdefault(len(stress), torch.full((len(stress), 1), STIFFNESS))
        return stress + STIFFNESS * dstrain


class OwnSubsteps(Module):
    """Every point has the number of substeps of its own increment."""

    def forward(self, dstrain, stress):
        counts = 1 + (dstrain.abs().amax(dim=1) / 4e-4).long().clamp(max=20)
        rows = [
            softening(dstrain[n : n + 1], stress[n : n + 1], int(count))
            for n, count in enumerate(counts)
        ]
        return torch.cat(rows)


LATE_HARMLESS = [BuildsAtYield, OwnSubsteps]


class WithoutGradients(Module):
    @torch.no_grad()
    def forward(self, dstrain, stress):
        return stress + STIFFNESS * dstrain


class DetachesStrain(Module):
    def __init__(self):
        super().__init__()
        self.stiffness = torch.nn.Parameter(torch.tensor(STIFFNESS))

    def forward(self, dstrain, stress):
        return stress + self.stiffness * dstrain.detach()


class ComputesInNumpy(Module):
    def forward(self, dstrain, stress):
        change = STIFFNESS * dstrain.detach().numpy()
        return stress + torch.from_numpy(change)


class LeavesTorch(Module):
    def forward(self, dstrain, stress):
        return stress + torch.from_numpy(STIFFNESS * dstrain.numpy())


class TakesItems(Module):
    def forward(self, dstrain, stress):
        rows = [[STIFFNESS * value.item() for value in row] for row in dstrain]
        return stress + torch.tensor(rows, dtype=stress.dtype).reshape(stress.shape)


class DetachesOneComponent(Module):
    def forward(self, dstrain, stress):
        change = STIFFNESS * dstrain
        return stress + torch.cat([change[:, :1], change[:, 1:2].detach(), change[:, 2:]], dim=1)


WITHOUT_GRADIENTS = [
    WithoutGradients, UsesInferenceMode, DetachesStrain, ComputesInNumpy, LeavesTorch, TakesItems,
    DetachesOneComponent,
]  # fmt: skip


def cell(module: type[Module], order: str = "principal", dtype=torch.float64) -> ModuleCell:
    return ModuleCell(module(), name=module.__name__, order=order, dtype=dtype)


class Plain(MaterialCell):
    """A cell without a module; the cells below it break a rule."""

    name = "plain"
    layout = StateLayout.of(stress=3)

    def initial_state(self, conditions: Conditions) -> Tensor:
        return conditions.stress.to(self.dtype)

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        stress = state + STIFFNESS * dstrain
        return stress, stress


class PlainInPlace(Plain):
    def step(self, dstrain, state):
        state += STIFFNESS * dstrain
        return state, state


class PlainStrainInPlace(Plain):
    def step(self, dstrain, state):
        stress = state + dstrain.mul_(STIFFNESS)
        return stress, stress


class PlainBuffer(Plain):
    def __init__(self):
        self.buffer = {}

    def step(self, dstrain, state):
        out = self.buffer.setdefault(len(state), torch.zeros_like(state))
        out.copy_(state + STIFFNESS * dstrain)
        return out, out


class PlainGradients(Plain):
    def step(self, dstrain, state):
        with torch.enable_grad():
            stress = state + STIFFNESS * dstrain.clone().requires_grad_()
        return stress, stress


class PlainRandomStart(Plain):
    def initial_state(self, conditions):
        return conditions.stress + 1e3 * torch.rand_like(conditions.stress)


class PlainResetByStart(Plain):
    """Counts the steps since its last start: whole paths are the same, restarts are not."""

    def initial_state(self, conditions):
        self.steps = 0
        return super().initial_state(conditions)

    def step(self, dstrain, state):
        self.steps += 1
        stress = state + STIFFNESS * dstrain / self.steps
        return stress, stress


class PlainSqueezed(Plain):
    def step(self, dstrain, state):
        stress = (state + STIFFNESS * dstrain).squeeze()
        return stress, stress


class PlainIntegers(Plain):
    def step(self, dstrain, state):
        return (state + STIFFNESS * dstrain).long(), state


class PlainArray(Plain):
    def step(self, dstrain, state):
        stress = state + STIFFNESS * dstrain
        return stress.numpy(), stress


class PlainAlone(Plain):
    def step(self, dstrain, state):
        return state + STIFFNESS * dstrain


class PlainWideLayout(Plain):
    layout = StateLayout.of(stress=3, void_ratio=1)


class PlainNarrow(Plain):
    layout = StateLayout.of(stress=2)


class PlainNameless(Plain):
    name = None


class PlainUnknownOrder(Plain):
    order = "voigt"


class PlainLostInternal(Plain):
    internals = ("void_ratio",)


REFUSED = {
    PlainInPlace: "state = state.clone",
    PlainStrainInPlace: "dstrain = dstrain.clone",
    PlainBuffer: "clone",
    PlainGradients: "detach",
    PlainRandomStart: "random numbers of torch|remembers",
    PlainResetByStart: "steps",
    PlainSqueezed: r"shape \(3,\)",
    PlainIntegers: "int64",
    PlainArray: "must be a torch tensor",
    PlainAlone: "two tensors",
    PlainWideLayout: "shape",
    PlainNarrow: "'stress' of its layout is 2 wide",
    PlainNameless: "`name`",
    PlainUnknownOrder: "'voigt'",
    PlainLostInternal: "'void_ratio' of its `internals`",
}
"""Cells of a user's own class, and what the error about each names."""
