"""Element tests: any material cell under strain control, or under mixed control.

A step of mixed control is one increment of `granbench.element_test.stress_control`; where no free
strain meets the targets, the increment is divided in two. All points go through the cell in one
batch, each with its own increments.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from granbench.cells.contract import Conditions, MaterialCell
from granbench.cells.difference_tangent import with_cheap_tangent
from granbench.cells.robust_runs import finite_points, robust_call
from granbench.element_test.stress_control import IterationLimits, StressControl
from granbench.errors import ConfigurationError
from granbench.paths.mixed_control import MixedControl

LEAST_TOLERANCE = 1e-9
ROUNDINGS = 100.0
"""Least tolerance of a held stress in unit roundings of the cell's type: 1.2e-5 in float32, because
a network's stress is the sum of larger numbers."""


@dataclass(frozen=True)
class Failure:
    """The step at which a point failed.

    Parameters
    ----------
    point : its place in the batch
    step : the step that it did not reach
    missed_by : error of the held stress relative to the stress scale; NaN where the cell gave no
        stress
    """

    point: int
    step: int
    missed_by: float

    @property
    def reason(self) -> str:
        """Why it failed, as the end of a sentence."""
        if np.isnan(self.missed_by):
            return "the model gives no stress there"
        return (
            "no strain was found that meets the held stress, which is missed by "
            f"{100.0 * self.missed_by:.2g} % of the stress"
        )


@dataclass(frozen=True)
class ElementTest:
    """The results of a test; NaN from the step at which a point failed.

    Parameters
    ----------
    strain : (point, step, component), cumulative, compression positive
    stress : (point, step, component), Pa
    internals : (point, step) under their dataset names
    state : (point, n_state) at the end, from which another test may start; at a failed point
        the last one that was computed
    held_error : (point, step), largest error of a held stress relative to the stress scale
    increments : (point, step), number of increments into which the step was divided; 0 at step 0
    failures : of the points that did not reach the end
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
    limits: IterationLimits | None = None,
    on_step: Callable[[int], None] | None = None,
) -> ElementTest:
    """Take a cell through a test.

    Parameters
    ----------
    cell : the model
    control : what is prescribed, (point, step, ...)
    start : what is known at step 0, or the state (point, n_state) that a test ended with
    tolerance : of the held stresses, relative to the stress scale: the largest stress that the
        point has had, or had as a target, so far. 1e-9 by default, in float32 1.2e-5.
    limits : how much is tried before a point counts as failed
    on_step : called with the number of each step that is done

    Returns
    -------
    ElementTest; without held stresses its stress is that of the cell's rollout to the last bit

    Raises
    ------
    ConfigurationError
        If cell and control have different component orders, or the tolerance is not positive.
    ModelError
        If the cell cannot start from the given conditions.

    Notes
    -----
    A held combination's error is divided by the sum of the magnitudes of its row, so that the
    tolerance means the same for s33 = p0 and for s11 + s22 + s33 = 3 p0. The stress of some models,
    such as networks, changes when an increment is divided; that is done only where nothing else
    meets the target, and `ElementTest.increments` shows where.
    """
    if cell.order != control.order:
        raise ConfigurationError(
            f"{cell.name} has {cell.order} components, but the test is in {control.order} ones; "
            f"make the cell with order={control.order!r}, or the test in {cell.order} components"
        )
    if tolerance is None:
        tolerance = max(LEAST_TOLERANCE, ROUNDINGS * torch.finfo(cell.dtype).eps)
    elif not 0.0 < tolerance < 1.0:
        raise ConfigurationError(
            f"tolerance={tolerance:g} must lie in (0, 1); give a share of the stress, as 1e-4"
        )
    with torch.no_grad():
        state = start if isinstance(start, Tensor) else cell.initial_state(start)
        test = _RunningTest(cell, control, state, tolerance, limits or IterationLimits())
        for step in range(1, control.steps):
            test.advance(step)
            if on_step is not None:
                on_step(step)
        return test.result()


class _RunningTest:
    """A batch of tests while they run, and the records of the steps that are done."""

    def __init__(
        self,
        cell: MaterialCell,
        control: MixedControl,
        state: Tensor,
        tolerance: float,
        limits: IterationLimits,
    ) -> None:
        self.cell = cell
        points, _, controls = control.targets.shape
        magnitude = np.abs(control.held).sum(axis=2, keepdims=True)
        self.control = StressControl(
            with_cheap_tangent(cell),
            torch.from_numpy(control.free),
            torch.from_numpy(control.held / magnitude),
            tolerance,
            limits,
        )
        self.driven = torch.from_numpy(control.driven)
        self.targets = torch.from_numpy(control.targets / magnitude[:, None, :, 0])
        self.state = state
        self.stress = state[:, cell.layout["stress"]].double()
        self.scale = self.stress.abs().amax(dim=1)
        self.free_strain = torch.zeros(points, controls, dtype=torch.float64)
        self.active = torch.ones(points, dtype=torch.bool)
        self.failures: list[Failure] = []
        # The prescribed and the free strains of the last increment.
        self.last_driven = torch.zeros_like(self.driven[:, 0])
        self.last_free = torch.zeros_like(self.free_strain)
        self.rows: list[Tensor] = []
        zero = torch.zeros(points, dtype=torch.float64)
        self._record(0, zero, zero)

    def advance(self, step: int) -> None:
        """Take every point that has not failed to the next step."""
        change = self.driven[:, step] - self.driven[:, step - 1]
        change = torch.where(self.active[:, None], change, 0.0)
        if self.free_strain.shape[1] == 0:
            stress, after, *_ = robust_call(self.cell.step, change.to(self.cell.dtype), self.state)
            done = self.active & finite_points(stress) & finite_points(after)
            self._accept(done, stress, after)
            error = torch.where(done, 0.0, torch.nan).double()
            increments = torch.ones_like(error)
        else:
            error, increments, done = self._mixed(change, self.targets[:, step])
        for point in torch.nonzero(self.active & ~done).flatten().tolist():
            self.failures.append(Failure(point, step, float(error[point])))
        self.active = done
        self._record(step, error, increments)

    def _mixed(self, change: Tensor, target: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """One step of mixed control: error, number of increments, and whether it was completed."""
        begin = self.control.combined(self.stress)
        self.scale = torch.maximum(self.scale, target.abs().amax(dim=1))
        # Shares of the step are dyadic, so their sum is 1 to the last bit at its end.
        reached = torch.zeros(len(change), dtype=torch.float64)
        share = torch.ones_like(reached)
        error, increments = torch.zeros_like(reached), torch.zeros_like(reached)
        unfinished = self.active
        limits, failed_calls = self.control.limits, torch.zeros(len(change), dtype=torch.int64)
        guess = self._extrapolated(change)
        while unfinished.any():
            part = torch.where(unfinished, share, 0.0)[:, None]
            wanted = begin + (reached[:, None] + part) * (target - begin)
            trial, failed = self.control.solve(
                self.state, part * change, wanted, part * guess, unfinished, self.scale
            )
            failed_calls = failed_calls + failed
            met = unfinished & (trial.error <= self.control.tolerance)
            self._accept(met, trial.stress, trial.state)
            strain = self.free_strain + trial.x
            self.free_strain = torch.where(met[:, None], strain, self.free_strain)
            self.last_free = torch.where(met[:, None], trial.x, self.last_free)
            self.last_driven = torch.where(met[:, None], part * change, self.last_driven)
            error = torch.where(unfinished, trial.error, error)
            increments = increments + met
            reached = torch.where(met, reached + share, reached)
            # A failed increment is repeated without its first guess before it is divided.
            had_guess = ~met & (guess != 0.0).any(dim=1)
            smaller = torch.where(had_guess, share, 0.5 * share)
            share = torch.where(met, torch.minimum(2.0 * share, 1.0 - reached), smaller)
            guess = torch.where(met[:, None], self._extrapolated(change), 0.0)
            may_retry = share >= limits.smallest_share
            may_retry = may_retry & (failed_calls < limits.failed_calls)
            unfinished = unfinished & (reached < 1.0) & (met | may_retry)
        left = (target - self.control.combined(self.stress)).abs().amax(dim=1)
        left = left / torch.where(self.scale > 0.0, self.scale, 1.0)
        error = torch.where(error.isfinite(), torch.maximum(error, left), torch.nan)
        return error, increments, self.active & (reached == 1.0)

    def _extrapolated(self, change: Tensor) -> Tensor:
        """Free strains of the last increment, in proportion to the prescribed strain along it."""
        squares = (self.last_driven**2).sum(dim=1)
        along = (self.last_driven * change).sum(dim=1)
        return (along / torch.where(squares > 0.0, squares, 1.0))[:, None] * self.last_free

    def _accept(self, done: Tensor, stress: Tensor, after: Tensor) -> None:
        """Move the points that are done to the end of an increment."""
        self.stress = torch.where(done[:, None], stress.double(), self.stress)
        # Component-major, as states are stored.
        self.state = torch.where(done, after.T, self.state.T).T
        largest = torch.maximum(self.scale, self.stress.abs().amax(dim=1))
        self.scale = torch.where(done, largest, self.scale)

    def _record(self, step: int, error: Tensor, increments: Tensor) -> None:
        strain = self.driven[:, step] + self.control.freed(self.free_strain)
        internals = [self.state[:, self.cell.layout[name]] for name in self.cell.internals]
        row = torch.cat(
            [strain, self.stress, error[:, None], increments[:, None], *internals], dim=1
        )
        self.rows.append(torch.where(self.active[:, None], row, torch.nan))

    def result(self) -> ElementTest:
        """The records so far."""
        rows = torch.stack(self.rows, dim=1).numpy()
        count = self.driven.shape[2]
        strain, stress, error, increments, *internals = np.split(
            rows, np.cumsum([count, count, *[1] * (2 + len(self.cell.internals))])[:-1], axis=2
        )
        return ElementTest(
            strain=strain,
            stress=stress,
            held_error=error[..., 0],
            increments=increments[..., 0],
            internals={
                name: series[..., 0]
                for name, series in zip(self.cell.internals, internals, strict=True)
            },
            state=self.state,
            failures=tuple(self.failures),
        )
