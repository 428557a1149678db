"""Starting vectors of a fit: parameters with which the model can start every test."""

from dataclasses import replace

import torch
from torch import Tensor

from granbench.errors import ModelError
from granbench.fitting.compression_lines import compression_lines
from granbench.fitting.least_squares import LeastSquares
from granbench.fitting.optimisation import (
    FARTHEST,
)
from granbench.fitting.rollouts import predict
from granbench.fitting.settings import FitSettings
from granbench.models import ClassicalCell

CURVE_SPREAD = 0.5
"""Largest spread of the curves of the starts, as a share of their range."""


CANDIDATES = 4
"""Vectors drawn for every start."""


RANDOM_FIRSTS = 256
"""Vectors drawn where the values of the cell cannot start the tests."""


TINY = 1e-6


MOST_ATTEMPTS = 80
"""Substeps of an increment in a fit; a point that needs more counts as lost. Sensible parameters
need about ten, and one point that needs thousands would delay all others."""


def searching_cell(cell: ClassicalCell) -> ClassicalCell:
    """A copy of the cell that allows fewer substeps, see `MOST_ATTEMPTS`."""
    copy = cell.copy_with({})
    if copy.substepping is not None:
        copy.substepping = replace(copy.substepping, most=MOST_ATTEMPTS)
    return copy


def possible_starts(problem: LeastSquares, settings: FitSettings) -> Tensor:
    """First vectors (start, parameter) with which the model can start every test.

    The first vector is that of the cell's own values or, if those cannot start the tests, the
    nearest of `RANDOM_FIRSTS` random ones that can. The others are scattered about it by the
    spread, but less along directions that change the curves much: by no more than `CURVE_SPREAD`
    of their ranges, to first order. Of `CANDIDATES` drawn for each start, those that fit best are
    taken: a search from parameters with which the model cannot follow the tests is long and rarely
    converges. If an oedometer test shows the compression lines, one start uses them.
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


def _guessed(problem: LeastSquares) -> Tensor:
    """The vectors (0 or 1, parameter) with compression lines read from an oedometer test."""
    values = compression_lines(problem.batches, problem.space.names)
    vectors = problem.space.vector(values)[None] if values else torch.zeros(0, problem.space.size)
    vectors = vectors.double().clamp(-FARTHEST, FARTHEST)
    return vectors[problem.can_start(vectors)] if len(vectors) else vectors


def _first_start(problem: LeastSquares, spread: float, generator: torch.Generator) -> Tensor:
    """The drawn vector (parameter,) nearest to zero with which all tests can be started."""
    size = problem.space.size
    zero = torch.zeros(1, size, dtype=torch.float64)
    if problem.can_start(zero).all():
        return zero[0]
    drawn = torch.randn(RANDOM_FIRSTS, size, generator=generator, dtype=torch.float64)
    drawn = drawn * max(spread, TINY) * torch.linspace(0.2, 2.0, RANDOM_FIRSTS).double()[:, None]
    possible = drawn[problem.can_start(drawn)]
    if not len(possible):
        predict(problem.space, zero, problem.batches[0])  # raises the model's own error
        raise ModelError(
            f"{problem.space.cell.name} cannot start all of the tests with parameters near the "
            "given ones; start from others"
        )
    return possible[(possible**2).sum(dim=1).argmin()]
