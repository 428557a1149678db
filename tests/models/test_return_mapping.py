"""The consistency equation's solver, and what counts as yielding."""

import pytest
import torch
from torch import Tensor

from granbench.models.return_mapping import consistent_root, exceeds


def solved(residual, points: int, start: float = 0.0, upper: float = 1.0) -> Tensor:
    ones = torch.ones(points, dtype=torch.float64)
    return consistent_root(residual, ones > 0.0, start * ones, upper * ones, upper * ones)


@pytest.mark.parametrize("start", [-3.0, 0.0, 0.4, 7.0])
def test_a_smooth_root_is_found_from_any_start(start):
    target = torch.linspace(0.01, 0.9, 50, dtype=torch.float64)
    root = solved(lambda x: (target**3 - x**3 + target - x, -3.0 * x**2 - 1.0), 50, start)
    # Quadratic convergence from a last step of 1e-6.
    torch.testing.assert_close(root, target, rtol=0.0, atol=1e-12)


def test_a_root_that_newton_overshoots_for_ever_is_bracketed():
    # Newton's iterations on the arctangent diverge from 1.4 on; here it is steep.
    target = torch.linspace(0.02, 0.97, 40, dtype=torch.float64)
    steep = 1e3
    root = solved(
        lambda x: (-(steep * (x - target)).arctan(), -steep / (1.0 + (steep * (x - target)) ** 2)),
        40,
    )
    torch.testing.assert_close(root, target, rtol=0.0, atol=1e-10)


def test_a_kink_does_not_stop_it():
    kink = torch.linspace(0.1, 0.8, 30, dtype=torch.float64)
    slopes = torch.tensor([-1.0, -400.0], dtype=torch.float64)

    def residual(x: Tensor) -> tuple[Tensor, Tensor]:
        after = x > kink
        return (
            0.1 + kink - torch.minimum(x, kink) - 400.0 * (x - kink).clamp(min=0.0),
            torch.where(after, slopes[1], slopes[0]),
        )

    torch.testing.assert_close(solved(residual, 30), kink + 0.1 / 400.0, rtol=0.0, atol=1e-12)


def test_where_no_root_is_sought_x_is_zero():
    sought = torch.tensor([True, False])
    ones = torch.ones(2, dtype=torch.float64)
    root = consistent_root(lambda x: (0.25 - x, -ones), sought, 0.0 * ones, ones, ones)
    assert root.tolist() == [0.25, 0.0]


def test_a_point_without_root_does_not_affect_the_others():
    ones = torch.ones(2, dtype=torch.float64)
    target = torch.tensor([0.5, torch.nan], dtype=torch.float64)
    root = consistent_root(lambda x: (target - x, -ones), ones > 0.0, 0.0 * ones, ones, ones)
    assert float(root[0]) == pytest.approx(0.5, rel=1e-12)


def test_its_derivative_is_that_of_the_implicit_function():
    # x + x^3 = a: dx/da = 1/(1 + 3 x^2); one evaluation, however many the root took.
    a = torch.linspace(0.1, 1.9, 20, dtype=torch.float64, requires_grad=True)
    evaluations = []

    def residual(x: Tensor) -> tuple[Tensor, Tensor]:
        evaluations.append(torch.is_grad_enabled())
        return a - x - x**3, -1.0 - 3.0 * x**2

    root = solved(residual, 20)
    root.sum().backward()
    torch.testing.assert_close(a.grad, 1.0 / (1.0 + 3.0 * root.detach() ** 2))
    assert sum(evaluations) == 1


def test_its_value_is_the_same_with_and_without_gradients():
    a = torch.linspace(0.1, 1.9, 20, dtype=torch.float64)

    def residual(x: Tensor) -> tuple[Tensor, Tensor]:
        return a - x - x**3, -1.0 - 3.0 * x**2

    with_gradients = solved(residual, 20)
    with torch.no_grad():
        assert torch.equal(solved(residual, 20), with_gradients)


def test_rounding_is_not_yielding():
    limit = torch.tensor([1e5], dtype=torch.float64)
    assert not exceeds(limit * (1.0 + 1e-14), limit, limit)
    assert exceeds(limit * (1.0 + 1e-12), limit, limit)
