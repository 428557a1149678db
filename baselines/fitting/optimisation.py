"""Minimising the sum of squares from many starts in one batch: Adam, then Levenberg-Marquardt."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from granbench.baselines.fitting.problem import Problem

LONGEST_STEP = 1.0
"""Of a Levenberg-Marquardt step in any parameter: a factor e of a positive one."""

FARTHEST = 12.0
"""Size of an unconstrained number, e^12 of a positive parameter, at which it is stopped."""

FIRST_DAMPING = 1e-2
DAMPING_UP, DAMPING_DOWN = 4.0, 0.3
LARGEST_DAMPING = 1e10
SMALLEST_DAMPING = 1e-12


@dataclass(frozen=True)
class Effort:
    """How long is searched.

    Parameters
    ----------
    adam_iterations, learning_rate : of the first stage, by back-propagation
    iterations : of Levenberg-Marquardt, at most
    tolerance : relative decrease of the sum of squares, and size of a step, below which a start
        has converged
    """

    adam_iterations: int = 20
    learning_rate: float = 0.1
    iterations: int = 60
    tolerance: float = 1e-8


@dataclass(frozen=True)
class Minimum:
    """Where each start ended.

    Parameters
    ----------
    vectors : (start, parameter)
    cost : (start,), sum of squared residuals
    converged : (start,), whether it stopped because nothing was left to gain
    iterations : (start,), of Levenberg-Marquardt
    """

    vectors: Tensor
    cost: Tensor
    converged: Tensor
    iterations: Tensor


OnIteration = Callable[[str, int, float], None]
"""Called with the stage, its iteration and the lowest cost."""


def adam(problem: Problem, vectors: Tensor, effort: Effort, on: OnIteration | None) -> Tensor:
    """The vectors (start, parameter) after a descent along back-propagated gradients.

    Of every start the best vector that was met is returned: a step that the model cannot follow
    does no harm.
    """
    vectors = vectors.clone().requires_grad_()
    optimiser = torch.optim.Adam([vectors], lr=effort.learning_rate)
    best = vectors.detach().clone()
    lowest = torch.full((len(vectors),), torch.inf, dtype=torch.float64)
    for iteration in range(effort.adam_iterations):
        optimiser.zero_grad()
        loss = problem.loss(vectors)
        # The logarithm makes a start far from the data move like one that is near.
        loss.clamp(min=torch.finfo(loss.dtype).tiny).log().sum().backward()
        with torch.no_grad():
            better = loss < lowest
            best = torch.where(better[:, None], vectors, best)
            lowest = torch.where(better, loss, lowest)
            vectors.grad = torch.nan_to_num(vectors.grad, posinf=0.0, neginf=0.0)
        if on is not None:
            on("adam", iteration + 1, float(lowest.min()))
        optimiser.step()
        with torch.no_grad():
            vectors.clamp_(-FARTHEST, FARTHEST)
    return best.detach()


def levenberg_marquardt(
    problem: Problem,
    vectors: Tensor,
    effort: Effort,
    on: OnIteration | None = None,
    offset: Tensor | None = None,
) -> Minimum:
    """Minimise |r(u) + offset|^2 from every start, each with a damping of its own.

    Parameters
    ----------
    problem : residuals and their Jacobian
    vectors : (start, parameter)
    effort : when to stop
    on : called after each iteration
    offset : (start, residual), added to the residuals; the bootstrap puts its noise there

    References
    ----------
    Marquardt (1963), SIAM J. Appl. Math. 11(2): damping scaled by the diagonal of J^T J.
    """
    count, size = vectors.shape
    vectors = vectors.clone()
    noise = torch.zeros(count, 1, dtype=torch.float64) if offset is None else offset
    cost = ((problem.residuals(vectors) + noise) ** 2).sum(dim=1)
    damping = torch.full((count,), FIRST_DAMPING, dtype=torch.float64)
    converged = torch.zeros(count, dtype=torch.bool)
    iterations = torch.zeros(count, dtype=torch.int64)
    running = cost.isfinite()
    stale = torch.ones(count, dtype=torch.bool)
    normal = torch.zeros(count, size, size, dtype=torch.float64)
    gradient = torch.zeros(count, size, dtype=torch.float64)
    for iteration in range(effort.iterations):
        if not running.any():
            break
        if (fresh := torch.nonzero(running & stale).flatten()).numel():
            residual, jacobian = problem.linearised(vectors[fresh])
            residual = residual + noise[fresh]
            normal[fresh] = jacobian.mT @ jacobian
            gradient[fresh] = torch.einsum("vrp,vr->vp", jacobian, residual)
        at = torch.nonzero(running).flatten()
        step = _damped_step(normal[at], gradient[at], damping[at])
        trial = (vectors[at] + step).clamp(-FARTHEST, FARTHEST)
        trial_cost = ((problem.residuals(trial) + noise[at]) ** 2).sum(dim=1)
        better = trial_cost < cost[at]
        gain = (cost[at] - trial_cost) / cost[at].clamp(min=torch.finfo(cost.dtype).tiny)
        moved = (trial - vectors[at]).abs().amax(dim=1)
        settled = (better & (gain < effort.tolerance)) | (moved < effort.tolerance)
        vectors[at] = torch.where(better[:, None], trial, vectors[at])
        cost[at] = torch.where(better, trial_cost, cost[at])
        stale[at] = better
        factor = torch.where(better, DAMPING_DOWN, DAMPING_UP)
        damping[at] = (damping[at] * factor).clamp(min=SMALLEST_DAMPING)
        iterations[at] += 1
        # Damped beyond measure without a gain: the point is a minimum to rounding, or a kink.
        settled |= damping[at] > LARGEST_DAMPING
        converged[at] = settled
        running[at] = ~settled
        if on is not None:
            on("levenberg-marquardt", iteration + 1, float(cost.min()))
    return Minimum(vectors, cost, converged, iterations)


def _damped_step(normal: Tensor, gradient: Tensor, damping: Tensor) -> Tensor:
    """-(J^T J + damping diag(J^T J))^-1 J^T r, (start, parameter), no longer than allowed."""
    diagonal = normal.diagonal(dim1=1, dim2=2)
    # A parameter without any influence must not make the matrix singular: it stays put.
    floor = 1e-12 * diagonal.amax(dim=1, keepdim=True).clamp(min=torch.finfo(normal.dtype).tiny)
    damped = normal + torch.diag_embed(damping[:, None] * diagonal.clamp(min=floor) + floor)
    step, _ = torch.linalg.solve_ex(damped, -gradient)
    step = step.nan_to_num()
    length = step.abs().amax(dim=1, keepdim=True)
    return step * (LONGEST_STEP / length.clamp(min=LONGEST_STEP))
