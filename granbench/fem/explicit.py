r"""Explicit dynamics: Algorithm 3 with damping relative to the prescribed motion.

    M a = P - I - C (v - v_d),   C = c A = alpha M,   c = 2 gamma sqrt(rho E)   (Eq 5.3, 5.9)
    v(n+1/2) = v(n-1/2) + dt a(n),   u(n+1) = u(n) + dt v(n+1/2)                (Eq 5.4)

with the lumped mass M, the nodes' shares A of the area, and v_d the prescribed motion spread over
the body (`granbench.fem.loading.spread_motion`), in which damping and inertia have no part. The
damping force uses the mean of v - v_d before and after the instant, so that it does not narrow
the stability limit of central differences, 2/omega_max.

Energy is recorded in the form that central differences conserve, with the kinetic energy
``m v(n-1/2) v(n+1/2)/2``: kinetic + internal + damping = external to rounding, whatever the
material. Internal work is that of the nodal forces of the stresses, external work that of
reactions, loads and weight, and of the impulses by which v_d changes.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch

from granbench.errors import AnalysisError
from granbench.fem.assembled_loading import AssembledLoading
from granbench.fem.gauss_points import GaussPoints
from granbench.fem.mesh import Floats
from granbench.fem.operators import Operators
from granbench.fem.result import Recorder
from granbench.fem.time_step import ExplicitSettings, choose_time_step, output_steps

EVEN = 1e-9
"""Moves of a time step that differ by less, relatively, are at one speed: rounding of the times
makes them differ by some 1e-12."""

OnStep = Callable[[int, int], None]
"""Called at output steps with the number of the step that is done, and how many there are."""


def solve_explicit(
    operators: Operators,
    loading: AssembledLoading,
    points: GaussPoints,
    settings: ExplicitSettings,
    recorder: Recorder,
    on_step: OnStep | None = None,
) -> None:
    """Analyse a loading; output steps go to the recorder as they are reached.

    Raises
    ------
    ConfigurationError
        If the time step is unstable.
    AnalysisError
        If the material fails, or becomes so stiff that the time step is unstable.
    """
    begin = time.perf_counter()
    motion = _Motion(operators, loading, points, settings)
    motion.record(recorder, time.perf_counter() - begin, 0)
    points.measure_initial_imbalance()
    step = choose_time_step(operators, points, settings)
    end = loading.loading.drive.end
    outputs = output_steps(loading.loading.drive, step.chosen, settings)
    total = int(outputs[-1])
    motion.set_time_step(end / total)
    for last, now in pairwise(map(int, outputs)):
        # No gradient is needed from here on; torch then records no operations.
        with torch.inference_mode():
            motion.advance(last, now)
        motion.check_stability(now)
        motion.record(recorder, time.perf_counter() - begin, now - last)
        if on_step is not None:
            on_step(now, total)


@dataclass(frozen=True)
class _Interval:
    """The loading from one output step to the next, by time step.

    Parameters
    ----------
    end : time, s
    moves : of the drive, m
    forces : (step + 1, force), values of the forces from the first instant to the last, Pa
    changing : whether a force changes
    """

    end: float
    moves: list[float]
    forces: Floats
    changing: list[bool]

    @classmethod
    def between(cls, loading: AssembledLoading, times: Floats) -> _Interval:
        """The loading between instants, s."""
        moves = np.diff(loading.loading.drive.at(times))
        # Moves that differ by their rounding only are equal: nothing is to be pushed by it.
        mean = moves.mean()
        if np.ptp(moves) <= EVEN * abs(mean):
            moves = np.full_like(moves, mean)
        forces = loading.force_values(times)
        changing = (np.diff(forces, axis=0) != 0.0).any(axis=1)
        return cls(float(times[-1]), moves.tolist(), forces, changing.tolist())


class _Motion:
    """A body in motion at t(n), at rest until `advance`.

    Velocities are displacements in a time step, all (2 node,), m::

        w  = dt (v - v_d) at t(n-1/2)     `relative`
        du = dt v         at t(n-1/2)     `increment`
        dt v_d                            `driven`

    so that the equations of the module read, with w+ at t(n+1/2),

        m (w+ - w) = dt^2 (P - I) - alpha dt m (w+ + w)/2,   du+ = w+ + dt v_d,   u+ = u + du+
    """

    def __init__(
        self,
        operators: Operators,
        loading: AssembledLoading,
        points: GaussPoints,
        settings: ExplicitSettings,
    ) -> None:
        self.operators, self.loading, self.points = operators, loading, points
        self.rate = settings.damping_rate
        self.mass = operators.lumped_mass(settings.density)
        self.time = self.largest_acceleration = self.stiffness = 0.0
        self.displacement = np.zeros_like(self.mass)
        self.relative = np.zeros_like(self.mass)
        self.increment = np.zeros_like(self.mass)
        self.driven = np.zeros_like(self.mass)
        self.internal = operators.force @ points.stress
        self.external = loading.external_force(loading.force_values(0.0))
        self.reaction = loading.reaction(self.internal, self.external)
        self.internal_work = self.external_work = self.damping_work = 0.0

    def set_time_step(self, dt: float) -> None:
        """Solve the equation of motion for w+ - w = gain (P - I) + loss w."""
        half = 0.5 * self.rate * dt
        self.dt = dt
        self.gain = np.where(self.loading.fixed, 0.0, dt * dt / (self.mass * (1.0 + half)))
        self.loss = -2.0 * half / (1.0 + half)

    def advance(self, begin: int, end: int) -> None:
        """Advance from step `begin` to step `end`.

        Works are added up by the trapezoidal rule, twice over.
        """
        interval = _Interval.between(self.loading, self.dt * np.arange(begin, end + 1))
        # Local names, and results into arrays that are there: the loop runs thousands of times
        # over a few hundred numbers, where a call costs more than what it does.
        points, loading, unit = self.points, self.loading, self.loading.unit
        strain_matrix, force_matrix = self.operators.strain, self.operators.force
        multiply, add, subtract = np.multiply, np.add, np.subtract
        mass, gain, loss = self.mass, self.gain, self.loss
        damping_mass = (self.rate / self.dt) * mass
        relative, displacement, du = self.relative, self.displacement, self.increment
        external, internal, reaction = self.external, self.internal, self.reaction
        opposed, moved = float(unit @ external), math.nan
        change, scratch, drag = (np.empty_like(mass) for _ in range(3))
        scratch_x, scratch_y = np.split(scratch, 2)
        largest = np.zeros_like(scratch_x)
        internal_work = damping_work = external_work = 0.0
        for local, move in enumerate(interval.moves):
            # w+ - w = gain (P - I) + loss w
            subtract(external, internal, change)
            multiply(change, gain, change)
            multiply(relative, loss, scratch)
            add(change, scratch, change)
            # the largest |w+ - w|^2, of which the acceleration follows
            multiply(change, change, scratch)
            add(scratch_x, scratch_y, scratch_x)
            np.maximum(largest, scratch_x, out=largest)
            # damping force alpha m (w + w+)/2 / dt
            multiply(change, 0.5, drag)
            add(drag, relative, drag)
            multiply(drag, damping_mass, drag)
            # w+, du+ = w+ + dt v_d, u+ = u + du+; a jump of v_d is an impulse m (v_d+ - v_d)
            add(relative, change, relative)
            before = du
            if move == moved:
                du = relative + self.driven
            else:
                driven = move * loading.spread
                jump, self.driven, moved = driven - self.driven, driven, move
                du = relative + driven
                external_work += float((mass * jump) @ (before + du)) / self.dt**2
            add(displacement, du, displacement)
            # I+ = B^T W sigma(B du+)
            stress = points.step(strain_matrix @ du, begin + local + 1)
            points.accept()
            previous, internal = internal, force_matrix @ stress
            # P+, the reaction d(t) . (I+ - P+), and what damping, stresses, loads and drive do
            damping_work += drag @ before + drag @ du
            internal_work += previous @ du + internal @ du
            work = external @ du
            external_work += work
            if interval.changing[local]:
                external = loading.external_force(interval.forces[local + 1])
                opposed, work = float(unit @ external), external @ du
            later = float(unit @ internal) - opposed
            external_work += work + (reaction + later) * move
            reaction = later
        self.damping_work += 0.5 * float(damping_work)
        self.internal_work += 0.5 * float(internal_work)
        self.external_work += 0.5 * float(external_work)
        self.stiffness = float((internal - previous) @ du) / float((mass * du) @ du)
        self.external, self.internal, self.increment = external, internal, du
        self.reaction, self.time = reaction, interval.end
        self.largest_acceleration = math.sqrt(largest.max()) / self.dt**2

    def check_stability(self, step: int) -> None:
        """Raise AnalysisError if the body moves at a frequency that the time step cannot follow.

        The last increment has the Rayleigh quotient omega^2 = du.dI/(du.M du). One that grows
        without bound turns to the highest frequency, for which dt omega > 2.
        """
        if self.stiffness * self.dt**2 > 4.0:
            raise AnalysisError(
                f"the time step of {self.dt:.3g} s became unstable by step {step}: the material is "
                "now stiffer than at the start; give a lower safety factor or time step"
            )

    def _kinetic_energy_and_damping(self) -> tuple[float, float]:
        """Energy m v(n-1/2) v(n+1/2)/2 and the work of damping up to t(n), J/m."""
        if self.time == 0.0:
            return 0.0, 0.0
        change = self.gain * (self.external - self.internal) + self.loss * self.relative
        mean = self.relative + 0.5 * change
        velocity = self.mass * self.increment / self.dt**2
        kinetic = 0.5 * float(velocity @ (self.increment + change))
        return kinetic, self.damping_work + 0.5 * self.rate * self.dt * float(velocity @ mean)

    def record(self, recorder: Recorder, seconds: float, time_steps: int) -> None:
        """Add the present output step to the recorder, with its number of time steps."""
        kinetic, damping = self._kinetic_energy_and_damping()
        parts = (kinetic, self.internal_work, damping, self.external_work)
        missing = sum(parts[:3]) - parts[3]
        recorder.add(
            self.displacement,
            driving_displacement=float(self.loading.loading.drive.at(self.time)),
            time=self.time,
            time_steps=time_steps,
            reaction=self.reaction,
            maximum_acceleration=self.largest_acceleration,
            kinetic_energy=kinetic,
            internal_energy=self.internal_work,
            damping_work=damping,
            external_work=self.external_work,
            energy_error=missing / (max(map(abs, parts)) or 1.0),
            cell_seconds=self.points.seconds,
            solver_seconds=seconds - self.points.seconds,
        )
