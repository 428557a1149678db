"""Derivatives of what a fit compares: both modes agree with each other and with differences."""

import pytest
import torch
from made_tests import drained, j2, loading_and_unloading

from granbench.fitting.least_squares import LeastSquares
from granbench.fitting.observations import batches_of
from granbench.fitting.parameter_space import ParameterSpace

TRUE = {"bulk_modulus": 3.1e6, "shear_modulus": 1.3e6, "yield_stress": 6.3e4}


@pytest.fixture(scope="module", params=["strain", "mixed"])
def problem(request: pytest.FixtureRequest) -> LeastSquares:
    tests = [
        drained(j2(**TRUE), loading_and_unloading(9), name="cyclic"),
        drained(j2(**TRUE), loading_and_unloading(6)[:5], pressure=2e5, name="shorter"),
    ]
    # Far from the truth, so that residuals are not small, and the model yields in other steps.
    space = ParameterSpace.of(j2(bulk_modulus=2e6, shear_modulus=1e6, yield_stress=5e4))
    return LeastSquares(space, batches_of(tests, control=request.param))


@pytest.fixture(scope="module")
def vectors(problem: LeastSquares) -> torch.Tensor:
    generator = torch.Generator().manual_seed(1)
    return 0.3 * torch.randn(2, problem.space.size, generator=generator, dtype=torch.float64)


def test_jacobian_agrees_with_central_differences(
    problem: LeastSquares, vectors: torch.Tensor
) -> None:
    _, jacobian = problem.linearised(vectors)
    size = 1e-5
    for place in range(problem.space.size):
        shift = torch.zeros_like(vectors)
        shift[:, place] = size
        ahead, behind = problem.residuals(vectors + shift), problem.residuals(vectors - shift)
        # Held stresses are met to 1e-9, which a difference over 2e-5 turns into 5e-5 at most.
        torch.testing.assert_close(
            jacobian[..., place], (ahead - behind) / (2.0 * size), rtol=1e-5, atol=5e-5
        )


def test_back_propagation_gives_the_gradient_of_the_forward_mode(
    problem: LeastSquares, vectors: torch.Tensor
) -> None:
    variable = vectors.clone().requires_grad_()
    loss = problem.loss(variable)
    loss.sum().backward()
    residual, jacobian = problem.linearised(vectors)
    gradient = 2.0 * torch.einsum("vrp,vr->vp", jacobian, residual)
    # Both are exact; only the order of the sums differs.
    torch.testing.assert_close(loss.detach(), (residual**2).sum(dim=1), rtol=1e-6, atol=0.0)
    torch.testing.assert_close(variable.grad, gradient, rtol=1e-6, atol=1e-9)


def test_residuals_of_the_truth_vanish(problem: LeastSquares) -> None:
    cell = problem.space.cell
    truth = torch.tensor([[TRUE[name] / cell.values()[name] for name in problem.space.names]])
    residual = problem.residuals(truth.double().log())
    # A held stress may be off by 1e-9 of the stress, and J2 flows freely once it yields.
    assert residual.abs().max() < 1e-6


def test_a_vector_does_not_depend_on_the_others(
    problem: LeastSquares, vectors: torch.Tensor
) -> None:
    together, _ = problem.linearised(vectors)
    alone, _ = problem.linearised(vectors[1:])
    torch.testing.assert_close(together[1:], alone, rtol=1e-9, atol=1e-9)
