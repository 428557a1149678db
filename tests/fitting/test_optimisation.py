"""The search itself, on sums of squares whose minimum is known."""

from dataclasses import dataclass

import pytest
import torch
from torch import Tensor

from granbench.fitting.least_squares import Evaluation
from granbench.fitting.optimisation import (
    FARTHEST,
    LONGEST_STEP,
    Effort,
    Minimum,
    levenberg_marquardt,
)


@dataclass(frozen=True)
class Linear:
    """r = A u - b: a `LeastSquares` without a model."""

    matrix: Tensor
    target: Tensor

    def evaluated(self, vectors: Tensor) -> Evaluation:
        return Evaluation(vectors @ self.matrix.T - self.target, ())

    def jacobian(self, vectors: Tensor, known: Evaluation) -> Tensor:
        return self.matrix.expand(len(vectors), -1, -1)


def minimum_of(matrix: list[list[float]], target: list[float], starts: int = 3) -> Minimum:
    problem = Linear(torch.tensor(matrix).double(), torch.tensor(target).double())
    generator = torch.Generator().manual_seed(0)
    vectors = torch.randn(starts, problem.matrix.shape[1], generator=generator).double()
    return levenberg_marquardt(problem, vectors, Effort(iterations=80))


@pytest.mark.parametrize("weak", [1e-2, 1e-4, 1e-6])
def test_a_parameter_that_hardly_acts_does_not_hold_up_the_others(weak: float) -> None:
    """Its own minimum lies far beyond the range, as K of a material that yields at once."""
    found = minimum_of([[weak, 0.0], [0.3 * weak, 1.0]], [1e3 * weak, 5.0])
    assert found.converged.all()
    assert found.vectors[:, 0] == pytest.approx(FARTHEST, abs=1e-6)
    # Where the first one is held at its bound the second has the minimum of what is left.
    expected = 5.0 - 0.3 * weak * FARTHEST
    assert found.vectors[:, 1] == pytest.approx(expected, abs=1e-5)


def test_an_unfinished_search_has_not_converged() -> None:
    """Every step gains less than the tolerance, but only because it is cut short."""
    problem = Linear(torch.tensor([[1e-3], [0.0]]).double(), torch.tensor([1.0, 30.0]).double())
    away = torch.zeros(1, 1).double()
    found = levenberg_marquardt(problem, away, Effort(iterations=5))
    assert not found.converged.any()
    assert found.vectors.item() == pytest.approx(5 * LONGEST_STEP)


def test_a_search_leaves_a_bound_if_the_minimum_is_inside() -> None:
    problem = Linear(torch.eye(2).double(), torch.tensor([2.0, -3.0]).double())
    corner = torch.tensor([[FARTHEST, FARTHEST], [-FARTHEST, FARTHEST]]).double()
    found = levenberg_marquardt(problem, corner, Effort(iterations=60))
    assert found.converged.all()
    # Quadratic: the last steps are of the damping's size, 1e-3 of the one before at first.
    torch.testing.assert_close(found.vectors, problem.target.expand(2, -1), rtol=0.0, atol=1e-5)
