"""The least-squares problem of a fit: residuals and Jacobians of many parameter vectors."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from granbench.errors import ModelError
from granbench.fitting.parameter_space import ParameterSpace, with_parameters
from granbench.fitting.rollouts import (
    Prediction,
    differentiable_quantities,
    predict,
    sensitivity,
)
from granbench.fitting.test_batch import TestBatch

LARGE = 1.0
"""Error, in ranges of the quantity, above which its logarithm is used."""

LOST = 20.0
"""Error, in ranges of the quantity, of every point that the model does not reach: larger than that
of any point it reaches. The logarithm would get there at e^19."""

LAST_SHARE = 0.1
"""Share of the error at the last reached point that is added to lost points: a slope along which
the search returns to parameters that reach further."""


@dataclass(frozen=True)
class Evaluation:
    """Predictions of parameter vectors and their residuals.

    Parameters
    ----------
    residuals : (vector, residual); infinite where the model cannot start with a vector
    predictions : one per batch, of all vectors; NaN there
    """

    residuals: Tensor
    predictions: tuple[Prediction, ...]

    def of(self, vectors: Tensor) -> "Evaluation":
        """The evaluation of the vectors at some places."""
        return Evaluation(self.residuals[vectors], tuple(p.of(vectors) for p in self.predictions))

    def replaced(self, vectors: Tensor, other: "Evaluation") -> "Evaluation":
        """A copy with another evaluation of the vectors at some places."""
        pairs = zip(self.predictions, other.predictions, strict=True)
        return Evaluation(
            self.residuals.index_copy(0, vectors, other.residuals),
            tuple(own.replaced(vectors, new) for own, new in pairs),
        )


@dataclass(frozen=True)
class LeastSquares:
    """The least-squares problem: tests, and the parameters to fit to them.

    Parameters
    ----------
    space : the free parameters
    batches : the tests

    Notes
    -----
    The residuals are the weighted errors of all points; the sum of their squares is the sum over
    tests of the squared error, which for weights of one is the mean square over a test's points
    and quantities of (predicted - measured)/range, see `shortened` for errors above a range.
    """

    space: ParameterSpace
    batches: Sequence[TestBatch]

    @property
    def tests(self) -> int:
        """Number of tests."""
        return sum(batch.size for batch in self.batches)

    def can_start(self, vectors: Tensor) -> Tensor:
        """Whether the model can start all tests with each vector, (vector,)."""
        possible = torch.ones(len(vectors), dtype=torch.bool)
        for batch in self.batches:
            possible &= self._can_start(vectors, batch)
        return possible

    def _can_start(self, vectors: Tensor, batch: TestBatch) -> Tensor:
        _, conditions = batch.repeated(len(vectors))
        free = self.space.per_point(vectors, batch.size)
        try:
            with_parameters(self.space.cell, free, lambda cell: cell.initial_state(conditions))
        except ModelError:
            if len(vectors) == 1:
                return torch.zeros(1, dtype=torch.bool)
            middle = len(vectors) // 2
            halves = (vectors[:middle], vectors[middle:])
            return torch.cat([self._can_start(half, batch) for half in halves])
        return torch.ones(len(vectors), dtype=torch.bool)

    def evaluated(self, vectors: Tensor) -> Evaluation:
        """Predictions and residuals of vectors (vector, parameter)."""
        possible = torch.nonzero(self.can_start(vectors)).flatten()
        residuals, predictions = [], []
        for batch in self.batches:
            residual = torch.full((len(vectors), batch.observed.numel()), torch.inf).double()
            prediction = Prediction.unknown(len(vectors), batch)
            if len(possible):
                found = predict(self.space, vectors[possible], batch)
                prediction = prediction.replaced(possible, found)
                residual[possible] = _weighted_errors(found.quantities(batch), batch)
            residuals.append(residual)
            predictions.append(prediction)
        return Evaluation(torch.cat(residuals, dim=1), tuple(predictions))

    def residuals(self, vectors: Tensor) -> Tensor:
        """Residuals (vector, residual); infinite where the model cannot start with a vector."""
        return self.evaluated(vectors).residuals

    def costs(self, vectors: Tensor) -> Tensor:
        """Sum of squares (vector,); infinite where the model cannot start with a vector."""
        return (self.residuals(vectors) ** 2).sum(dim=1)

    def jacobian(self, vectors: Tensor, evaluation: Evaluation) -> Tensor:
        """Derivatives of the residuals, (vector, residual, parameter).

        Parameters
        ----------
        vectors : (vector, parameter), with which the model can start
        evaluation : of the same vectors
        """
        parts = []
        for batch, prediction in zip(self.batches, evaluation.predictions, strict=True):
            change = sensitivity(self.space, vectors, batch, prediction)
            predicted = prediction.quantities(batch)
            lost, last = _lost(predicted)
            change = _at_last(change.nan_to_num(posinf=0.0, neginf=0.0), last)
            slope = _slope(_at_last(predicted, last), batch, last, lost)
            change = slope[..., None] * change
            parts.append((batch.residual_weight[None, ..., None] * change).flatten(1, 3))
        return torch.cat(parts, dim=1)

    def linearised(self, vectors: Tensor) -> tuple[Tensor, Tensor]:
        """Residuals (vector, residual) and their Jacobian (vector, residual, parameter)."""
        evaluation = self.evaluated(vectors)
        return evaluation.residuals, self.jacobian(vectors, evaluation)

    def loss(self, vectors: Tensor) -> Tensor:
        """Sum of squares (vector,) with gradients, by back-propagation through the sequences.

        Infinite, without a gradient, where the model cannot start with a vector.
        """
        possible = self.can_start(vectors.detach())
        infinite = torch.full((len(vectors),), torch.inf, dtype=torch.float64)
        if not possible.any():
            return infinite
        total = torch.zeros(int(possible.sum()), dtype=torch.float64)
        for batch in self.batches:
            predicted = differentiable_quantities(self.space, vectors[possible], batch)
            residual = _weighted_errors(predicted, batch)
            total = total + (residual**2).sum(dim=1)
        return infinite.masked_scatter(possible, total)


def _weighted_errors(predicted: Tensor, batch: TestBatch) -> Tensor:
    """Residuals (vector, residual) of what was predicted (vector, test, step, quantity).

    An error above one range counts with its logarithm, and a lost point more than any error, so
    parameters with which the model reaches fewer points never lower the cost.
    """
    lost, last = _lost(predicted)
    ranges = shortened(_ranges(_at_last(predicted, last), batch, last))
    ranges = torch.where(lost, LOST + LAST_SHARE * ranges.abs(), ranges)
    return (batch.residual_weight * ranges * batch.scale[:, None]).flatten(1)


def shortened(ranges: Tensor) -> Tensor:
    """Errors, in ranges, with logarithms beyond `LARGE`; at most `LOST`."""
    size = ranges.abs()
    logarithm = LARGE + LARGE * (size.clamp(min=LARGE) / LARGE).log()
    return torch.where(size > LARGE, ranges.sign() * logarithm.clamp(max=LOST), ranges)


def _ranges(predicted: Tensor, batch: TestBatch, last: Tensor) -> Tensor:
    """Errors, in ranges, of predictions (vector, test, step, quantity) of the steps `last`."""
    observed = _at_last(batch.observed.expand_as(predicted), last)
    return (predicted - observed) / batch.scale[:, None]


def _slope(predicted: Tensor, batch: TestBatch, last: Tensor, lost: Tensor) -> Tensor:
    """Derivative of the residuals, over their weights, by the predictions of the steps `last`."""
    ranges = _ranges(predicted, batch, last)
    size = ranges.abs().clamp(min=LARGE)
    slope = torch.where(size < math.exp(LOST / LARGE - 1.0), LARGE / size, 0.0)
    return torch.where(lost, LAST_SHARE * slope * ranges.sign(), slope)


def _lost(predicted: Tensor) -> tuple[Tensor, Tensor]:
    """Lost points (vector, test, step, quantity), and for each the last step that is not lost."""
    lost = ~predicted.isfinite()
    steps = torch.arange(predicted.shape[2])[:, None].expand_as(predicted)
    return lost, torch.where(lost, 0, steps).cummax(dim=2).values


def _at_last(values: Tensor, last: Tensor) -> Tensor:
    """Values (vector, test, step, quantity, ...) of the steps `last` (vector, ..., quantity)."""
    index = last.reshape(*last.shape, *(1,) * (values.ndim - last.ndim)).expand_as(values)
    return values.gather(2, index)
