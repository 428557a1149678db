r"""Stress control: the free strains of an increment at which held stresses meet their targets.

Newton's method on x in ``dstrain = driven + free @ x``, for all points of a batch at once:

    r(x) = held @ stress(driven + free @ x) - target = 0
    x <- x - a (held @ C @ free)^-1 r,          C = d stress / d strain, the cell's tangent

with a = 1, or less where that does not reduce r. Every trial starts from the same stored state.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from granbench.cells.contract import MaterialCell
from granbench.cells.robust_runs import finite_points, robust_call
from granbench.cells.work_budget import spend

ARMIJO = 1e-4
"""Least reduction of the error by a full Newton step, as a share; less for a shorter step."""


@dataclass(frozen=True)
class IterationLimits:
    """How much is tried before a point counts as failed.

    Parameters
    ----------
    iterations : of Newton's method in an increment
    halvings : of a Newton step that does not reduce the error, before the increment fails
    smallest_share : of a step, below which an increment is not divided
    failed_calls : calls in one step that may leave a point without a stress
    """

    iterations: int = 30
    halvings: int = 8
    smallest_share: float = 2.0**-10
    failed_calls: int = 300


@dataclass(frozen=True)
class Trial:
    """The stress of a cell for trial values of the free strains.

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
        """This trial, with the other one at the points where the mask is true."""
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
    limits : how much is tried
    """

    cell: MaterialCell
    free: Tensor
    held: Tensor
    tolerance: float
    limits: IterationLimits

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
        """The best trial; it has failed where its error is above the tolerance.

        Parameters
        ----------
        state : (point, n_state), before the increment
        driven : (point, component), prescribed part of the increment
        target : (point, control), Pa
        guess : (point, control), free strains to start from
        where : (point,), the points to solve for; at others the trial has no meaning
        scale : (point,), Pa; zero for the size of the first stress

        Returns
        -------
        trial : the best
        failed_calls : (point,), number of calls that left the point without a stress
        """
        increment = _Increment(self, state, driven, target, scale)
        at = increment.trial(guess, where)
        failed_calls = (where & at.error.isinf()).long()
        for _ in range(self.limits.iterations):
            # Without a stress there is no Newton step, and the same call would fail again.
            active = where & (at.error > self.tolerance) & at.error.isfinite()
            if not active.any():
                break
            step = increment.newton_step(at, active)
            improved = torch.zeros_like(active)
            active = active & (step != 0.0).any(dim=1)
            for halving in range(self.limits.halvings + 1):
                length = 0.5**halving
                moving = active & ~improved & (failed_calls < self.limits.failed_calls)
                if not moving.any():
                    break
                trial = increment.trial(at.x - length * step, moving)
                failed_calls = failed_calls + (moving & trial.error.isinf())
                better = moving & (trial.error < (1.0 - ARMIJO * length) * at.error)
                at = at.replaced(better, trial)
                improved = improved | better
            where = where & improved
        return at, failed_calls


@dataclass(frozen=True)
class _Increment:
    """One increment of a batch: the state before it, the prescribed strain, the target stress."""

    control: StressControl
    state: Tensor
    driven: Tensor
    target: Tensor
    scale: Tensor

    def trial(self, x: Tensor, where: Tensor) -> Trial:
        """The stress of the cell for free strains x."""
        spend()
        stress, after, *_ = robust_call(self.control.cell.step, self._strain(x, where), self.state)
        residual = self.control.combined(stress) - self.target
        scale = torch.where(self.scale > 0.0, self.scale, stress.double().abs().amax(dim=1))
        error = residual.abs().amax(dim=1) / torch.where(scale > 0.0, scale, 1.0)
        finite = finite_points(stress) & finite_points(after)
        return Trial(x, stress, after, residual, torch.where(finite, error, torch.inf))

    def newton_step(self, at: Trial, where: Tensor) -> Tensor:
        """(held C free)^-1 r, (point, control); zero where it is undefined or not needed."""
        control = self.control
        *_, stiffness = robust_call(control.cell.tangent, self._strain(at.x, where), self.state)
        matrix = control.held @ stiffness.double() @ control.free
        step, _ = torch.linalg.solve_ex(matrix.nan_to_num(), at.residual.nan_to_num())
        defined = where & finite_points(step) & at.error.isfinite()
        return torch.where(defined[:, None], step, 0.0)

    def _strain(self, x: Tensor, where: Tensor) -> Tensor:
        """The strain increment of the cell; zero, which costs least, at points that are done."""
        dstrain = torch.where(where[:, None], self.driven + self.control.freed(x), 0.0)
        return dstrain.to(self.control.cell.dtype)
