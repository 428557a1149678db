"""Minimising the sum of squares from many starts in one batch: Adam, then Levenberg-Marquardt."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from granbench.fitting.least_squares import LeastSquares

LONGEST_STEP = 1.0
"""Largest Levenberg-Marquardt step in any parameter: a factor e of a positive one."""

SMALLEST_STEP = 1e-10
"""Step in every parameter below which it is rounding."""

CALM_STEPS = 2

FARTHEST = 12.0
"""Largest unconstrained number, a factor e^12 of a positive parameter."""

FIRST_DAMPING = 1e-3
DAMPING_UP = 2.0
"""Factor after a failed step; it doubles with every consecutive failure."""
GREATEST_FALL = 0.1
"""Largest decrease of the damping, after a step that matched its linearisation."""
LARGEST_DAMPING = 1e10
SMALLEST_DAMPING = 1e-15
TINY = torch.finfo(torch.float64).tiny


@dataclass(frozen=True)
class Effort:
    """Length of the search.

    Parameters
    ----------
    adam_iterations, learning_rate : of the first stage, by back-propagation
    iterations : of Levenberg-Marquardt, at most
    tolerance : relative decrease of the sum of squares below which a start has converged, if two
        consecutive steps bring no more
    """

    adam_iterations: int = 5
    learning_rate: float = 0.1
    iterations: int = 60
    tolerance: float = 1e-5

    def limited(self, total: int | None) -> "Effort":
        """The effort with at most `total` iterations of both stages; unchanged where None."""
        if total is None:
            return self
        adam_iterations = min(self.adam_iterations, total)
        iterations = min(self.iterations, total - adam_iterations)
        return replace(self, adam_iterations=adam_iterations, iterations=iterations)


@dataclass(frozen=True)
class Minimum:
    """Final state of the search from each start.

    Parameters
    ----------
    vectors : (start, parameter)
    cost : (start,), sum of squared residuals
    converged : (start,), whether it stopped because the cost no longer decreased
    iterations : (start,), of Levenberg-Marquardt
    """

    vectors: Tensor
    cost: Tensor
    converged: Tensor
    iterations: Tensor


OnIteration = Callable[[str, int, float], None]
"""Called with the stage, its iteration and the lowest cost."""


def adam(problem: LeastSquares, vectors: Tensor, effort: Effort, on: OnIteration | None) -> Tensor:
    """The vectors (start, parameter) after a descent along back-propagated gradients.

    The best vector of every start is returned, so a step that the model cannot follow does no harm.
    """
    vectors = vectors.clone().requires_grad_()
    optimiser = torch.optim.Adam([vectors], lr=effort.learning_rate)
    best = vectors.detach().clone()
    lowest = torch.full((len(vectors),), torch.inf, dtype=torch.float64)
    for iteration in range(effort.adam_iterations):
        optimiser.zero_grad()
        loss = problem.loss(vectors)
        # The logarithm makes a start far from the data move like one that is near.
        reached = loss[loss.isfinite()]
        if not reached.requires_grad:
            break
        reached.clamp(min=TINY).log().sum().backward()
        with torch.no_grad():
            better = loss < lowest
            best = torch.where(better[:, None], vectors, best)
            lowest = torch.where(better, loss, lowest)
            if vectors.grad is not None:
                vectors.grad = torch.nan_to_num(vectors.grad, posinf=0.0, neginf=0.0)
        if on is not None:
            on("adam", iteration + 1, float(lowest.min()))
        optimiser.step()
        with torch.no_grad():
            vectors.clamp_(-FARTHEST, FARTHEST)
    return best.detach()


def levenberg_marquardt(
    problem: LeastSquares,
    vectors: Tensor,
    effort: Effort,
    on: OnIteration | None = None,
    offset: Tensor | None = None,
    stop: Callable[[], bool] | None = None,
) -> Minimum:
    """Minimise |r(u) + offset|^2 from every start, each with a damping of its own.

    Parameters
    ----------
    problem : residuals and their Jacobian
    vectors : (start, parameter)
    effort : when to stop
    on : called after each iteration
    offset : (start, residual), added to the residuals, for the noise of the bootstrap
    stop : called before each iteration; true ends the search

    References
    ----------
    Levenberg (1944), Quart. Appl. Math. 2(2): the damping. Nielsen (1999), IMM-REP-1999-05: how it
    follows the ratio of the decrease to that of the linearisation.
    """
    search = _Search(problem, vectors, offset, effort.tolerance)
    for iteration in range(effort.iterations):
        if not search.running.any() or (stop is not None and stop()):
            break
        search.iterate()
        if on is not None:
            on("levenberg-marquardt", iteration + 1, float(search.cost.min()))
    return Minimum(search.vectors, search.cost, search.converged, search.iterations)


class _Search:
    """State of the search from every start: vector, linearised problem and damping.

    Attributes
    ----------
    vectors, cost, converged, iterations : see `Minimum`
    running : (start,), whether each continues
    """

    def __init__(
        self, problem: LeastSquares, vectors: Tensor, offset: Tensor | None, tolerance: float
    ) -> None:
        count, size = vectors.shape
        self._problem, self._tolerance = problem, tolerance
        self._offset = torch.zeros(count, 1).double() if offset is None else offset
        self.vectors = vectors.clone()
        self._at = problem.evaluated(vectors)
        self.cost = ((self._at.residuals + self._offset) ** 2).sum(dim=1)
        self.running = self.cost.isfinite()
        self.converged = torch.zeros(count, dtype=torch.bool)
        self.iterations = torch.zeros(count, dtype=torch.int64)
        # Of the linearised problem: J^T J and J^T r, and where they are of an earlier vector.
        self._normal = torch.zeros(count, size, size, dtype=torch.float64)
        self._gradient = torch.zeros(count, size, dtype=torch.float64)
        self._stale = torch.ones(count, dtype=torch.bool)
        self._damping = torch.full((count,), FIRST_DAMPING, dtype=torch.float64)
        self._growth = torch.full((count,), DAMPING_UP, dtype=torch.float64)
        self._calm = torch.zeros(count, dtype=torch.int64)

    def iterate(self) -> None:
        """Try one step of every start that is running."""
        self._linearise()
        going = torch.nonzero(self.running).flatten()
        normal, gradient = self._normal[going], self._gradient[going]
        before, vectors = self.cost[going], self.vectors[going]
        step = _damped_step(normal, gradient, self._damping[going], vectors)
        trial = (vectors + step).clamp(-FARTHEST, FARTHEST)
        evaluated = self._problem.evaluated(trial)
        cost = ((evaluated.residuals + self._offset[going]) ** 2).sum(dim=1)
        better = cost < before
        promised = -2.0 * torch.einsum("vp,vp->v", gradient, step)
        promised = promised - torch.einsum("vp,vpq,vq->v", step, normal, step)

        self.vectors[going] = torch.where(better[:, None], trial, vectors)
        self.cost[going] = torch.where(better, cost, before)
        gained = torch.nonzero(better).flatten()
        self._at = self._at.replaced(going[gained], evaluated.of(gained))
        self._stale[going] = better
        self.iterations[going] += 1
        self._damp(going, better, (before - cost) / promised.clamp(min=TINY))
        # A step whose length was limited does not show how far the minimum is.
        stretched = (step.abs() >= LONGEST_STEP).any(dim=1)
        quiet = better & ((before - cost) < self._tolerance * before) & ~stretched
        self._settle(going, quiet, (trial - vectors).abs().amax(dim=1))

    def _linearise(self) -> None:
        """J^T J and J^T r of the running starts that have moved."""
        moved = torch.nonzero(self.running & self._stale).flatten()
        if not moved.numel():
            return
        known = self._at.of(moved)
        jacobian = self._problem.jacobian(self.vectors[moved], known)
        residual = known.residuals + self._offset[moved]
        self._normal[moved] = jacobian.mT @ jacobian
        self._gradient[moved] = torch.einsum("vrp,vr->vp", jacobian, residual)

    def _damp(self, going: Tensor, better: Tensor, ratio: Tensor) -> None:
        """Less after a success, in the measure of its ratio to what was promised; else more."""
        fall = (1.0 - (2.0 * ratio - 1.0) ** 3).clamp(GREATEST_FALL, DAMPING_UP)
        growth = self._growth[going]
        damping = self._damping[going] * torch.where(better, fall, growth)
        self._damping[going] = damping.clamp(min=SMALLEST_DAMPING)
        self._growth[going] = torch.where(better, DAMPING_UP, 2.0 * growth)

    def _settle(self, going: Tensor, quiet: Tensor, moved: Tensor) -> None:
        """End the starts that have nothing left to gain."""
        self._calm[going] = torch.where(quiet, self._calm[going] + 1, 0)
        settled = (self._calm[going] >= CALM_STEPS) | (moved < SMALLEST_STEP)
        # Damped beyond measure without a gain: the point is a minimum to rounding, or a kink.
        settled |= self._damping[going] > LARGEST_DAMPING
        self.converged[going] = settled
        self.running[going] = ~settled


def _damped_step(normal: Tensor, gradient: Tensor, damping: Tensor, vectors: Tensor) -> Tensor:
    """-(J^T J + damping max(diag J^T J) I)^-1 J^T r, (start, parameter), within its bounds.

    No component is longer than allowed or leads out of the range that is searched. One that would
    is held at its bound and the others are solved for again, so that a parameter that hardly acts
    neither shortens the steps of those that do nor makes the search look as if it had arrived. The
    unconstrained numbers are of one size, so one damping holds all of them.
    """
    largest = normal.diagonal(dim1=1, dim2=2).amax(dim=1).clamp(min=TINY)
    identity = torch.eye(normal.shape[1], dtype=normal.dtype)
    damped = normal + (damping * largest)[:, None, None] * identity
    lower = (-FARTHEST - vectors).clamp(min=-LONGEST_STEP)
    upper = (FARTHEST - vectors).clamp(max=LONGEST_STEP)
    step, held = torch.zeros_like(gradient), torch.zeros_like(gradient, dtype=torch.bool)
    for _ in range(normal.shape[1] + 1):
        matrix = torch.where(held[..., None], identity, damped)
        pushed = torch.where(held, step, -gradient)
        solved, _ = torch.linalg.solve_ex(matrix, pushed)
        solved = solved.nan_to_num()
        beyond = ~held & ((solved < lower) | (solved > upper))
        step = torch.where(held, step, torch.minimum(torch.maximum(solved, lower), upper))
        if not beyond.any():
            break
        held = held | beyond
    return step
