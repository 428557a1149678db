"""Rows of tensors: invariants, and gradients where a deviator vanishes."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from granbench.models.components import outer, safe_root, tensor_rows
from granbench.tensors import deviatoric_stress, frobenius_norm, mean_stress, volumetric_strain

CASES = [("principal", 3), ("plane", 2), ("full", 3)]


def random_rows(count: int, seed: int) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return 1e5 * torch.randn(count, 5, generator=generator, dtype=torch.float64)


@pytest.mark.parametrize(("order", "dimension"), CASES)
@given(seed=st.integers(0, 2**31 - 1))
def test_invariants_are_those_of_the_component_orders(order, dimension, seed):
    rows = tensor_rows(order, dimension, torch.float64)
    tensors = random_rows(rows.count, seed)
    p, s = rows.split(tensors)
    torch.testing.assert_close(p, mean_stress(tensors.T, order))
    torch.testing.assert_close(rows.mean(tensors), p)
    torch.testing.assert_close(rows.deviatoric_stress(s), deviatoric_stress(tensors.T, order))
    torch.testing.assert_close(rows.trace(tensors), volumetric_strain(tensors.T, order))
    norm = rows.contraction(tensors, tensors).sqrt()
    torch.testing.assert_close(norm, frobenius_norm(tensors.T, order))
    torch.testing.assert_close(rows.joined(p, s, torch.ones_like(p)), tensors)


def test_plane_strain_rows_are_the_three_dimensional_ones():
    rows = tensor_rows("plane", 3, torch.float64)
    assert rows.labels == ("xx", "yy", "xy", "zz")
    tensors = random_rows(4, 0)
    full = torch.zeros(6, 5, dtype=torch.float64)
    full[[0, 1, 5, 2]] = tensors
    p, s = rows.split(tensors)
    torch.testing.assert_close(p, mean_stress(full.T, "full"))
    torch.testing.assert_close(rows.deviatoric_stress(s), deviatoric_stress(full.T, "full"))


@pytest.mark.parametrize(("order", "dimension"), [*CASES, ("plane", 3)])
@pytest.mark.parametrize("kind", [np.asarray, torch.as_tensor])
def test_no_bit_of_a_point_depends_on_how_many_others_there_are(order, dimension, kind):
    rows = tensor_rows(order, dimension, torch.float64)
    a, b = (np.random.default_rng(seed).normal(size=(rows.count, 40)) for seed in (0, 1))
    of_all = [rows.trace(kind(a)), rows.contraction(kind(a), kind(b)), *rows.split(kind(a))]
    for few in range(1, 9):
        x, y = (kind(np.ascontiguousarray(each[:, :few])) for each in (a, b))
        of_few = [rows.trace(x), rows.contraction(x, y), *rows.split(x)]
        for each, alone in zip(of_all, of_few, strict=True):
            assert (each[..., :few] == alone).all()


@pytest.mark.parametrize(("order", "dimension"), [*CASES, ("plane", 3)])
def test_matrices_of_hookes_law_act_as_they_are_named(order, dimension):
    rows = tensor_rows(order, dimension, torch.float64)
    tensors = random_rows(rows.count, 1)
    # Moving a shear row moves both entries of the tensor: the matrices take rows as they are.
    applied = torch.einsum("ijp,jq->iq", rows.deviatoric, tensors)
    torch.testing.assert_close(applied, rows.deviator(tensors))
    applied = torch.einsum("ijp,jq->iq", rows.spherical, tensors)
    torch.testing.assert_close(applied, rows.normal * rows.trace(tensors))
    product = outer(tensors, tensors)
    torch.testing.assert_close(product[0, 1], tensors[0] * tensors[1])


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_gradients_are_finite_where_the_deviator_vanishes(dtype):
    rows = tensor_rows("full", 3, dtype)
    deviator = torch.zeros(6, 2, dtype=dtype, requires_grad=True)
    q = rows.deviatoric_stress(deviator)
    (q.sum() + (deviator / q).sum()).backward()
    assert torch.isfinite(deviator.grad).all()
    assert (q < 1e-9).all()
    assert (q > 0.0).all()


def test_safe_root_is_the_root():
    square = torch.tensor([4.0, 1e-20, 0.0], dtype=torch.float64)
    torch.testing.assert_close(safe_root(square), square.sqrt(), rtol=1e-15, atol=1e-70)
