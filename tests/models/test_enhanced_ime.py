"""Enhanced IME: its limits, friction, dilation, stiffness and apex."""

import itertools
import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from plastic_paths import (
    compressed,
    invariants,
    isotropic,
    plastic_rows,
    random_increments,
    run,
    stress_of,
)

from granbench.models.enhanced_ime import EnhancedIME
from granbench.models.ime import IME

PLAIN = {
    "stiffness_exponent": 0.0,
    "pressure_slope": 0.0,
    "flow_slope": 0.0,
    "volumetric_hardening_modulus": 1e-9,
}
"""What the enhancement adds, taken away."""


def parts(cell: EnhancedIME, state: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """eps_v^p and eps_s^p, (point,)."""
    plastic = plastic_rows(cell, state)
    shear = cell.rows.deviator(plastic)
    return cell.rows.trace(plastic), (cell.rows.contraction(shear, shear) / 1.5).sqrt()


def test_without_what_it_adds_it_is_ime():
    # ||eps^p||_F = sqrt(3/2) eps_s^p without volume: A and eps_0 of IME in terms of eps_s^p.
    enhanced = EnhancedIME(
        {
            **PLAIN,
            "yield_stress": 1e3,
            "shear_hardening_modulus": 0.3e6 * 1.5**0.1,
            "shear_hardening_strain": 0.02 / math.sqrt(1.5),
        },
        order="full",
    )
    ime = IME(order="full")
    increments = random_increments(ime, 20, 40, 2e-3)
    stress, expected = (
        stress_of(cell, run(cell, increments, isotropic(cell, 20))) for cell in (enhanced, ime)
    )
    # Both solve the same equation, to 1e-12 of the trial stress, forty times.
    torch.testing.assert_close(stress, expected, rtol=1e-9, atol=1e-4)


@pytest.mark.parametrize("pressure", [1e5, 1e6])
def test_strength_grows_with_the_mean_stress(pressure):
    cell = EnhancedIME(
        {"pressure_slope": -0.5, "flow_slope": 0.2, "stiffness_exponent": 0.0}, order="principal"
    )
    state = compressed(cell, isotropic(cell, 1, pressure), (4e-3, 0.0, 0.0), (1, 2), 25, pressure)[
        -1
    ]
    p, q = invariants(cell, state)
    volumetric, shear = (float(part) for part in parts(cell, state))
    hardening = 3e5 * (0.02 + shear) ** 0.2 + 3e5 * 0.02**0.2
    assert volumetric < 0.0  # it dilates: the volumetric part stays what it was
    assert float(q) == pytest.approx(0.5 * float(p) + hardening + 1e4, rel=1e-10)


def test_plastic_strain_dilates_by_the_slope_of_the_potential():
    # dg/dp = C_d + C_p at dg/dsigma_v = 1: d eps_v^p = (C_d + C_p) d eps_s^p.
    cell = EnhancedIME({"pressure_slope": -0.5, "flow_slope": 0.2}, order="principal")
    state = compressed(cell, isotropic(cell, 1), (4e-3, 0.0, 0.0), (1, 2), 25)[-1]
    volumetric, shear = parts(cell, state)
    assert float(volumetric) == pytest.approx(-0.3 * float(shear), rel=1e-10)


@torch.no_grad()
@pytest.mark.parametrize("slope", [-0.3, 0.3])
def test_unloading_shows_the_stiffness_of_the_plastic_volumetric_strain(slope):
    """E = E_0 (1 + eps_v^p)^n_E: softer after dilation, stiffer after compaction."""
    cell = EnhancedIME(
        {"pressure_slope": -0.1, "flow_slope": slope + 0.1, "stiffness_exponent": 2.0},
        order="principal",
    )
    state = compressed(cell, isotropic(cell, 1), (4e-3, 0.0, 0.0), (1, 2), 30)[-1]
    volumetric, _ = parts(cell, state)
    assert math.copysign(1.0, float(volumetric)) == math.copysign(1.0, slope)
    shear = torch.tensor([[-1e-5, 5e-6, 5e-6]], dtype=torch.float64)
    change = cell.step(shear, state)[0] - state[:, :3]
    young = 2e7 * (1.0 + float(volumetric)) ** 2
    expected = young / 1.2 * shear
    torch.testing.assert_close(change, expected, rtol=1e-8, atol=1e-6)


@torch.no_grad()
def test_compaction_hardens_and_dilation_does_not_soften():
    cell = EnhancedIME()
    c = cell.constants()
    compaction = torch.tensor([-0.5, -0.02, 0.0, 0.02], dtype=torch.float64)
    strength, _, by_volume = cell._strength(c, torch.zeros(4, dtype=torch.float64), compaction)
    first = 1e4 + 2.0 * 3e5 * 0.02**0.2
    assert strength[:3].tolist() == pytest.approx([first] * 3, rel=1e-12)
    assert float(strength[3]) == pytest.approx(1e4 + 3e5 * 0.02**0.2 + 3e5 * 0.04**0.2, rel=1e-12)
    assert (by_volume >= 0.0).all()


@pytest.mark.parametrize("order", ["principal", "plane", "full"])
def test_where_nothing_compacts_gradients_are_those_of_dilation(order):
    """C_d = -C_p of the default set keeps eps_v^p at zero, the kink of <eps_v^p> in Eq 7.18.

    On either side of it the derivatives with respect to the state differ; rounding must not choose.
    """
    cell, points = EnhancedIME(order=order), 12
    count = cell.rows.count
    increments = random_increments(cell, points, 8, 5e-3)
    state = run(cell, increments, isotropic(cell, points))[-1]
    beyond_yield = random_increments(cell, points, 1, 5e-2, seed=1)[0]
    # Three plastic strains of some 1e-2 were added, each rounded to 2e-18: none, either sign.
    assert float(cell.rows.trace(plastic_rows(cell, state)).abs().max()) < 1e-17
    state[::2, count] += 2e-18
    assert (cell.rows.trace(plastic_rows(cell, state)) > 0.0).any()

    def strength(plastic: torch.Tensor) -> torch.Tensor:
        changed = torch.cat([state[:, :count], plastic], dim=1)
        p, q = invariants(cell, cell.step(beyond_yield, changed)[1])
        return q - 0.1 * p  # C_p: H + sigma_0 where it yields

    plastic = state[:, count:].clone().requires_grad_()
    (gradient,) = torch.autograd.grad(strength(plastic).sum(), plastic)
    step = 1e-7
    with torch.no_grad():
        for component in range(2):
            shift = torch.zeros_like(plastic)
            shift[:, component] = step
            compacting, dilating = (
                sign * (strength(plastic + sign * shift) - strength(plastic)) / step
                for sign in (1.0, -1.0)
            )
            # H grows by some 1e7 Pa a strain; one-sided differences are off by step/eps_0 of it.
            torch.testing.assert_close(gradient[:, component], dilating, rtol=0.0, atol=1e3)
            assert ((compacting - dilating) > 1e5).any()


def test_a_changing_stiffness_is_followed_to_second_order():
    # A straight path beyond yield, on which only the stiffness changes: half the step, a quarter
    # of the error.
    cell = EnhancedIME(
        {"pressure_slope": -0.4, "flow_slope": 0.1, "stiffness_exponent": -3.0}, order="principal"
    )
    direction = torch.tensor([[1.0, -0.5, -0.4]], dtype=torch.float64)
    yielding = run(cell, 0.03 * direction[None], isotropic(cell, 1))[-1]

    def end(steps: int) -> torch.Tensor:
        path = (0.1 / steps * direction).expand(steps, 1, 3)
        return stress_of(cell, run(cell, path, yielding)[-1])

    exact = end(256)
    errors = [float((end(steps) - exact).norm()) for steps in (4, 8, 16)]
    for coarse, fine in itertools.pairwise(errors):
        assert fine == pytest.approx(0.25 * coarse, rel=0.25)


@torch.no_grad()
@pytest.mark.parametrize("flow_slope", [0.1, 0.3, 0.5])
def test_stretching_ends_at_the_apex(flow_slope):
    """p = (H + sigma_0)/C_p and q = 0, with and without dilation on the cone."""
    cell = EnhancedIME(
        {"pressure_slope": -0.5, "flow_slope": flow_slope, "stiffness_exponent": 0.0},
        order="principal",
    )
    stretch = torch.tensor([[-0.16, -0.15, -0.14]], dtype=torch.float64)
    state = run(cell, stretch.expand(2, 1, 3), isotropic(cell, 1))[-1]
    p, q = invariants(cell, state)
    volumetric, shear = (float(part) for part in parts(cell, state))
    hardening = 3e5 * (0.02 + shear) ** 0.2 + 3e5 * 0.02**0.2
    assert float(p) == pytest.approx(-(hardening + 1e4) / 0.5, rel=1e-10)
    assert float(q) < 1e-6
    assert volumetric < 0.0
    assert torch.equal(cell.step(torch.zeros_like(stretch), state)[1], state)


def test_the_optimised_set_runs_where_it_was_fitted():
    """Negative exponents of hardening and stiffness, almost no cohesion, an axial strain of 5 %."""
    cell = EnhancedIME(parameter_set="guan2023-tab7.2-optimised", order="principal")
    states = compressed(cell, isotropic(cell, 1), (1e-3, 0.0, 0.0), (1, 2), 50)
    assert torch.isfinite(states).all()
    p, q = invariants(cell, states[-1])
    # Friction is nearly all of the strength: H is below 1e-2 of it.
    assert float(q) == pytest.approx(0.512 * float(p), rel=2e-1)


def test_beyond_twice_its_volume_there_is_no_stiffness():
    cell = EnhancedIME({"pressure_slope": -0.5, "flow_slope": 0.1}, order="principal")
    stretch = torch.tensor([[-0.5, -0.5, -0.5], [0.0, 0.0, 0.0]], dtype=torch.float64)
    stress, _ = cell.step(stretch, isotropic(cell, 2))
    assert torch.isnan(stress[0]).all()
    assert torch.isfinite(stress[1]).all()


@given(
    st.lists(st.floats(-0.2, 0.2), min_size=6, max_size=6),
    st.floats(-1.2, 0.5),
    st.floats(-0.2, 0.6),
    st.sampled_from([-2.0, 0.0, 0.5]),
)
@settings(max_examples=40, deadline=None)
def test_every_increment_is_followed_with_finite_gradients(entries, pressure, flow, exponent):
    values = {"pressure_slope": pressure, "flow_slope": flow, "stiffness_exponent": exponent}
    cell = EnhancedIME(values, order="principal")
    increments = torch.tensor(entries, dtype=torch.float64).reshape(2, 1, 3).requires_grad_()
    state = isotropic(cell, 1)
    for increment in increments:
        _, state = cell.step(increment, state)
    if (cell.rows.trace(plastic_rows(cell, state)) <= -1.0).any():
        return  # it has no stiffness left
    assert torch.isfinite(state).all()
    state.sum().backward()
    assert torch.isfinite(increments.grad).all()
    assert all(torch.isfinite(value.grad) for value in cell.free.values())
