"""The Lode angle, and the invariants of the deviators a s_0 + b d, against the whole tensor."""

import math

import numpy as np
import pytest
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from plastic_paths import PLACES, rotated, rotation
from torch import Tensor

from granbench.models.components import tensor_rows
from granbench.models.lode import ISOTROPIC, DeviatorPlane, deviator_plane, lode_sin3

ORDERS = ("principal", "plane", "full")
PLACES_OF_ROWS = {
    "principal": ((0, 0), (1, 1), (2, 2)),
    "plane": (*PLACES["plane"], (2, 2)),
    "full": PLACES["full"],
}

components = st.lists(st.floats(-1e6, 1e6), min_size=6, max_size=6)
weights = st.floats(-3.0, 3.0)
seeds = st.integers(0, 2**31 - 1)


def rows_of(order: str):
    return tensor_rows(order, 3, torch.float64)


def deviator_of(order: str, entries: list[float]) -> Tensor:
    """A deviator (component, 1) of six numbers, of which an order takes as many as it has rows."""
    rows = rows_of(order)
    return rows.deviator(torch.tensor(entries[: rows.count], dtype=torch.float64)[:, None])


def matrix_of(order: str, deviator: Tensor) -> np.ndarray:
    """The symmetric matrix of rows (component, 1)."""
    matrix = np.zeros((3, 3))
    for (i, j), value in zip(PLACES_OF_ROWS[order], deviator[:, 0].tolist(), strict=True):
        matrix[i, j] = matrix[j, i] = value
    return matrix


def plane_of(order: str, start: Tensor, direction: Tensor) -> DeviatorPlane:
    return deviator_plane(rows_of(order), start, direction, lode=True)


def sin3_of(order: str, deviator: Tensor) -> Tensor:
    """Sin(3 theta) of deviators (component, point)."""
    plane = plane_of(order, deviator, deviator)
    return lode_sin3(plane.square_0, plane.cubic_0)[0]


def sin3_of_eigenvalues(matrix: np.ndarray) -> float:
    """From b = (s2 - s3)/(s1 - s3): tan(theta) = (1 - 2 b)/sqrt(3), theta = 30 degrees at b = 0."""
    third, second, first = np.linalg.eigvalsh(matrix)
    b = (second - third) / (first - third)
    return math.sin(3.0 * math.atan2(1.0 - 2.0 * b, math.sqrt(3.0)))


@pytest.mark.parametrize("order", ORDERS)
@given(entries=components)
@settings(deadline=None)
def test_the_lode_angle_is_that_of_the_principal_stresses(order, entries):
    deviator = deviator_of(order, entries)
    matrix = matrix_of(order, deviator)
    # det(s)/q^3 loses what the eigenvalues keep only where q is next to the isotropic threshold.
    assume(np.linalg.norm(matrix) > 1.0)
    assert float(sin3_of(order, deviator)) == pytest.approx(sin3_of_eigenvalues(matrix), abs=1e-8)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("size", [1.0, 1e3, 1e7])
def test_compression_extension_and_pure_shear(axis, size):
    """+1 where one stress is larger than two equal ones, -1 where it is smaller, 0 at b = 1/2."""
    along = torch.zeros(3, 3, dtype=torch.float64)
    along[:, 0] = along[:, 1] = -size
    along[axis, 0] = 2.0 * size
    along[axis, 1] = 2.0 * size
    along[:, 1] *= -1.0
    along[:, 2] = torch.tensor([size, 0.0, -size]).roll(axis)
    # (1 mPa)^3 is added to q^3 sin(3 theta), so that an isotropic stress has +1.
    expected = torch.tensor([1.0, -1.0, 0.0], dtype=torch.float64)
    torch.testing.assert_close(
        sin3_of("principal", along), expected, rtol=0.0, atol=3e-16 + (ISOTROPIC / size) ** 3
    )


@pytest.mark.parametrize("order", ["plane", "full"])
def test_pure_shear_on_a_plane_is_pure_shear(order):
    shear = [0.0] * rows_of(order).count
    shear[2 if order == "plane" else 5] = 7e4
    assert float(sin3_of(order, torch.tensor(shear).double()[:, None])) == pytest.approx(
        0.0, abs=1e-20
    )


@given(entries=components, seed=seeds)
@settings(deadline=None)
def test_invariants_do_not_turn_with_the_axes(entries, seed):
    deviator = deviator_of("full", entries)
    assume(float(deviator.abs().max()) > 1.0)
    turned = rotated(deviator.T, "full", rotation(seed, plane=False)).T
    here, there = (plane_of("full", tensor, tensor) for tensor in (deviator, turned))
    torch.testing.assert_close(there.square_0, here.square_0, rtol=1e-13, atol=0.0)
    size = here.square_0**1.5
    torch.testing.assert_close(there.cubic_0 / size, here.cubic_0 / size, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("order", ORDERS)
@given(start=components, direction=components, a=weights, b=weights)
@settings(deadline=None)
def test_polynomials_of_the_plane_are_the_invariants_of_the_tensor(order, start, direction, a, b):
    """q^2 = 3/2 s:s and q^3 sin(3 theta) = 27/2 det(s) of s = a s_0 + b d."""
    s_0, d = deviator_of(order, start), deviator_of(order, direction)
    plane = plane_of(order, s_0, d)
    a, b = (torch.tensor([number], dtype=torch.float64) for number in (a, b))
    matrix = matrix_of(order, a * s_0 + b * d)
    # What cancels is of the size of the terms.
    size = float(a.abs() * s_0.norm() + b.abs() * d.norm())
    assert float(plane.square(a, b)) == pytest.approx(
        1.5 * np.sum(matrix * matrix), abs=1e-13 * size**2 + 1e-200
    )
    assert float(plane.cubic(a, b)) == pytest.approx(
        13.5 * np.linalg.det(matrix), abs=1e-12 * size**3 + 1e-200
    )
    one = torch.ones_like(a)
    of_one = (plane.square(one, b), plane.cubic(one, b))
    size = float(s_0.norm() + b.abs() * d.norm())
    for power, (mine, theirs) in enumerate(zip(plane.unscaled(b), of_one, strict=True), start=2):
        torch.testing.assert_close(mine, theirs, rtol=0.0, atol=1e-13 * size**power + 1e-200)


@pytest.mark.parametrize("order", ORDERS)
def test_slopes_are_derivatives_by_b(order):
    generator = torch.Generator().manual_seed(1)
    rows = rows_of(order)
    start, direction = (
        rows.deviator(torch.randn(rows.count, 50, generator=generator, dtype=torch.float64))
        for _ in range(2)
    )
    plane = plane_of(order, start, direction)
    a, b = torch.randn(2, 50, generator=generator, dtype=torch.float64).unbind()
    b.requires_grad_()
    for value, slope in (
        (plane.square(a, b), plane.square_slope(a, b)),
        (plane.cubic(a, b), plane.cubic_slope(a, b)),
    ):
        (expected,) = torch.autograd.grad(value.sum(), b)
        torch.testing.assert_close(slope, expected, rtol=1e-12, atol=1e-12)


def test_third_invariants_are_computed_only_on_request():
    rows = rows_of("full")
    deviator = deviator_of("full", [3.0, 1.0, -2.0, 0.5, 0.0, 1.0])
    bare = deviator_plane(rows, deviator, deviator, lode=False)
    whole = plane_of("full", deviator, deviator)
    one = torch.ones(1, dtype=torch.float64)
    assert torch.equal(bare.square(one, one), whole.square(one, one))


def test_an_isotropic_stress_counts_as_compression_with_finite_gradients():
    stress = torch.zeros(3, 4, dtype=torch.float64)
    stress[0] = torch.tensor([0.0, 1e-300, 1e-8, 1e-4])
    stress = (stress - stress.mean(dim=0)).requires_grad_()
    sin3 = sin3_of("principal", stress)
    sin3.sum().backward()
    torch.testing.assert_close(sin3.detach(), torch.ones(4).double(), rtol=0.0, atol=2e-3)
    assert torch.isfinite(stress.grad).all()
    # Exactly there, where a direction means nothing, it has no gradient either.
    assert (stress.grad[:, 0] == 0.0).all()


@pytest.mark.parametrize("size", [1.0, 1e5])
@pytest.mark.parametrize(("kind", "expected"), [("compression", 1.0), ("extension", -1.0)])
def test_on_the_meridians_the_lode_angle_is_stationary(size, kind, expected):
    """sin(3 theta) is largest in compression and smallest in extension: no gradient there."""
    sign = math.copysign(1.0, expected)
    stress = size * sign * torch.tensor([[2.0], [-1.0], [-1.0]], dtype=torch.float64)
    stress.requires_grad_()
    sin3 = sin3_of("principal", rows_of("principal").deviator(stress))
    sin3.sum().backward()
    assert float(sin3.detach()) == pytest.approx(expected, abs=1e-8)
    # Per relative change of the stress; ISOTROPIC^3 over q^3 remains.
    assert float(stress.grad.abs().max() * size) < 1e-7


@given(b=st.floats(0.02, 0.98), size=st.floats(1.0, 1e6))
@settings(deadline=None)
def test_between_the_meridians_the_gradient_is_that_of_finite_differences(b, size):
    stress = size * torch.tensor([[1.0], [b], [0.0]], dtype=torch.float64)
    stress.requires_grad_()

    def sin3(stress: Tensor) -> Tensor:
        return sin3_of("principal", rows_of("principal").deviator(stress))

    (gradient,) = torch.autograd.grad(sin3(stress).sum(), stress)
    step = 1e-6 * size
    for k in range(3):
        shift = torch.zeros_like(stress)
        shift[k] = step
        right, left = (sin3(stress.detach() + sign * shift) for sign in (1.0, -1.0))
        # Curvatures of some 100 times 1e-12, and rounding over 2e-6.
        assert float(gradient[k] * size) == pytest.approx(
            float((right - left) / 2e-6), abs=2e-9, rel=1e-7
        )
