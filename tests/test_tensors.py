"""Laws of invariants: rotation, sign and the limits that define them."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from granbench.errors import ConfigurationError
from granbench.tensors import (
    COMPONENT_ORDERS,
    component_order,
    component_rotation,
    contraction_weights,
    deviatoric_stress,
    frobenius_norm,
    full_components,
    intermediate_stress_ratio,
    least_principal,
    lode_sin3,
    mean_stress,
    pi_plane,
    principal_difference,
    volumetric_strain,
)

seeds = st.integers(0, 2**32 - 1)
pressures = st.floats(1e3, 1e7)


def symmetric(seed: int) -> np.ndarray:
    matrix = np.random.default_rng(seed).normal(size=(3, 3)) * 1e5
    return matrix + matrix.T


def full(matrix: np.ndarray) -> np.ndarray:
    return np.array([matrix[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))])


def rotation(seed: int) -> np.ndarray:
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.diag(r))


@given(seeds, seeds)
def test_components_turn_as_the_tensor_does(seed, turn):
    matrix, turned = symmetric(seed), rotation(turn)
    expected = full(turned @ matrix @ turned.T)
    np.testing.assert_allclose(component_rotation(turned, "full") @ full(matrix), expected,
                               atol=1e-9)  # fmt: skip
    flat = np.linalg.qr(turned[:2, :2])[0]
    plane = np.array([matrix[0, 0], matrix[1, 1], matrix[0, 1]])
    after = flat @ matrix[:2, :2] @ flat.T
    np.testing.assert_allclose(component_rotation(flat, "plane") @ plane,
                               [after[0, 0], after[1, 1], after[0, 1]], atol=1e-9)  # fmt: skip


def test_principal_components_are_exchanged_but_not_turned():
    swap = np.eye(3)[[1, 0, 2]]
    assert (component_rotation(swap, "principal") @ [1.0, 2.0, 3.0] == [2.0, 1.0, 3.0]).all()
    with pytest.raises(ConfigurationError, match="exchanged"):
        component_rotation(rotation(0), "principal")


@given(seeds, seeds)
def test_invariants_do_not_change_under_rotation(seed, turn):
    stress = symmetric(seed)
    turned = rotation(turn) @ stress @ rotation(turn).T
    for invariant in (mean_stress, deviatoric_stress, volumetric_strain):
        before = invariant(full(stress), "full")
        assert invariant(full(turned), "full") == pytest.approx(before, rel=1e-9, abs=1e-6)


@given(seeds)
def test_principal_and_full_orders_agree(seed):
    stress = symmetric(seed)
    principal = np.linalg.eigvalsh(stress)
    for invariant in (mean_stress, deviatoric_stress, volumetric_strain):
        expected = invariant(full(stress), "full")
        assert invariant(principal) == pytest.approx(expected, rel=1e-9, abs=1e-6)


@given(seeds, st.floats(0.0, np.pi))
def test_plane_invariants_do_not_change_under_rotation_in_the_plane(seed, angle):
    a, b, c = np.random.default_rng(seed).normal(size=3) * 1e5
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turned = turn @ np.array([[a, c], [c, b]]) @ turn.T
    plane = np.array([turned[0, 0], turned[1, 1], turned[0, 1]])
    before = np.array([a, b, c])
    for invariant in (mean_stress, deviatoric_stress):
        expected = invariant(before, "plane")
        assert invariant(plane, "plane") == pytest.approx(expected, rel=1e-9, abs=1e-6)


@given(pressures, st.floats(0.01, 0.9))
def test_triaxial_compression_and_extension(pressure, ratio):
    """q = sigma_1 - sigma_3 in both; sin(3 theta) is +1 and -1, b is 0 and 1."""
    q = ratio * pressure
    compression = pressure + q * np.array([2.0, -1.0, -1.0]) / 3.0
    extension = pressure + q * np.array([1.0, 1.0, -2.0]) / 3.0
    for stress, sine, b in ((compression, 1.0, 0.0), (extension, -1.0, 1.0)):
        assert mean_stress(stress) == pytest.approx(pressure)
        assert deviatoric_stress(stress) == pytest.approx(q)
        assert lode_sin3(stress) == pytest.approx(sine)
        assert intermediate_stress_ratio(stress) == pytest.approx(b, abs=1e-9)


def test_plane_deviator_is_the_diameter_of_mohrs_circle():
    """sqrt(2 s:s) of pure shear tau is 2 tau, and of (s1, s2) it is s1 - s2 (Eq 6.29)."""
    assert deviatoric_stress(np.array([0.0, 0.0, 3.0]), "plane") == pytest.approx(6.0)
    assert deviatoric_stress(np.array([5.0, 1.0, 0.0]), "plane") == pytest.approx(4.0)


@given(seeds)
def test_distance_in_the_pi_plane_is_root_two_thirds_q(seed):
    stress = np.abs(np.random.default_rng(seed).normal(size=3)) * 1e5
    x, y = pi_plane(stress)
    assert np.hypot(x, y) == pytest.approx((2 / 3) ** 0.5 * deviatoric_stress(stress), rel=1e-6)


@given(seeds, pressures)
def test_pressure_changes_no_deviator(seed, pressure):
    stress = symmetric(seed)
    raised = full(stress + pressure * np.eye(3))
    assert deviatoric_stress(raised, "full") == pytest.approx(
        deviatoric_stress(full(stress), "full"), rel=1e-6
    )


def test_isotropic_stress_has_no_direction():
    isotropic = np.full(3, 1e5)
    with np.errstate(invalid="ignore"):
        assert np.isnan(intermediate_stress_ratio(isotropic))
        assert np.isnan(lode_sin3(isotropic))


@pytest.mark.parametrize("order", COMPONENT_ORDERS)
def test_numpy_and_torch_give_the_same_in_their_own_kind(order):
    stress = np.random.default_rng(0).normal(size=(4, 5, len(COMPONENT_ORDERS[order])))
    for invariant in (mean_stress, deviatoric_stress, volumetric_strain):
        from_torch = invariant(torch.from_numpy(stress), order)
        assert isinstance(from_torch, torch.Tensor)
        np.testing.assert_allclose(from_torch.numpy(), invariant(stress, order), rtol=1e-12)


@pytest.mark.parametrize("order", COMPONENT_ORDERS)
def test_labels_name_their_order(order):
    assert component_order(COMPONENT_ORDERS[order]) == order


def test_an_unknown_order_is_refused_with_those_known():
    with pytest.raises(ConfigurationError, match=r"principal"):
        component_order(("11", "33"))
    with pytest.raises(ConfigurationError, match="use principal, plane, full"):
        mean_stress(np.zeros(3), "polar")


def test_the_least_principal_stress_is_the_same_in_every_order() -> None:
    rng = np.random.default_rng(3)
    plane = rng.normal(size=(50, 3))
    full = np.zeros((50, 6))
    full[:, [0, 1, 5]] = plane
    full[:, 2] = 10.0  # out of the plane, above the others
    np.testing.assert_allclose(least_principal(plane, "plane"), least_principal(full, "full"))
    eigenvalues = np.sort(rng.normal(size=(50, 3)))
    np.testing.assert_array_equal(least_principal(eigenvalues), eigenvalues[:, 0])
    inside = plane[:, 0] * plane[:, 1] > plane[:, 2] ** 2
    positive = (least_principal(plane, "plane") > 0.0) == (inside & (plane[:, 0] > 0.0))
    assert positive.all()


@given(seeds, seeds)
def test_contraction_weights_count_every_entry_of_the_tensor(one, other):
    a, b = symmetric(one), symmetric(other)
    weights = np.array(contraction_weights("full"))
    expected = float((a * b).sum())
    scale = float(np.abs(a * b).sum())
    assert weights @ (full(a) * full(b)) == pytest.approx(expected, abs=1e-12 * scale)


@given(seeds)
def test_full_components_of_plane_strain_have_no_shear_out_of_the_plane(seed):
    plane, zz = np.random.default_rng(seed).normal(size=(2, 5, 3)) * 1e5, np.full((2, 5), 7e4)
    tensor = full_components(plane, zz)
    assert mean_stress(tensor, "full") == pytest.approx((plane[..., 0] + plane[..., 1] + zz) / 3)
    norm = frobenius_norm(tensor, "full") ** 2
    assert norm == pytest.approx(frobenius_norm(plane, "plane") ** 2 + zz**2)


@given(seeds)
def test_principal_difference_is_that_of_the_eigenvalues(seed):
    matrix = symmetric(seed)[:2, :2]
    low, high = np.linalg.eigvalsh(matrix)
    plane = np.array([matrix[0, 0], matrix[1, 1], matrix[0, 1]])
    assert principal_difference(plane) == pytest.approx(high - low)
    assert least_principal(plane, "plane") == pytest.approx(low)
