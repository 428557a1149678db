"""Fit a classical model to laboratory tests."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import torch
import xarray as xr
from torch import Tensor

from granbench.errors import ConfigurationError, ModelError
from granbench.fitting.compression_lines import compression_lines
from granbench.fitting.curves import TestError, curves_of, errors_of
from granbench.fitting.observations import CONTROLS, TestBatch, batches_of
from granbench.fitting.optimisation import (
    FARTHEST,
    Effort,
    Minimum,
    OnIteration,
    adam,
    levenberg_marquardt,
)
from granbench.fitting.parameter_space import ParameterSpace
from granbench.fitting.problem import Problem
from granbench.fitting.rollouts import predict
from granbench.fitting.uncertainty import (
    Identifiability,
    Uncertainty,
    bootstrap,
    laplace,
)
from granbench.laboratory import LaboratoryTest
from granbench.models import ClassicalCell

CURVE_SPREAD = 0.5
CANDIDATES = 4
"""Drawn for every start that is wanted."""

RANDOM_FIRSTS = 256
TINY = 1e-6

MOST_ATTEMPTS = 80
"""Pieces of an increment that a fit tries; beyond them the model counts as lost there. Sensible
parameters need some ten, and one point that needs thousands would hold up all others."""

LEAST_FOLLOWED = 0.5
"""Share of the fitted points that a model has to reach for a fit to be one."""

POOR = 0.3
"""Error of a test, as a share of the range of what was measured, from which a fit is none."""

AT_BOUND = 1e-3
"""Distance from a bound, as a share of the parameter's range, that counts as at the bound."""

LEAST_CHANGE = 1e-3
"""Change of the stresses of a test, as a share of the largest, below which nothing happened."""

SAME_COST = 1e-3
"""Relative difference of two sums of squares below which two starts found the same minimum."""


@dataclass(frozen=True)
class FitSettings:
    """How a model is fitted.

    Parameters
    ----------
    free : parameters that are fitted; all by default
    control : see `batches_of`
    points : to which each test is thinned
    weights : of the compared quantities by name; 1 by default
    starts : number of starts, the first from the values that the cell has
    spread : standard deviation of the others, of the unconstrained numbers
    seed : of the starts and the bootstrap
    effort : of the search
    bootstrap : samples; 0 for intervals from the curvature

    Raises
    ------
    ConfigurationError
        If a number makes no sense.
    """

    free: tuple[str, ...] | None = None
    control: str = "auto"
    points: int = 60
    weights: Mapping[str, float] = field(default_factory=dict)
    starts: int = 8
    spread: float = 0.5
    seed: int = 0
    effort: Effort = field(default_factory=Effort)
    bootstrap: int = 0

    def __post_init__(self) -> None:
        """Raise ConfigurationError for what no fit can be made with."""
        if self.control not in CONTROLS:
            raise ConfigurationError(
                f"control {self.control!r} is unknown; use {', '.join(CONTROLS)}"
            )
        least = {"points": 5, "starts": 1, "seed": 0, "bootstrap": 0}
        for name, bound in least.items():
            if getattr(self, name) < bound:
                raise ConfigurationError(
                    f"{name} = {getattr(self, name)} is too few; give {bound} or more"
                )
        if self.bootstrap in range(1, 20):
            raise ConfigurationError(
                f"bootstrap = {self.bootstrap} samples give no 95 % interval; take 20 or more"
            )
        if not 0.0 <= self.spread < float("inf"):
            raise ConfigurationError(f"spread = {self.spread:g} must not be negative")


@dataclass(frozen=True)
class Fit:
    """A fitted model and how good it is.

    Parameters
    ----------
    cell : the model with the fitted parameters
    start : the values that the search began with, by name
    space : the free parameters, about those values
    vector : (parameter,), the minimum
    error : root-mean-square over the fitted tests of their errors
    minimum : where each start ended
    identifiability, uncertainty : of the free parameters
    errors : of every test, fitted or left out
    curves : measured and predicted curves of every test, see `curves_of`
    warnings : what a user should know before using the parameters, one sentence each
    """

    cell: ClassicalCell
    start: Mapping[str, float]
    space: ParameterSpace
    vector: Tensor
    error: float
    minimum: Minimum
    identifiability: Identifiability
    uncertainty: Uncertainty
    errors: tuple[TestError, ...]
    curves: xr.Dataset
    warnings: tuple[str, ...]

    def interval(self) -> dict[str, tuple[float, float]]:
        """Ends of the 95 % interval of the value of every identifiable parameter, by name.

        One that the tests do not identify has none: along a flat direction the curvature says
        nothing of how far it goes.
        """
        low, high = (
            self.space.values(end) for end in (self.uncertainty.low, self.uncertainty.high)
        )
        return {
            name: (float(low[name]), float(high[name]))
            for name in self.space.names
            if self.identifiability.identifiable[name]
        }


def fit(
    cell: ClassicalCell,
    tests: Sequence[LaboratoryTest],
    settings: FitSettings | None = None,
    *,
    left_out: Sequence[LaboratoryTest] = (),
    on: OnIteration | None = None,
) -> Fit:
    """Fit the parameters of a model to tests.

    Parameters
    ----------
    cell : in the `principal` order, with the values to start from
    tests : that are fitted
    settings : how
    left_out : tests that are predicted only
    on : called after each iteration of the search

    Raises
    ------
    ConfigurationError
        If there is nothing to fit, or settings and tests do not go together.
    ModelError
        If the model cannot start as the tests do, or follows less than half of their points with
        the best parameters that were found.
    """
    settings = settings or FitSettings()
    if not tests:
        raise ConfigurationError("there is no test to fit: take one from --leave-out")
    for test in tests:
        _require_change(test)
    if cell.order != "principal":
        raise ConfigurationError(
            f"{cell.name} has {cell.order} components, laboratory tests principal ones; make the "
            "cell in the principal order"
        )
    space = ParameterSpace.of(searching_cell(cell), settings.free)
    problem = Problem(space, _batches(tests, settings))
    minimum = _searched(problem, settings, on)
    best = int(minimum.cost.argmin())
    vector = minimum.vectors[best]
    residual, jacobian = (part[0] for part in problem.linearised(vector[None]))
    error = float((residual**2).sum() / problem.tests) ** 0.5
    identifiability = Identifiability.of(space.names, jacobian, problem.tests, error)
    if settings.bootstrap:
        uncertainty = bootstrap(
            problem, vector, residual, settings.bootstrap, settings.seed, settings.effort
        )
    else:
        uncertainty = laplace(vector, residual, jacobian, problem.batches)
    values = {name: float(value) for name, value in space.values(vector).items()}
    roles = {"fitted": problem.batches, "left out": _batches(left_out, settings)}
    predicted = [
        (role, batch, predict(space, vector[None], batch))
        for role, batches in roles.items()
        for batch in batches
    ]
    errors = tuple(error for each in predicted for error in errors_of(*each))
    _require_followed(cell, errors)
    return Fit(
        cell=cell.copy_with(values),
        start=cell.values(),
        space=space,
        vector=vector,
        error=error,
        minimum=minimum,
        identifiability=identifiability,
        uncertainty=uncertainty,
        errors=errors,
        curves=curves_of(predicted),
        warnings=(
            *_warnings(problem, vector, minimum, identifiability, errors),
            *_unknown_correlations(uncertainty),
        ),
    )


def _require_change(test: LaboratoryTest) -> None:
    """Refuse a test in which nothing happened: any parameters would fit it."""
    largest = float(np.nanmax(np.abs(test.stress)))
    if not np.nanmax(np.ptp(test.stress, axis=0)) > LEAST_CHANGE * largest and (
        test.lateral_stress_known or not np.ptp(test.stress[:, 0]) > LEAST_CHANGE * largest
    ):
        raise ConfigurationError(
            f"{test.source}: its stresses stay constant, so that nothing can be fitted to it; "
            "give a test in which they change"
        )
    if not np.nanmax(np.ptp(test.strain, axis=0)) > 0.0:
        raise ConfigurationError(
            f"{test.source}: its strains stay constant, so that nothing can be fitted to it; give "
            "a test in which they change"
        )


def _require_followed(cell: ClassicalCell, errors: Sequence[TestError]) -> None:
    """Refuse parameters with which the model follows less than half of what was fitted."""
    fitted = [error for error in errors if error.role == "fitted"]
    points, lost = sum(error.points for error in fitted), sum(error.lost for error in fitted)
    if points - lost >= LEAST_FOLLOWED * points:
        return
    names = ", ".join(error.name for error in fitted if error.lost)
    raise ModelError(
        f"{cell.name} cannot follow {names}: with the best parameters that were found it reaches "
        f"{points - lost} of {points} points; start from other parameters with --set or --params, "
        "take more --starts, check the test's stresses, or fit another model"
    )


def _unknown_correlations(uncertainty: Uncertainty) -> list[str]:
    if np.isfinite(uncertainty.correlation).all():
        return []
    return [
        "the correlations of some parameters are not known, for the tests hardly depend on them; "
        "fix some parameters with --free"
    ]


def searching_cell(cell: ClassicalCell) -> ClassicalCell:
    """A copy of the cell that gives up sooner."""
    copy = cell.copy_with({})
    if copy.substepping is not None:
        copy.substepping = replace(copy.substepping, most=MOST_ATTEMPTS)
    return copy


def _batches(tests: Sequence[LaboratoryTest], settings: FitSettings) -> list[TestBatch]:
    return batches_of(
        tests, control=settings.control, points=settings.points, weights=settings.weights
    )


def _searched(problem: Problem, settings: FitSettings, on: OnIteration | None) -> Minimum:
    vectors = possible_starts(problem, settings)
    if settings.effort.adam_iterations:
        vectors = adam(problem, vectors, settings.effort, on)
    return levenberg_marquardt(problem, vectors, settings.effort, on)


def possible_starts(problem: Problem, settings: FitSettings) -> Tensor:
    """First vectors (start, parameter) with which the model can start every test.

    The first is that of the cell's own values or, where they cannot start the tests, the nearest
    of some random ones that can. The others are scattered about it by the spread, but less along
    what moves the curves much: by no more than `CURVE_SPREAD` of their ranges, to first order. Of
    several drawn for each, those that fit best are taken: a search from parameters with which the
    model cannot follow the tests is long and seldom arrives. Where an oedometer test shows the
    compression lines, one start has those.
    """
    wanted, space = settings.starts, problem.space
    generator = torch.Generator().manual_seed(settings.seed)
    first = _first_start(problem, settings.spread, generator)
    _, jacobian = problem.linearised(first[None])
    squares = jacobian[0].mT @ jacobian[0] / (problem.tests * CURVE_SPREAD**2)
    narrowed = squares + torch.eye(space.size).double() / max(settings.spread, TINY) ** 2
    half = torch.linalg.inv(torch.linalg.cholesky(narrowed)).mT
    shape = (CANDIDATES * wanted, space.size)
    drawn = first + torch.randn(shape, generator=generator, dtype=torch.float64) @ half.mT
    possible = drawn[problem.can_start(drawn)]
    guessed = _guessed(problem)
    if wanted == 1:
        known = torch.cat([first[None], guessed])
        return known[problem.costs(known).argmin()][None]
    best = problem.costs(possible).argsort()[: wanted - 1 - len(guessed)]
    return torch.cat([first[None], guessed, possible[best]])


def _guessed(problem: Problem) -> Tensor:
    """The vectors (0 or 1, parameter) whose compression lines are read off an oedometer test."""
    values = compression_lines(problem.batches, problem.space.names)
    vectors = problem.space.vector(values)[None] if values else torch.zeros(0, problem.space.size)
    vectors = vectors.double().clamp(-FARTHEST, FARTHEST)
    return vectors[problem.can_start(vectors)] if len(vectors) else vectors


def _first_start(problem: Problem, spread: float, generator: torch.Generator) -> Tensor:
    """The vector (parameter,) nearest to zero, of some, with which all tests can be started."""
    size = problem.space.size
    zero = torch.zeros(1, size, dtype=torch.float64)
    if problem.can_start(zero).all():
        return zero[0]
    drawn = torch.randn(RANDOM_FIRSTS, size, generator=generator, dtype=torch.float64)
    drawn = drawn * max(spread, TINY) * torch.linspace(0.2, 2.0, RANDOM_FIRSTS).double()[:, None]
    possible = drawn[problem.can_start(drawn)]
    if not len(possible):
        predict(problem.space, zero, problem.batches[0])  # raises what the model says
        raise ModelError(
            f"{problem.space.cell.name} can start none of the tests with values near the first; "
            "give others with --set or --params"
        )
    return possible[(possible**2).sum(dim=1).argmin()]


def _warnings(
    problem: Problem,
    vector: Tensor,
    minimum: Minimum,
    identifiability: Identifiability,
    errors: Sequence[TestError],
) -> list[str]:
    found, space = [], problem.space
    if not problem.can_start(torch.zeros_like(vector[None])).all():
        found.append("the model cannot start all tests with the first values; others were taken")
    if space.cell.dimension == 2:
        found.append(
            f"{space.cell.name} was fitted in three dimensions; in the plane, as on the gp tasks "
            "and in finite elements, the same parameters make another law"
        )
    if lost := [name for name, known in identifiability.identifiable.items() if not known]:
        found.append(
            f"the tests do not identify {', '.join(lost)}: other values fit as well; fix "
            f"{'some of them' if len(lost) > 1 else 'it'} with --free, or add tests"
        )
    for error in errors:
        if error.role == "fitted" and error.total > POOR:
            found.append(
                f"test {error.name} is off by {100.0 * error.total:.3g} % of its range: the model "
                "does not fit it, and the parameters say little of the soil"
            )
    best = int(minimum.cost.argmin())
    if not bool(minimum.converged[best]):
        found.append("the search ended before it converged; allow more with --iterations")
    stopped = [
        name
        for name, number in zip(space.names, vector.tolist(), strict=True)
        if abs(number) >= FARTHEST
    ]
    if stopped:
        found.append(f"{', '.join(stopped)} ran to the end of the range that is searched")
    found += [text for name in space.names if (text := _at_bound(space, vector, name))]
    same = minimum.cost <= minimum.cost[best] * (1.0 + SAME_COST) + torch.finfo(torch.float64).eps
    if len(same) > 1 and int(same.sum()) == 1:
        found.append(
            f"only one of {len(same)} starts found the best fit; take more starts to be sure of it"
        )
    for error in errors:
        if error.lost:
            found.append(
                f"the model cannot follow test {error.name} to its end: it does not reach "
                f"{error.lost} of {error.points} points, and its parameters are not to be relied on"
            )
    return found


def _at_bound(space: ParameterSpace, vector: Tensor, name: str) -> str:
    """A sentence where a parameter came to a bound of its range; empty where it did not."""
    parameter = next(one for one in space.parameters if one.name == name)
    value = float(space.values(vector)[name])
    width = parameter.upper - parameter.lower
    size = width if np.isfinite(width) else max(abs(float(space.cell.reference[name])), TINY)
    for bound in (parameter.lower, parameter.upper):
        if np.isfinite(bound) and abs(value - bound) <= AT_BOUND * size:
            return f"{name} is {value:.6g}, at the bound {bound:g} of its range"
    return ""
