r"""Element tests: any material cell under strain control, or under mixed control.

At every step of a mixed test the strain increment is ``d_driven + free @ x``; Newton's method
finds x such that the held stresses meet their targets:

    r(x) = held @ stress(d_driven + free @ x) - target = 0
    x <- x - a (held @ C @ free)^-1 r,          C = d stress / d strain, the cell's tangent

with a = 1, or less where that does not lessen r. Where nothing does, the increment is cut in two.
Every iteration restarts from the stored state before the increment, and all points go through
the cell in one batch.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from granbench.cell import Conditions, MaterialCell
from granbench.errors import ConfigurationError
from granbench.paths.mixed_control import MixedControl

LEAST_TOLERANCE = 1e-9
ROUNDINGS = 100.0
"""A held stress may be off by so many unit roundings of the cell's type: in float32 that is
1.2e-5, for a network's stress is the sum of larger numbers."""

ITERATIONS = 30
HALVINGS = 8
"""Of the Newton step, before the increment is cut instead."""
ARMIJO = 1e-4
"""Share of the error that a full Newton step takes off at least; a shorter one, in proportion."""
SMALLEST_SHARE = 2.0**-10
"""Of a step, below which an increment is not cut."""

Answer = Callable[[Tensor, Tensor], tuple[Tensor, ...]]
"""A cell's `step` or `tangent`."""

FLOATING_FAILURES = (ArithmeticError, torch.linalg.LinAlgError)
"""What a cell may raise for a point that it cannot follow, in place of a NaN stress."""


@dataclass(frozen=True)
class Failure:
    """A point that could not be followed further.

    Parameters
    ----------
    point : its place in the batch
    step : the step that it did not reach
    missed_by : what was missing of the held stress, relative to the stress scale; NaN where the
        cell gave no stress
    """

    point: int
    step: int
    missed_by: float

    @property
    def reason(self) -> str:
        """What went wrong, as the end of a sentence."""
        if np.isnan(self.missed_by):
            return "the model gives no stress there"
        return (
            "no strain was found that meets the held stress, which is missed by "
            f"{100.0 * self.missed_by:.2g} % of the stress"
        )


@dataclass(frozen=True)
class ElementTest:
    """What a cell did in a test; NaN from the step at which a point failed.

    Parameters
    ----------
    strain : (point, step, component), cumulative, compression positive
    stress : (point, step, component), Pa
    internals : (point, step) under their dataset names
    state : (point, n_state) at the end, from which another test may start; at a failed point
        the last that was reached
    held_error : (point, step), largest error of a held stress relative to the stress scale
    increments : (point, step), in how many increments the step was taken; 0 at step 0
    failures : the points that were not followed to the end
    """

    strain: np.ndarray
    stress: np.ndarray
    internals: Mapping[str, np.ndarray]
    state: Tensor
    held_error: np.ndarray
    increments: np.ndarray
    failures: tuple[Failure, ...]


def run_test(
    cell: MaterialCell,
    control: MixedControl,
    start: Conditions | Tensor,
    *,
    tolerance: float | None = None,
    on_step: Callable[[int], None] | None = None,
) -> ElementTest:
    """Take a cell through a test.

    Parameters
    ----------
    cell : the model; known through the contract of material cells only
    control : what is prescribed, (point, step, ...)
    start : what is known at step 0, or the state (point, n_state) that a test ended with
    tolerance : of the held stresses, relative to the stress scale: the largest stress that the
        point has had, or was asked for, so far. 1e-9 by default, in float32 1.2e-5.
    on_step : called with the number of each step that is done

    Returns
    -------
    ElementTest; without held stresses it is the cell's rollout to the last bit

    Raises
    ------
    ConfigurationError
        If cell and control have different component orders.
    ModelError
        If the cell cannot start so.

    Notes
    -----
    A held combination's error is divided by the sum of the magnitudes of its row, so that the
    tolerance means the same for s33 = p0 and for s11 + s22 + s33 = 3 p0. A model that answers an
    increment differently when it is cut, as networks do, is cut as a last resort only;
    `ElementTest.increments` shows where.
    """
    if cell.order != control.order:
        raise ConfigurationError(
            f"{cell.name} has {cell.order} components, but the test is in {control.order} ones; "
            "make both in the same order"
        )
    rounding = ROUNDINGS * torch.finfo(cell.dtype).eps
    with torch.no_grad():
        state = start if isinstance(start, Tensor) else cell.initial_state(start)
        driver = _Driver(cell, control, state, tolerance or max(LEAST_TOLERANCE, rounding))
        for step in range(1, control.steps):
            driver.advance(step)
            if on_step is not None:
                on_step(step)
        return driver.result()


@dataclass(frozen=True)
class _Trial:
    """What the cell answers to trial values x of the free strains, (point, ...)."""

    x: Tensor
    stress: Tensor
    after: Tensor
    residual: Tensor
    error: Tensor

    def replaced(self, where: Tensor, other: "_Trial") -> "_Trial":
        """This trial, but the other one at the points where the mask is true."""
        merged = {}
        for name, own in vars(self).items():
            mask = where.reshape(-1, *(1,) * (own.ndim - 1))
            merged[name] = torch.where(mask, getattr(other, name), own)
        return _Trial(**merged)


class _Driver:
    """A batch of tests under way, and the records of the steps that are done."""

    def __init__(
        self, cell: MaterialCell, control: MixedControl, state: Tensor, tolerance: float
    ) -> None:
        self.cell, self.tolerance = cell, tolerance
        points, _, controls = control.targets.shape
        magnitude = np.abs(control.held).sum(axis=2, keepdims=True)
        self.driven = torch.from_numpy(control.driven)
        self.free = torch.from_numpy(control.free)
        self.held = torch.from_numpy(control.held / magnitude)
        self.targets = torch.from_numpy(control.targets / magnitude[:, None, :, 0])
        self.state = state
        self.stress = state[:, cell.layout["stress"]].double()
        self.scale = self.stress.abs().amax(dim=1)
        self.followed = torch.zeros(points, controls, dtype=torch.float64)
        self.alive = torch.ones(points, dtype=torch.bool)
        self.failures: list[Failure] = []
        # Of the last increment: what was driven, and the free strains that it took.
        self.last_driven = torch.zeros_like(self.driven[:, 0])
        self.last_free = torch.zeros_like(self.followed)
        self.rows: list[dict[str, Tensor]] = []
        zero = torch.zeros(points, dtype=torch.float64)
        self._record(0, zero, zero)

    def advance(self, step: int) -> None:
        """Take every point that is still followed to the next step."""
        change = self.driven[:, step] - self.driven[:, step - 1]
        change = torch.where(self.alive[:, None], change, 0.0)
        if self.followed.shape[1] == 0:
            stress, after, *_ = _surviving(self.cell.step, change.to(self.cell.dtype), self.state)
            done = self.alive & _finite(stress) & _finite(after)
            self._accept(done, stress, after)
            error = torch.where(done, 0.0, torch.nan).double()
            increments = torch.ones_like(error)
        else:
            error, increments, done = self._mixed(change, self.targets[:, step])
        for point in torch.nonzero(self.alive & ~done).flatten().tolist():
            self.failures.append(Failure(point, step, float(error[point])))
        self.alive = done
        self._record(step, error, increments)

    def _mixed(self, change: Tensor, target: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """One step of mixed control: error, number of increments, and what was reached."""
        begin = torch.einsum("pkc,pc->pk", self.held, self.stress)
        self.scale = torch.maximum(self.scale, target.abs().amax(dim=1))
        # Shares of the step are dyadic, so their sum is 1 to the last bit at its end.
        reached = torch.zeros(len(change), dtype=torch.float64)
        share = torch.ones_like(reached)
        error, increments = torch.zeros_like(reached), torch.zeros_like(reached)
        open_ = self.alive
        guess = self._extrapolated(change)
        while open_.any():
            part = torch.where(open_, share, 0.0)[:, None]
            wanted = begin + (reached[:, None] + part) * (target - begin)
            trial = self._newton(part * change, wanted, part * guess, open_)
            met = open_ & (trial.error <= self.tolerance)
            self._accept(met, trial.stress, trial.after)
            self.followed = torch.where(met[:, None], self.followed + trial.x, self.followed)
            self.last_free = torch.where(met[:, None], trial.x, self.last_free)
            self.last_driven = torch.where(met[:, None], part * change, self.last_driven)
            error = torch.where(open_, trial.error, error)
            increments = increments + met
            reached = torch.where(met, reached + share, reached)
            # A failed increment is tried again without the guess, which may have misled it.
            guess = torch.where(met[:, None], self._extrapolated(change), 0.0)
            share = torch.where(met, torch.minimum(2.0 * share, 1.0 - reached), 0.5 * share)
            open_ = open_ & (reached < 1.0) & (share >= SMALLEST_SHARE)
        left = (target - torch.einsum("pkc,pc->pk", self.held, self.stress)).abs().amax(dim=1)
        left = left / torch.where(self.scale > 0.0, self.scale, 1.0)
        error = torch.where(error.isfinite(), torch.maximum(error, left), torch.nan)
        return error, increments, self.alive & (reached == 1.0)

    def _extrapolated(self, change: Tensor) -> Tensor:
        """Free strains as in the last increment, for as much as is driven the same way."""
        squares = (self.last_driven**2).sum(dim=1)
        along = (self.last_driven * change).sum(dim=1)
        return (along / torch.where(squares > 0.0, squares, 1.0))[:, None] * self.last_free

    def _newton(self, driven: Tensor, target: Tensor, guess: Tensor, open_: Tensor) -> _Trial:
        """Iterate at the open points until each meets its target or gets no nearer."""
        at = self._trial(driven, target, guess, open_)
        for _ in range(ITERATIONS):
            going = open_ & (at.error > self.tolerance)
            if not going.any():
                break
            step = self._newton_step(driven, at, going)
            nearer = torch.zeros_like(going)
            for halving in range(HALVINGS + 1):
                length = 0.5**halving
                moving = going & ~nearer
                trial = self._trial(driven, target, at.x - length * step, moving)
                better = moving & (trial.error < (1.0 - ARMIJO * length) * at.error)
                at = at.replaced(better, trial)
                nearer = nearer | better
                if torch.equal(nearer, going):
                    break
            open_ = open_ & (nearer | ~going)
        return at

    def _newton_step(self, driven: Tensor, at: _Trial, going: Tensor) -> Tensor:
        """(held C free)^-1 r, (point, control); zero where that is undefined or not asked for."""
        dstrain = self._increment(driven, at.x, going)
        *_, stiffness = _surviving(self.cell.tangent, dstrain, self.state)
        matrix = self.held @ stiffness.double() @ self.free
        step, _ = torch.linalg.solve_ex(matrix.nan_to_num(), at.residual.nan_to_num())
        defined = going & _finite(step) & at.error.isfinite()
        return torch.where(defined[:, None], step, 0.0)

    def _trial(self, driven: Tensor, target: Tensor, x: Tensor, where: Tensor) -> _Trial:
        """The answer to x at the points asked for; meaningless at others."""
        dstrain = self._increment(driven, x, where)
        stress, after, *_ = _surviving(self.cell.step, dstrain, self.state)
        residual = torch.einsum("pkc,pc->pk", self.held, stress.double()) - target
        # A test that starts without stress has no scale yet but that of its first answer.
        scale = torch.where(self.scale > 0.0, self.scale, stress.double().abs().amax(dim=1))
        error = residual.abs().amax(dim=1) / torch.where(scale > 0.0, scale, 1.0)
        sound = _finite(stress) & _finite(after)
        return _Trial(x, stress, after, residual, torch.where(sound, error, torch.inf))

    def _increment(self, driven: Tensor, x: Tensor, where: Tensor) -> Tensor:
        """What the cell is given; zero, which costs it least, at points not asked for."""
        dstrain = torch.where(where[:, None], driven + self._freed(x), 0.0)
        return dstrain.to(self.cell.dtype)

    def _freed(self, x: Tensor) -> Tensor:
        return torch.einsum("pck,pk->pc", self.free, x)

    def _accept(self, done: Tensor, stress: Tensor, after: Tensor) -> None:
        """Move the points that are done to the end of an increment."""
        self.stress = torch.where(done[:, None], stress.double(), self.stress)
        # Component-major, as states are stored.
        self.state = torch.where(done, after.T, self.state.T).T
        largest = torch.maximum(self.scale, self.stress.abs().amax(dim=1))
        self.scale = torch.where(done, largest, self.scale)

    def _record(self, step: int, error: Tensor, increments: Tensor) -> None:
        strain = self.driven[:, step] + self._freed(self.followed)
        row = {"strain": strain, "stress": self.stress, "error": error, "increments": increments}
        for name in self.cell.internals:
            row[name] = self.state[:, self.cell.layout[name]].squeeze(-1)
        lost = ~self.alive
        self.rows.append(
            {
                name: values.masked_fill(lost.reshape(-1, *(1,) * (values.ndim - 1)), torch.nan)
                for name, values in row.items()
            }
        )

    def result(self) -> ElementTest:
        """The records so far."""
        series = {
            name: torch.stack([row[name] for row in self.rows], dim=1).double().numpy()
            for name in self.rows[0]
        }
        return ElementTest(
            strain=series.pop("strain"),
            stress=series.pop("stress"),
            held_error=series.pop("error"),
            increments=series.pop("increments"),
            internals=series,
            state=self.state,
            failures=tuple(self.failures),
        )


def _finite(values: Tensor) -> Tensor:
    return torch.isfinite(values).all(dim=1)


def _surviving(answer: Answer, dstrain: Tensor, state: Tensor) -> tuple[Tensor, ...]:
    """What a cell answers, NaN at a point for which it raises.

    Such a point does not take others down: the batch is halved until it is alone.
    """
    try:
        return answer(dstrain, state)
    except FLOATING_FAILURES:
        points, components = dstrain.shape
    if points == 1:
        shapes = (dstrain.shape, state.shape, (1, components, components))
        return tuple(dstrain.new_full(shape, torch.nan) for shape in shapes)
    middle = points // 2
    halves = [
        _surviving(answer, dstrain[part], state[part])
        for part in (slice(0, middle), slice(middle, points))
    ]
    return tuple(torch.cat(parts) for parts in zip(*halves, strict=False))
