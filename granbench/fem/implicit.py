r"""Implicit statics: load steps, each iterated until the forces balance.

    r(du) = P - I(sigma(B du)) = 0      for the free displacements

where the material goes from its last converged state over the whole increment du of the load step
in every iteration, as in Algorithm 2. The named schemes differ in how du is improved; they are in
`granbench.fem.iteration`. A load step in which the scheme fails is cut in two, as often as
allowed. Iterations begin at the last increment, scaled by the driving displacement; where that does
not converge or the drive turned, they begin at the prescribed motion spread over the body.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from granbench.errors import AnalysisError
from granbench.fem.assembled_loading import AssembledLoading
from granbench.fem.balance import Balance
from granbench.fem.explicit import OnStep
from granbench.fem.gauss_points import GaussPoints, MaterialFailure
from granbench.fem.implicit_settings import ImplicitSettings
from granbench.fem.iteration import IterationResult, Scheme, scheme_of
from granbench.fem.loading import LoadingHistory
from granbench.fem.mesh import Floats
from granbench.fem.operators import Operators
from granbench.fem.result import Recorder


def load_times(drive: LoadingHistory, steps: int) -> Floats:
    """Times of the load steps, s, from 0; every turning point of the drive is one.

    Parameters
    ----------
    drive : the driving displacement
    steps : number of load steps; turning points may add some
    """
    ends = np.asarray(drive.times)
    counts = np.maximum(1, np.round(steps * np.diff(ends) / drive.end).astype(int))
    pieces = [
        np.linspace(begin, end, count, endpoint=False)
        for begin, end, count in zip(ends[:-1], ends[1:], counts, strict=True)
    ]
    return np.concatenate([*pieces, ends[-1:]])


def solve_implicit(
    operators: Operators,
    loading: AssembledLoading,
    points: GaussPoints,
    settings: ImplicitSettings,
    recorder: Recorder,
    on_step: OnStep | None = None,
) -> None:
    """Analyse a loading; load steps go to the recorder as they converge.

    Raises
    ------
    ConfigurationError
        If the scheme lacks a stiffness.
    AnalysisError
        If a load step does not converge, or the material fails, however small the step.
    """
    stepper = _Stepper(operators, loading, points, settings)
    stepper.record(recorder, _StepRecord())
    points.measure_initial_imbalance()
    scheme = scheme_of(settings, stepper.balance)
    times = load_times(loading.loading.drive, settings.steps)
    for step in range(1, len(times)):
        stepper.record(recorder, stepper.advance(scheme, times[step - 1], times[step], step))
        if on_step is not None:
            on_step(step, len(times) - 1)


@dataclass(frozen=True)
class _StepRecord:
    """Iterations of one load step; the residuals are those of its last piece."""

    pieces: int = 0
    iterations: int = 0
    residuals: tuple[float, ...] = ()


@dataclass(frozen=True)
class _Attempt:
    """Result of the iterations on a piece of a load step.

    Parameters
    ----------
    outcome : of the last guess from which the scheme did not fail in the material, if any
    failure : of the material, from any of the guesses
    iterations : over all guesses
    """

    outcome: IterationResult | None
    failure: MaterialFailure | None
    iterations: int


class _Stepper:
    """A body and its state, advanced load step by load step."""

    def __init__(
        self,
        operators: Operators,
        loading: AssembledLoading,
        points: GaussPoints,
        settings: ImplicitSettings,
    ) -> None:
        self.begin = time.perf_counter()
        self.loading, self.points, self.settings = loading, points, settings
        self.balance = Balance(operators, points, loading.free_places)
        self.displacement = np.zeros(2 * operators.node_count)
        self.last, self.last_move = np.zeros_like(self.displacement), 0.0
        self.internal = operators.force @ points.stress
        self.external = loading.external_force(loading.force_values(0.0))
        self.balance.internal, self.balance.external = self.internal, self.external
        self.balance.keep()
        self.time = 0.0
        self.internal_work = self.external_work = 0.0

    def advance(self, scheme: Scheme, begin: float, end: float, step: int) -> _StepRecord:
        """One load step, in pieces: half the size after a failure, doubled after each success."""
        drive, record = self.loading.loading.drive, _StepRecord()
        done, share = 0.0, 1.0
        while done < 1.0:
            until = end if done + share >= 1.0 else begin + (done + share) * (end - begin)
            move = float(drive.at(until) - drive.at(self.time))
            attempt = self._attempt(scheme, until, move, step)
            outcome, iterations = attempt.outcome, record.iterations + attempt.iterations
            if outcome is not None and outcome.converged:
                self._keep(outcome.increment, move, until)
                record = _StepRecord(record.pieces + 1, iterations, outcome.residuals)
                done += share
                share = min(2.0 * share, 1.0 - done)
            else:
                record = replace(record, iterations=iterations)
                share *= 0.5
                if share < 0.5**self.settings.cuts:
                    raise self._failed(scheme, attempt, step)
        return record

    def _attempt(self, scheme: Scheme, until: float, move: float, step: int) -> _Attempt:
        """Iterate to equilibrium at a time, starting from one guess after the other."""
        outcome, failure, iterations = None, None, 0
        self.balance.aim_at(self.loading.external_force(self.loading.force_values(until)), step)
        for guess in self._guesses(move):
            try:
                outcome = scheme(guess)
            except MaterialFailure as problem:
                failure = problem
                continue
            iterations += len(outcome.residuals) - 1
            if outcome.converged:
                break
        return _Attempt(outcome, failure, iterations)

    def _guesses(self, move: float) -> list[Floats]:
        """First guesses of an increment, the more promising one first."""
        spread = move * self.loading.spread
        if move * self.last_move > 0.0:
            return [np.where(self.loading.fixed, spread, move / self.last_move * self.last), spread]
        return [spread]

    def _keep(self, increment: Floats, move: float, until: float) -> None:
        """Accept the state of the last iteration."""
        self.points.accept()
        self.balance.keep()
        internal, external = self.balance.internal, self.balance.external
        reaction = self.loading.reaction(self.internal, self.external)
        later = self.loading.reaction(internal, external)
        self.internal_work += 0.5 * float((self.internal + internal) @ increment)
        self.external_work += 0.5 * float((self.external + external) @ increment)
        self.external_work += 0.5 * (reaction + later) * move
        self.displacement += increment
        self.internal, self.external = internal, external
        self.last, self.last_move, self.time = increment, move, until

    def _failed(self, scheme: Scheme, attempt: _Attempt, step: int) -> AnalysisError:
        """Error of a load step: the material's own where every guess failed in the material."""
        outcome = attempt.outcome
        if outcome is None and attempt.failure is not None:
            return attempt.failure
        residual = outcome.residuals[-1] if outcome is not None else np.nan
        return AnalysisError(
            f"load step {step} does not converge with the scheme {self.settings.scheme!r}, even in "
            f"{2**self.settings.cuts} pieces: the residual is {residual:.2g} of the forces; "
            f"{scheme.remedy}"
        )

    def record(self, recorder: Recorder, step: _StepRecord) -> None:
        """Add the present load step to the recorder."""
        parts = self.internal_work, self.external_work
        seconds = time.perf_counter() - self.begin
        recorder.add(
            self.displacement,
            driving_displacement=float(self.loading.loading.drive.at(self.time)),
            residuals=step.residuals,
            time=self.time,
            reaction=self.loading.reaction(self.internal, self.external),
            iterations=step.iterations,
            pieces=step.pieces,
            internal_energy=self.internal_work,
            external_work=self.external_work,
            energy_error=(parts[0] - parts[1]) / (max(map(abs, parts)) or 1.0),
            cell_seconds=self.points.seconds,
            solver_seconds=seconds - self.points.seconds,
        )
