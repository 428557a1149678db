"""J2 with power-law hardening: the consistency equation, its roots, and reversals."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from plastic_paths import compressed, invariants, isotropic, plastic_rows, random_increments, run

from granbench.cells.contract import Conditions
from granbench.models.j2_hardening import J2Hardening

SHEAR, MODULUS, EXPONENT, STRAIN = 2e6 / 2.4, 4e5, 0.5, 0.0625


def strength(norm: float) -> float:
    return MODULUS * (norm + STRAIN) ** EXPONENT


def stress_free(cell: J2Hardening, points: int = 1) -> torch.Tensor:
    return cell.initial_state(Conditions(torch.zeros(points, 3, dtype=torch.float64)))


def test_the_first_yield_stress_is_that_of_j2():
    assert strength(0.0) == pytest.approx(1e5, rel=1e-14)
    cell = J2Hardening()
    # q = 2 s_xy in simple shear: the elastic limit is at eps_xy = sigma_Y/(4 G).
    limit = 1e5 / (4.0 * SHEAR)
    shear = torch.tensor([[0.0, 0.0, 0.999 * limit], [0.0, 0.0, 1.01 * limit]])
    _, after = cell.step(shear.double(), stress_free(cell, 2))
    assert (plastic_rows(cell, after)[2] > 0.0).tolist() == [False, True]


@pytest.mark.parametrize("steps", [1, 3, 500])
def test_simple_shear_follows_the_power_law(steps):
    # eps_xy = q/(4 G) + eps^p_xy, ||eps^p||_F = sqrt 2 eps^p_xy, q = A (||eps^p||_F + eps_0)^B.
    plastic = 0.2
    q = strength(math.sqrt(2.0) * plastic)
    total = q / (4.0 * SHEAR) + plastic
    cell = J2Hardening()
    path = torch.tensor([0.0, 0.0, total / steps], dtype=torch.float64).expand(steps, 1, 3)
    after = run(cell, path, stress_free(cell))[-1]
    # Rounding of the increments, of which there are up to five hundred.
    assert float(after[0, cell.layout["stress"]][2]) == pytest.approx(q / 2.0, rel=1e-11)
    assert float(plastic_rows(cell, after)[2]) == pytest.approx(plastic, rel=1e-11)


def test_biaxial_strength_in_the_plane_is_the_yield_stress_of_its_plastic_strain():
    cell = J2Hardening()
    states = compressed(cell, stress_free(cell), (0.0, 5e-3, 0.0), (0,), 60)
    for state in states[30:]:
        norm = plastic_rows(cell, state).square().sum().sqrt()  # no shear in these axes
        axial = float(state[0, 1])
        assert axial == pytest.approx(strength(float(norm)), rel=1e-10)


@torch.no_grad()
def test_the_consistency_equation_is_met():
    """q = q_trial - 2 G k x and the yield law hold at once, to 1e-12 of the trial stress."""
    cell = J2Hardening()
    state = isotropic(cell, 500)
    for increment in random_increments(cell, 500, 40, 2e-2):
        rows = cell.rows
        stress, after = cell.step(increment, state)
        flow = plastic_rows(cell, after) - plastic_rows(cell, state)
        deviator = rows.deviator(increment.T)
        expected = rows.deviator(state.T[:3]) + 2.0 * SHEAR * (deviator - flow)
        error = (rows.deviator(stress.T) - expected).abs().amax(dim=0)
        q_trial = rows.deviatoric_stress(rows.deviator(state.T[:3]) + 2.0 * SHEAR * deviator)
        assert (error <= 1e-12 * q_trial + 1e-9).all()
        state = after


@torch.no_grad()
def test_flow_is_along_the_deviator_and_keeps_the_volume():
    cell = J2Hardening()
    state = isotropic(cell, 50)
    for increment in random_increments(cell, 50, 30, 2e-2):
        stress, after = cell.step(increment, state)
        flow = plastic_rows(cell, after) - plastic_rows(cell, state)
        s = cell.rows.deviator(stress.T)
        cosine = cell.rows.contraction(flow, s)
        sizes = (cell.rows.contraction(flow, flow) * cell.rows.contraction(s, s)).sqrt()
        torch.testing.assert_close(cosine, sizes, rtol=1e-7, atol=1e-9)
        assert (cell.rows.trace(flow).abs() < 1e-15).all()
        state = after


@torch.no_grad()
def test_a_reversal_takes_the_hardening_back():
    """The yield stress follows the norm of the tensor: back at zero plastic strain it is 1e5."""
    cell = J2Hardening()
    shear = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64)
    state = run(cell, 0.01 * shear.expand(20, 1, 3), stress_free(cell))[-1]
    norms, yields = [], []
    for _ in range(400):
        _, state = cell.step(-1e-3 * shear, state)
        norms.append(float(plastic_rows(cell, state)[2]) * math.sqrt(2.0))
        yields.append(float(invariants(cell, state)[1]))
    falling = [k for k in range(1, 400) if norms[k] < norms[k - 1] - 1e-9 and norms[k] > 0.0]
    assert falling
    for k in falling:
        assert yields[k] == pytest.approx(strength(norms[k]), rel=1e-10)
    assert min(yields[k] for k in falling) < 1.02e5


@torch.no_grad()
@pytest.mark.parametrize("steps", [1, 7, 400])
def test_flow_through_zero_plastic_strain_is_followed(steps):
    """There the norm has a kink, at which plain Newton iterations go astray."""
    cell = J2Hardening()
    shear = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64)
    state = run(cell, 0.3 * shear[None], stress_free(cell))[-1]
    back = run(cell, (-0.8 / steps) * shear.expand(steps, 1, 3), state)[-1]
    # At the end eps_xy = -0.5: the same as loading to it from the stress-free state.
    direct = run(cell, -0.5 * shear[None], stress_free(cell))[-1]
    torch.testing.assert_close(back, direct, rtol=1e-9, atol=1e-9)


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6),
    st.floats(0.05, 2.0),
    st.floats(1e-4, 0.5),
)
@settings(max_examples=80, deadline=None)
def test_every_increment_has_a_root(entries, exponent, hardening_strain):
    cell = J2Hardening({"hardening_exponent": exponent, "hardening_strain": hardening_strain})
    increments = torch.tensor(entries, dtype=torch.float64).reshape(2, 1, 3)
    states = run(cell, increments, isotropic(cell, 1))
    assert torch.isfinite(states).all()
    c = cell.values()
    for state in states:
        plastic = plastic_rows(cell, state)
        norm = float(cell.rows.contraction(plastic, plastic).sqrt())
        allowed = c["hardening_modulus"] * (norm + c["hardening_strain"]) ** exponent
        assert float(invariants(cell, state)[1]) <= allowed * (1.0 + 1e-12) + 1e-9


def test_a_point_without_a_number_leaves_the_others_alone():
    cell = J2Hardening()
    increments = random_increments(cell, 6, 20, 2e-2)
    alone = run(cell, increments, isotropic(cell, 6))
    increments[5, 2] = torch.nan
    states = run(cell, increments, isotropic(cell, 6))
    assert torch.isnan(states[-1, 2, :3]).all()
    others = [0, 1, 3, 4, 5]
    # The others may be iterated once more, which moves the last bits.
    torch.testing.assert_close(states[:, others], alone[:, others], rtol=1e-12, atol=1e-9)
