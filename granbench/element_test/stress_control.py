r"""Stress control: the free strains of an increment at which held stresses meet their targets.

Newton's method on x in ``dstrain = driven + free @ x``, for all points of a batch at once:

    r(x) = held @ stress(driven + free @ x) - target = 0
    x <- x - a (held @ C @ free)^-1 r,          C = d stress / d strain, the cell's tangent

with a = 1, or less where that does not lessen r. Every trial starts from the same stored state.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from granbench.cells.contract import MaterialCell
from granbench.cells.robust_runs import finite_points, robust_call
from granbench.cells.work_budget import spend

ARMIJO = 1e-4
"""Share of the error that a full Newton step takes off at least; a shorter one, in proportion."""


@dataclass(frozen=True)
class IterationLimits:
    """How much is tried before a point is given up.

    Parameters
    ----------
    iterations : of Newton's method in an increment
    halvings : of a Newton step that does not lessen the error, before the increment is given up
    smallest_share : of a step, below which an increment is not cut
    refusals : answers without a stress that a point may give in one step
    """

    iterations: int = 30
    halvings: int = 8
    smallest_share: float = 2.0**-10
    refusals: int = 300


@dataclass(frozen=True)
class Trial:
    """What a cell answers to trial values of the free strains.

    Parameters
    ----------
    x : (point, control), free strains
    stress, state : (point, ...), after the increment
    residual : (point, control), held stress less target, Pa
    error : (point,), the largest residual relative to the stress scale; infinite without a stress
    """

    x: Tensor
    stress: Tensor
    state: Tensor
    residual: Tensor
    error: Tensor

    def replaced(self, where: Tensor, other: "Trial") -> "Trial":
        """This trial, but the other one at the points where the mask is true."""
        merged = {}
        for name, own in vars(self).items():
            mask = where.reshape(-1, *(1,) * (own.ndim - 1))
            merged[name] = torch.where(mask, getattr(other, name), own)
        return Trial(**merged)


@dataclass(frozen=True)
class StressControl:
    """Increments of a cell in which some stresses are held.

    Parameters
    ----------
    cell : the model
    free : (point, component, control), strain directions that follow the stresses
    held : (point, control, component), stress combinations that are held
    tolerance : of the held stresses, relative to the stress scale
    patience : how much is tried
    """

    cell: MaterialCell
    free: Tensor
    held: Tensor
    tolerance: float
    patience: IterationLimits

    def freed(self, x: Tensor) -> Tensor:
        """Strain (point, component) of free strains (point, control)."""
        return torch.einsum("pck,pk->pc", self.free, x)

    def combined(self, stress: Tensor) -> Tensor:
        """Held combinations (point, control) of a stress (point, component), Pa."""
        return torch.einsum("pkc,pc->pk", self.held, stress.double())

    def solve(
        self,
        state: Tensor,
        driven: Tensor,
        target: Tensor,
        guess: Tensor,
        where: Tensor,
        scale: Tensor,
    ) -> tuple[Trial, Tensor]:
        """The trial nearest to the targets; an error above the tolerance says that it failed.

        Parameters
        ----------
        state : (point, n_state), before the increment
        driven : (point, component), prescribed part of the increment
        target : (point, control), Pa
        guess : (point, control), free strains to start from
        where : (point,), the points that are asked for; at others the trial means nothing
        scale : (point,), Pa; zero for that of the first answer

        Returns
        -------
        trial : the best
        refusals : (point,), how often the cell gave a point no stress
        """
        increment = _Increment(self, state, driven, target, scale)
        at = increment.trial(guess, where)
        refusals = (where & at.error.isinf()).long()
        for _ in range(self.patience.iterations):
            # Without a stress there is no step, and the cell would only repeat its answer.
            going = where & (at.error > self.tolerance) & at.error.isfinite()
            if not going.any():
                break
            step = increment.newton_step(at, going)
            nearer = torch.zeros_like(going)
            going = going & (step != 0.0).any(dim=1)
            for halving in range(self.patience.halvings + 1):
                length = 0.5**halving
                moving = going & ~nearer & (refusals < self.patience.refusals)
                if not moving.any():
                    break
                trial = increment.trial(at.x - length * step, moving)
                refusals = refusals + (moving & trial.error.isinf())
                better = moving & (trial.error < (1.0 - ARMIJO * length) * at.error)
                at = at.replaced(better, trial)
                nearer = nearer | better
            where = where & nearer
        return at, refusals


@dataclass(frozen=True)
class _Increment:
    """One increment of a batch: state before it, what is driven, what is wanted."""

    control: StressControl
    state: Tensor
    driven: Tensor
    target: Tensor
    scale: Tensor

    def trial(self, x: Tensor, where: Tensor) -> Trial:
        """What the cell answers to free strains."""
        spend()
        stress, after, *_ = robust_call(self.control.cell.step, self._strain(x, where), self.state)
        residual = self.control.combined(stress) - self.target
        scale = torch.where(self.scale > 0.0, self.scale, stress.double().abs().amax(dim=1))
        error = residual.abs().amax(dim=1) / torch.where(scale > 0.0, scale, 1.0)
        sound = finite_points(stress) & finite_points(after)
        return Trial(x, stress, after, residual, torch.where(sound, error, torch.inf))

    def newton_step(self, at: Trial, where: Tensor) -> Tensor:
        """(held C free)^-1 r, (point, control); zero where that is undefined or not asked for."""
        control = self.control
        *_, stiffness = robust_call(control.cell.tangent, self._strain(at.x, where), self.state)
        matrix = control.held @ stiffness.double() @ control.free
        step, _ = torch.linalg.solve_ex(matrix.nan_to_num(), at.residual.nan_to_num())
        defined = where & finite_points(step) & at.error.isfinite()
        return torch.where(defined[:, None], step, 0.0)

    def _strain(self, x: Tensor, where: Tensor) -> Tensor:
        """What the cell is given; zero, which costs it least, at points not asked for."""
        dstrain = torch.where(where[:, None], self.driven + self.control.freed(x), 0.0)
        return dstrain.to(self.control.cell.dtype)
