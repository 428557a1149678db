"""Modified Cam-Clay as a limit of CSUH, against its closed forms."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from plastic_paths import PRESSURE, compressed, invariants, isotropic, random_increments, run
from torch import Tensor

from granbench.cells.contract import Conditions
from granbench.models.csuh import CSUH
from granbench.models.modified_cam_clay import ModifiedCamClay
from granbench.models.substepping import Substepping

SHARP = Substepping(tolerance=1e-6, most=100_000)
"""Closed forms are compared without what the default tolerance leaves, some 1e-5 of the stress."""

COMPRESSION = (1.0, -0.5, -0.5)
"""Undrained, of principal strains; extension is the opposite."""


def clay(**values: float) -> ModifiedCamClay:
    cell = ModifiedCamClay(values, order="principal")
    cell.substepping = SHARP
    return cell


def overconsolidated(cell: CSUH, ratio: float, pressure: float = PRESSURE) -> Tensor:
    stress = torch.full((1, 3), pressure, dtype=torch.float64)
    conditions = {"overconsolidation_ratio": torch.tensor([ratio], dtype=torch.float64)}
    with torch.no_grad():
        return cell.initial_state(Conditions(stress, conditions))


def straight(cell: CSUH, state: Tensor, strain: tuple[float, ...], steps: int) -> Tensor:
    """States (step, point, n_state) after equal parts of a strain."""
    part = torch.tensor(strain, dtype=torch.float64) / steps
    return run(cell, part.expand(steps, len(state), 3), state)


def void_ratio(cell: CSUH, state: Tensor) -> Tensor:
    return state[..., cell.layout["void_ratio"]].squeeze(-1)


def by_steps(cell: CSUH, states: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """p, q in Pa, and e of the states (step, point, n_state) of one point, (step,)."""
    states = states[:, 0]
    return *invariants(cell, states), void_ratio(cell, states)


class Limit(CSUH):
    """CSUH with M_f = M_c = M, the same in every direction."""

    lode_dependent = False
    state_dependent = False


@pytest.mark.parametrize("order", ["principal", "plane", "full"])
def test_it_is_csuh_without_spacing_inflection_or_state_to_the_last_bit(order):
    cell = ModifiedCamClay(order=order)
    limit = Limit({"critical_spacing": 0.0, "low_pressure_intercept": 1.9}, order=order)
    start = isotropic(cell, 20)
    # Normally consolidated, the first surface runs through the first stress in either model.
    begin = Conditions(
        (PRESSURE * cell.rows.normal[: cell.component_count, 0]).expand(20, -1),
        {"initial_void_ratio": void_ratio(cell, start)},
    )
    with torch.no_grad():
        assert float(limit.constants().p_s) == 0.0
        torch.testing.assert_close(limit.initial_state(begin), start, rtol=1e-15, atol=0.0)
    increments = random_increments(cell, 20, 20, 2e-3)
    assert torch.equal(run(limit, increments, start), run(cell, increments, start))


# Isotropic compression.


def test_normal_compression_follows_lambda():
    cell = clay()
    states = straight(cell, isotropic(cell, 1), (0.03, 0.03, 0.03), 6)
    p, _, e = by_steps(cell, states)
    expected = 1.9 - 0.135 * torch.log(p / 1e3)
    torch.testing.assert_close(e, expected, rtol=0.0, atol=1e-7)
    assert float(p[-1]) > 3.0 * PRESSURE


def test_unloading_and_reloading_follow_kappa_up_to_the_preconsolidation():
    cell = clay()
    loaded = straight(cell, isotropic(cell, 1), (0.02, 0.02, 0.02), 3)[-1]
    p_c, _, e_c = by_steps(cell, loaded[None])
    swollen = straight(cell, loaded, (-0.006, -0.006, -0.006), 5)
    p, _, e = by_steps(cell, swollen)
    # Elasticity is integrated exactly: no pieces, no tolerance.
    torch.testing.assert_close(e - e_c, -0.04 * torch.log(p / p_c), rtol=0.0, atol=1e-13)
    assert float(p[-1]) < 0.5 * float(p_c)
    # Reloaded in one step that ends beyond p_c: as if it had never been unloaded.
    again = straight(cell, swollen[-1], (0.016, 0.016, 0.016), 1)[-1]
    p, _, e = by_steps(cell, again[None])
    assert float(p) > 1.1 * float(p_c)
    assert float(e) == pytest.approx(1.9 - 0.135 * math.log(float(p) / 1e3), abs=1e-7)


@given(ratio=st.floats(1.0, 50.0), pressure=st.floats(1e3, 1e7))
@settings(deadline=None, max_examples=30)
def test_a_start_lies_on_the_swelling_line_of_its_preconsolidation(ratio, pressure):
    cell = clay()
    state = overconsolidated(cell, ratio, pressure)
    expected = 1.9 - 0.135 * math.log(ratio * pressure / 1e3) + 0.04 * math.log(ratio)
    assert float(void_ratio(cell, state)) == pytest.approx(expected, abs=1e-13)
    size = state[0, cell.layout["initial_yield_pressure"]]
    assert float(size) == pytest.approx(ratio * pressure, rel=1e-12)


# Undrained shear.


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_undrained_from_normal_consolidation_follows_the_closed_form(sign):
    """p/p_0 = (M^2/(M^2 + eta^2))^(1 - kappa/lambda), both in compression and in extension."""
    cell = clay()
    states = straight(cell, isotropic(cell, 1), tuple(sign * 0.1 * c for c in COMPRESSION), 60)
    p, q, e = by_steps(cell, states)
    expected = (1.25**2 / (1.25**2 + (q / p) ** 2)) ** (1.0 - 0.04 / 0.135) * PRESSURE
    torch.testing.assert_close(p, expected, rtol=1e-5, atol=0.0)
    assert float((e - e[0]).abs().max()) < 1e-14
    assert float(q[-1] / p[-1]) > 0.99 * 1.25


@pytest.mark.parametrize("values", [{}, {"critical_ratio": 0.8, "swelling_slope": 0.01}])
def test_undrained_strength_from_normal_consolidation(values):
    """p_cs = p_0 2^-(1 - kappa/lambda), q_cs = M p_cs."""
    cell = clay(**values)
    state = straight(cell, isotropic(cell, 1), COMPRESSION, 4)[-1]
    p, q = (float(value) for value in invariants(cell, state))
    M, kappa = values.get("critical_ratio", 1.25), values.get("swelling_slope", 0.04)
    assert p == pytest.approx(2.0 ** -(1.0 - kappa / 0.135) * PRESSURE, rel=1e-5)
    assert q == pytest.approx(M * p, rel=1e-5)


@pytest.mark.parametrize("ratio", [1.5, 2.0, 4.0, 16.0])
def test_undrained_strength_of_overconsolidated_clay(ratio):
    """Vertical up to the ellipse, then along it: q_u = M p_0 (OCR/2)^(1 - kappa/lambda)."""
    cell = clay()
    state = overconsolidated(cell, ratio)
    path = straight(cell, state, tuple(c / 1e3 for c in COMPRESSION), 60)
    p, q, _ = by_steps(cell, path)
    first = 1.25 * PRESSURE * math.sqrt(ratio - 1.0)
    elastic = q < 0.999 * first
    assert elastic.any()
    torch.testing.assert_close(
        p[elastic], torch.full_like(p[elastic], PRESSURE), rtol=1e-13, atol=0.0
    )
    end = straight(cell, path[-1], COMPRESSION, 20)[-1]
    strength = float(invariants(cell, end)[1])
    assert strength == pytest.approx(
        1.25 * PRESSURE * (ratio / 2.0) ** (1.0 - 0.04 / 0.135), rel=1e-5
    )


def test_dry_clay_peaks_on_its_first_ellipse():
    """Where the vertical path meets an ellipse above M, plastic strain softens from there on."""
    cell = clay()
    path = straight(cell, overconsolidated(cell, 16.0), tuple(0.1 * c for c in COMPRESSION), 200)
    p, q, _ = by_steps(cell, path)
    assert float((q / p).max()) > 1.25
    peak = 1.25 * PRESSURE * math.sqrt(15.0)
    assert float(q[0]) < peak
    # Steps of 5e-4 may pass over the corner, but the path never leaves the ellipse.
    assert float((q / p).max()) <= peak / PRESSURE * (1.0 + 1e-9)


# Drained shear.


def test_drained_from_normal_consolidation_is_critical_where_q_is_m_p():
    """p = p_0/(1 - M/3), q = M p; e on the critical state line (lambda - kappa) ln 2 below."""
    cell = clay()
    cell.substepping = Substepping(tolerance=1e-4)
    path = compressed(cell, isotropic(cell, 1), (0.06, 0.0, 0.0), (1, 2), 12, within=1e-5)
    p, q, e = by_steps(cell, path)
    # What is left decays with the strain.
    assert float(p[-1]) == pytest.approx(PRESSURE / (1.0 - 1.25 / 3.0), rel=2e-4)
    assert float(q[-1]) == pytest.approx(1.25 * float(p[-1]), rel=2e-4)
    critical = 1.9 - 0.135 * math.log(float(p[-1]) / 1e3) - 0.095 * math.log(2.0)
    assert float(e[-1]) == pytest.approx(critical, abs=2e-5)
    # On the way too e is that of the preconsolidation, within the sum of the pieces' errors.
    p_c = p * (1.0 + (q / p / 1.25) ** 2)
    on_swelling_line = 1.9 - 0.135 * torch.log(p_c / 1e3) + 0.04 * torch.log(p_c / p)
    torch.testing.assert_close(e, on_swelling_line, rtol=0.0, atol=1e-5)


def test_flow_is_normal_to_the_ellipse():
    """d eps_v^p/d eps_d^p = (M^2 - eta^2)/(2 eta), from increments of total less elastic strain."""
    cell = clay()
    states = straight(cell, isotropic(cell, 1), (0.02, 0.004, 0.0), 40)[:, 0]
    (p, q), part = invariants(cell, states), torch.tensor([0.02, 0.004, 0.0]).double() / 40
    e_0 = float(states[0, cell.layout["reference_void_ratio"]])
    s = cell.rows.split(states.T[:3])[1]
    elastic_volume = 0.04 / (1.0 + e_0) * torch.log(p[1:] / p[:-1])
    # G = 1.2/2.4 K ... with nu = 0.2: 3 (1 - 2 nu)/(2 (1 + nu)) = 0.75; K at the middle.
    shear = 0.75 * (1.0 + e_0) / 0.04 * (p[1:] * p[:-1]).sqrt()
    plastic_shear = cell.rows.deviator(part[:, None]) - (s[:, 1:] - s[:, :-1]) / (2.0 * shear)
    volume = part.sum() - elastic_volume
    middle = 0.5 * (s[:, 1:] + s[:, :-1])
    along = cell.rows.contraction(plastic_shear, middle) / cell.rows.deviatoric_stress(middle)
    eta = 0.5 * (q[1:] / p[1:] + q[:-1] / p[:-1])
    expected = (1.25**2 - eta**2) / (2.0 * eta)
    # Middles of steps stand for the steps: second order in 1/40, more at the steep beginning.
    torch.testing.assert_close((volume / along)[10:], expected[10:], rtol=5e-3, atol=0.0)
