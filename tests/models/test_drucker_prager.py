"""Drucker-Prager against its closed forms, and at the apex."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from plastic_paths import compressed, invariants, isotropic, run, stress_of

from granbench.cells.contract import Conditions
from granbench.errors import ModelError
from granbench.models.drucker_prager import DruckerPrager

FRICTION, DILATION = math.radians(15.0), math.radians(8.0)


def test_strength_in_the_plane_is_rankines():
    # M = 2 sin(phi) in the plane: s1/s3 = (2 + M)/(2 - M) = (1 + sin phi)/(1 - sin phi) = K_p.
    cell = DruckerPrager()
    states = compressed(cell, isotropic(cell, 1), (0.0, 1e-3, 0.0), (0,), 300)
    passive = (1.0 + math.sin(FRICTION)) / (1.0 - math.sin(FRICTION))
    # Newton's tolerance on the lateral stress is 1e-6 Pa.
    assert float(states[-1, 0, 1]) == pytest.approx(passive * 1e5, rel=1e-10)


def test_dilation_in_the_plane_is_that_of_the_dilation_angle():
    # At constant stress all strain is plastic: -d eps_v/d gamma = sin(psi) = M_d/2.
    cell = DruckerPrager()
    start = compressed(cell, isotropic(cell, 1), (0.0, 1e-3, 0.0), (0,), 300)[-1]
    lateral = -torch.linspace(5e-4, 2.5e-3, 4001, dtype=torch.float64)
    trial = torch.stack([lateral, torch.full_like(lateral, 1e-3), torch.zeros_like(lateral)], -1)
    with torch.no_grad():
        stress, _ = cell.step(trial, start.expand(len(lateral), -1))
    found = lateral[(stress[:, 0] - 1e5).abs().argmin()]
    volumetric, shear = 1e-3 + found, 1e-3 - found
    # The lateral strain is known to half a division of 5e-7.
    assert float(-volumetric / shear) == pytest.approx(math.sin(DILATION), abs=3e-4)


def plane_strain(friction_slope: float, dilation_slope: float, steps: int) -> torch.Tensor:
    """End of a smooth biaxial test at constant s3, in principal axes, 33 kept from straining."""
    values = {
        "bulk_modulus": 2e7,
        "shear_modulus": 1.2e7,
        "friction_slope": friction_slope,
        "dilation_slope": dilation_slope,
    }
    cell = DruckerPrager(values, order="principal")
    return compressed(cell, isotropic(cell, 1), (5e-3, 0.0, 0.0), (1,), steps)[-1]


@pytest.mark.parametrize(
    ("friction_slope", "dilation_slope"), [(0.9, 0.4), (0.9, 0.9), (1.2, 0.6), (0.6, 0.1)]
)
def test_plane_strain_strength_is_the_equivalent_friction_angle(friction_slope, dilation_slope):
    # sin(phi_eq) = 3 al r with r = sqrt(1 - 3 al_psi^2)/(1 - 3 al al_psi), al = M/(3 sqrt 3).
    al, al_psi = (slope / (3.0 * math.sqrt(3.0)) for slope in (friction_slope, dilation_slope))
    sine = 3.0 * al * math.sqrt(1.0 - 3.0 * al_psi**2) / (1.0 - 3.0 * al * al_psi)
    major, minor, middle = plane_strain(friction_slope, dilation_slope, 200)[0].tolist()
    # The out-of-plane stress comes to rest slowly; the strength is at its maximum there.
    assert (major - minor) / (major + minor) == pytest.approx(sine, rel=2e-4)
    # And there it is p + 2 al_psi sqrt(J2).
    p = (major + minor + middle) / 3.0
    root_j2 = friction_slope * p / math.sqrt(3.0)
    assert middle == pytest.approx(p + 2.0 * al_psi * root_j2, rel=1e-2)


def test_associated_plane_strain_strength_is_the_inner_mohr_coulomb_match():
    # al = tan(phi)/sqrt(9 + 12 tan^2 phi), here for phi = 25 degrees.
    tangent = math.tan(math.radians(25.0))
    slope = 3.0 * math.sqrt(3.0) * tangent / math.sqrt(9.0 + 12.0 * tangent**2)
    major, minor, _ = plane_strain(slope, slope, 200)[0].tolist()
    passive = math.tan(math.radians(45.0 + 12.5)) ** 2
    assert major / minor == pytest.approx(passive, rel=1e-4)  # the middle stress comes to rest


def test_without_dilation_the_asymptote_is_approached_slowly():
    # sin(phi_ps) = M/sqrt 3, 43.85 degrees for M = 1.2; at 6 % strain it is still 11 % low.
    values = {
        "bulk_modulus": 1e7 / (3.0 * 0.4),
        "shear_modulus": 1e7 / 2.6,
        "friction_slope": 1.2,
        "dilation_slope": 0.0,
    }
    cell = DruckerPrager(values, order="principal")
    states = compressed(cell, isotropic(cell, 1), (1e-3, 0.0, 0.0), (1,), 60)
    sine = 1.2 / math.sqrt(3.0)
    asymptote = (1.0 + sine) / (1.0 - sine) * 1e5
    # E/s3 = 100 and nu = 0.3; the closed forms give the 11 % to one digit.
    assert float(states[-1, 0, 0]) == pytest.approx(0.89 * asymptote, rel=2e-2)


@pytest.mark.parametrize("order", ["principal", "plane", "full"])
def test_stretching_ends_at_the_apex_to_the_last_bit(order):
    cell = DruckerPrager(order=order)
    unit = cell.rows.normal[:, 0]
    stretch = (-1.0 * unit).repeat(3, 1, 1).double() + 0.05 * torch.randn(
        3, 1, len(unit), generator=torch.Generator().manual_seed(1), dtype=torch.float64
    )
    stress = stress_of(cell, run(cell, stretch, isotropic(cell, 1)))
    assert torch.equal(stress, torch.zeros_like(stress))
    # And compression brings it back along its elastic line.
    apex = run(cell, stretch, isotropic(cell, 1))[-1]
    back, _ = cell.step(1e-3 * unit[None], apex)
    bulk = cell.values()["bulk_modulus"] * cell.rows.dimension
    torch.testing.assert_close(back, 1e-3 * bulk * unit[None], rtol=1e-12, atol=0.0)


@torch.no_grad()
def test_the_apex_takes_over_where_the_cone_would_give_a_negative_q():
    # q_cone = q - 4 G d lambda = 0 divides the trial stresses, on the line q = -4 G/(K M_d) p.
    cell = DruckerPrager()
    c = cell.values()
    slope = 4.0 * c["shear_modulus"] / (c["bulk_modulus"] * c["dilation_slope"])
    p = torch.full((2,), -1e4, dtype=torch.float64)
    q = slope * 1e4 * torch.tensor([1.0 + 1e-6, 1.0 - 1e-6], dtype=torch.float64)
    trial = torch.stack([p + q / 2.0, p - q / 2.0, torch.zeros(2, dtype=torch.float64)], dim=-1)
    stress, state = cell.step(torch.zeros(2, 3), trial)
    p, q = invariants(cell, state)
    assert float(q[0]) == pytest.approx(c["friction_slope"] * float(p[0]), rel=1e-10)
    assert 0.0 < float(p[0]) < 1.0
    assert torch.equal(stress[1], torch.zeros_like(stress[1]))


@given(
    st.lists(st.floats(-0.5, 0.5), min_size=3, max_size=3),
    st.sampled_from([-0.3, 0.0, 0.28, 0.5]),
    st.floats(1e-3, 1e7),
)
@settings(max_examples=60, deadline=None)
def test_no_increment_leaves_the_cone_or_makes_nan(increment, dilation_slope, pressure):
    cell = DruckerPrager({"dilation_slope": dilation_slope})
    strain = torch.tensor([increment], dtype=torch.float64, requires_grad=True)
    stress, after = cell.step(strain, isotropic(cell, 1, pressure))
    stress.sum().backward()
    assert torch.isfinite(strain.grad).all()
    assert all(torch.isfinite(value.grad) for value in cell.free.values())
    p, q = invariants(cell, after.detach())
    assert (p >= 0.0).all()
    # Rounding of the trial stress, up to 1e6 Pa.
    assert (q <= cell.values()["friction_slope"] * p + 1e-9).all()


def test_gradients_at_the_apex_are_zero():
    cell = DruckerPrager()
    strain = torch.tensor([[-0.5, -0.5, 0.0], [-0.5, -0.4, 0.1]], dtype=torch.float64)
    strain.requires_grad_()
    stress, _ = cell.step(strain, isotropic(cell, 2))
    stress.square().sum().backward()
    assert torch.equal(strain.grad, torch.zeros_like(strain))


def test_a_start_in_tension_is_refused():
    cell = DruckerPrager()
    stress = torch.tensor([[1e5, 1e5, 0.0], [-1e3, 0.0, 0.0]], dtype=torch.float64)
    with pytest.raises(ModelError, match="point 1 starts at a mean stress of -500 Pa"):
        cell.initial_state(Conditions(stress))


def test_a_flow_that_no_return_can_stop_is_no_number():
    # 2 k G + K M M_d < 0: contraction raises f faster than shear lowers it.
    values = {"shear_modulus": 1e5, "friction_slope": 1.0, "dilation_slope": -0.9}
    cell = DruckerPrager({**values, "bulk_modulus": 1e6})
    stress, _ = cell.step(torch.tensor([[0.9, -0.9, 0.0], [0.0, 0.0, 0.0]]), isotropic(cell, 2))
    assert torch.isnan(stress[0]).all()
    assert torch.equal(stress[1].detach(), isotropic(cell, 1)[0])
