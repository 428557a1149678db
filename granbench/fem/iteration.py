r"""Iteration schemes for the equilibrium of a load step.

newton
    du <- du + a K(C)^-1 r with the cell's tangent C at du, and a = 1 or, by a line search, less;
    where no a lessens r, with a share of the initial stiffness added to C.
restart
    Algorithm 2: every iteration solves for the whole increment from the last converged step with
    the cell's tangent at the last one, without a line search, until successive increments agree
    in ``|du(m+1) - du(m)| <= tolerance |du(m)|``. Read literally, Eq 4.10 with sigma(n, m) on its
    right-hand side would give a correction and not the increment; with the forces that C itself
    predicts added, K du(m+1) = r + K du(m), its fixed point is a balance.
initial-stiffness
    du <- du + K0^-1 r with one elastic matrix, given or the cell's tangent at the start, and
    Anderson's acceleration over the last iterates. It needs only the stress of the cell.
"""

from __future__ import annotations

import abc
from dataclasses import dataclass, field

import numpy as np

from granbench.errors import ConfigurationError
from granbench.fem.balance import Balance
from granbench.fem.gauss_points import MaterialFailure
from granbench.fem.implicit_settings import SCHEME_NAMES, TOLERANCE, ImplicitSettings
from granbench.fem.mesh import Floats

LOOK_BACK = 5
"""Errors under whose largest a Newton step has to end (Grippo, Lampariello & Lucidi 1986). While
points go in and out of yield the error must be allowed to rise, or the steps become short."""

HALVINGS = 4
"""Halvings of a Newton step that does not reduce the error, before the increment is given up."""

ARMIJO = 1e-4
"""Share of the error that a full Newton step takes off at least; a shorter one, in proportion."""

FARTHEST = 2.0
"""Largest correction of a node, over the largest displacement of the first increment. A nearly
singular tangent would send nodes away by kilometres, where other equilibria exist."""

ELASTIC_SHARES = (0.0, 1e-3, 0.1)
"""Shares of the initial stiffness that are added to the tangent. A body that flows as a whole
without hardening has a singular tangent; a small share of elasticity makes it regular."""

Linearised = tuple[Floats, Floats, float, Floats]
"""An increment, the forces out of balance, their size, and the tangent there."""

MEMORY = 10
"""Iterates that Anderson's acceleration looks back on."""


@dataclass(frozen=True)
class IterationResult:
    """Result of a scheme.

    Parameters
    ----------
    increment : (2 node,), displacement of the piece, whose state the Gauss points hold as tried
    residuals : forces out of balance over their reference, by iteration; the first is the guess's
    converged : whether the scheme's criterion is met
    """

    increment: Floats
    residuals: tuple[float, ...]
    converged: bool


class Scheme(abc.ABC):
    """A way to balance; called with a first increment (2 node,).

    Attributes
    ----------
    most : iterations by default
    remedy : what to do where it fails, the end of a sentence
    """

    most: int
    remedy: str

    def __init__(self, settings: ImplicitSettings, balance: Balance) -> None:
        self.settings, self.balance = settings, balance
        self.tolerance = TOLERANCE if settings.tolerance is None else settings.tolerance
        self.limit = settings.iterations or self.most

    @abc.abstractmethod
    def __call__(self, guess: Floats) -> IterationResult:
        """Improve an increment until it balances, or give up."""


class Newton(Scheme):
    """Newton's method with the cell's tangent and a line search; see the module's docstring."""

    most = 25
    remedy = (
        "take more load steps, or the scheme 'initial-stiffness', which needs no tangent of the "
        "model"
    )

    def __call__(self, guess: Floats) -> IterationResult:
        """See `Scheme`."""
        balance, increment = self.balance, guess
        rest, error, tangent = balance.linearised(increment)
        errors = [error]
        self._farthest = FARTHEST * float(np.abs(guess).max())
        while error > self.tolerance and len(errors) <= self.limit:
            found = self._improved(increment, rest, max(errors[-LOOK_BACK:]), tangent)
            if found is None:
                break
            increment, rest, error, tangent = found
            errors.append(error)
        return IterationResult(increment, tuple(errors), error <= self.tolerance)

    def _improved(
        self, increment: Floats, rest: Floats, ceiling: float, tangent: Floats
    ) -> Linearised | None:
        """One iteration; where the tangent itself leads nowhere, with some elasticity added."""
        balance = self.balance
        for share in ELASTIC_SHARES:
            if share > 0.0:
                tangent = tangent + share * balance.initial_stiffness()
            solve = balance.pattern.factorised(tangent)
            if solve is None:
                continue
            found = self._along(increment, solve(rest), ceiling)
            if found is not None:
                return found
        return None

    def _along(self, increment: Floats, correction: Floats, ceiling: float) -> Linearised | None:
        """The longest of a few steps along a correction whose error stays under a ceiling."""
        size = float(np.abs(correction).max(initial=0.0))
        if size > self._farthest > 0.0:
            correction = self._farthest / size * correction
        for halving in range(HALVINGS + 1):
            length = 0.5**halving
            trial = self.balance.moved(increment, length * correction)
            try:
                rest, after, tangent = self.balance.linearised(trial)
            except MaterialFailure:
                continue
            if after <= (1.0 - ARMIJO * length) * ceiling:
                return trial, rest, after, tangent
        return None


class Restart(Scheme):
    """Algorithm 2 of the thesis, which restarts from the last converged step; see the module."""

    most = 100
    remedy = "take more load steps, or the scheme 'newton'"

    def __call__(self, guess: Floats) -> IterationResult:
        """See `Scheme`."""
        balance, increment = self.balance, guess
        rest, error, tangent = balance.linearised(increment)
        errors = [error]
        converged = False
        while not converged and len(errors) <= self.limit:
            solve = balance.pattern.factorised(tangent)
            if solve is None:
                break
            correction = solve(rest)
            size = np.linalg.norm(increment) * self.settings.displacement_tolerance
            converged = bool(np.linalg.norm(correction) <= size)
            increment = balance.moved(increment, correction)
            rest, error, tangent = balance.linearised(increment)
            errors.append(error)
        return IterationResult(increment, tuple(errors), converged)


@dataclass
class _Iterates:
    """Memory of Anderson's acceleration: differences of iterates and of their corrections."""

    moves: list[Floats] = field(default_factory=list)
    changes: list[Floats] = field(default_factory=list)

    def remember(self, move: Floats, change: Floats) -> None:
        """Add one difference, and forget the oldest beyond `MEMORY`."""
        self.moves.append(move)
        self.changes.append(change)
        del self.moves[:-MEMORY], self.changes[:-MEMORY]

    def accelerated(self, correction: Floats) -> Floats:
        """The correction less what the last ones would predict of it."""
        if not self.changes:
            return correction
        changes, moves = np.array(self.changes).T, np.array(self.moves).T
        weights, *_ = np.linalg.lstsq(changes, correction, rcond=1e-10)
        return correction - (moves + changes) @ weights


class InitialStiffness(Scheme):
    """Iterations with one elastic stiffness and Anderson's acceleration; see the module."""

    most = 300
    remedy = (
        "take more load steps, or give a `stiffness` that is not below the material's elastic one"
    )

    def __init__(self, settings: ImplicitSettings, balance: Balance) -> None:
        super().__init__(settings, balance)
        if settings.stiffness is not None:
            matrix = np.asarray(settings.stiffness, dtype=float)
            tangent = np.broadcast_to(matrix, (balance.points.count, 3, 3))
        else:
            tangent = balance.initial_stiffness()
        symmetric = tangent + tangent.transpose(0, 2, 1)
        definite = np.isfinite(tangent).all() and np.linalg.eigvalsh(symmetric).min() > 0.0
        solve = balance.pattern.factorised(tangent) if definite else None
        if solve is None:
            raise ConfigurationError(
                f"the stiffness of {balance.points.cell.name} at the start is not positive "
                "definite, as the scheme 'initial-stiffness' needs it; take the scheme 'newton' or "
                "the explicit solver, or give ImplicitSettings a positive definite `stiffness`"
            )
        self._solve = solve

    def __call__(self, guess: Floats) -> IterationResult:
        """See `Scheme`."""
        balance, increment, iterates = self.balance, guess, _Iterates()
        rest, error = balance.residual(increment)
        errors = [error]
        correction = self._solve(rest)
        while error > self.tolerance and len(errors) <= self.limit:
            move = iterates.accelerated(correction)
            increment = balance.moved(increment, move)
            rest, error = balance.residual(increment)
            errors.append(error)
            before, correction = correction, self._solve(rest)
            iterates.remember(move, correction - before)
        return IterationResult(increment, tuple(errors), error <= self.tolerance)


SCHEMES: dict[str, type[Scheme]] = dict(
    zip(SCHEME_NAMES, (Newton, Restart, InitialStiffness), strict=True)
)
"""Schemes by name."""


def scheme_of(settings: ImplicitSettings, balance: Balance) -> Scheme:
    """The scheme that the settings name; raises ConfigurationError if it has no stiffness."""
    return SCHEMES[settings.scheme](settings, balance)
