"""Fit a classical model to laboratory tests."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import xarray as xr
from torch import Tensor

from granbench.errors import ConfigurationError, Setting
from granbench.fitting.curves import TestError, curves_of, errors_of
from granbench.fitting.judgement import (
    require_change,
    require_followed,
    unknown_correlations,
    warnings_of,
)
from granbench.fitting.least_squares import LeastSquares
from granbench.fitting.observations import batches_of
from granbench.fitting.optimisation import (
    Minimum,
    OnIteration,
    adam,
    levenberg_marquardt,
)
from granbench.fitting.parameter_space import ParameterSpace
from granbench.fitting.rollouts import predict
from granbench.fitting.settings import FitSettings
from granbench.fitting.starts import possible_starts, searching_cell
from granbench.fitting.test_batch import TestBatch
from granbench.fitting.uncertainty import (
    Identifiability,
    Uncertainty,
    bootstrap,
    laplace,
)
from granbench.laboratory import LaboratoryTest
from granbench.models import ClassicalCell


@dataclass(frozen=True)
class Fit:
    """A fitted model, its errors and its uncertainty.

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
        """The 95 % interval of the value of every identifiable parameter, by name.

        A parameter that the tests do not identify has no interval: along a flat direction the
        curvature does not show how far it may go.
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
        If the model cannot start from the first state of the tests, or reaches less than half of
        their points with the best parameters.
    """
    settings = settings or FitSettings()
    if not tests:
        raise ConfigurationError("there is no test to fit; take one from ", Setting("left_out"))
    for test in tests:
        require_change(test)
    if cell.order != "principal":
        raise ConfigurationError(
            f"{cell.name} has {cell.order} components, but laboratory tests have principal ones; "
            "make the cell with order='principal'"
        )
    space = ParameterSpace.of(searching_cell(cell), settings.free)
    problem = LeastSquares(space, _batches(tests, settings))
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
    require_followed(cell, errors)
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
            *warnings_of(problem, vector, minimum, identifiability, errors),
            *unknown_correlations(uncertainty),
        ),
    )


def _batches(tests: Sequence[LaboratoryTest], settings: FitSettings) -> list[TestBatch]:
    return batches_of(
        tests, control=settings.control, points=settings.points, weights=settings.weights
    )


def _searched(problem: LeastSquares, settings: FitSettings, on: OnIteration | None) -> Minimum:
    vectors = possible_starts(problem, settings)
    if settings.effort.adam_iterations:
        vectors = adam(problem, vectors, settings.effort, on)
    return levenberg_marquardt(problem, vectors, settings.effort, on)
