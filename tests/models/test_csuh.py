"""CSUH: critical state, limits, consistency and the laws that any path obeys."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from plastic_paths import (
    PRESSURE,
    all_rows,
    invariants,
    isotropic,
    random_increments,
    rotated,
    rotation,
    run,
    stress_of,
)
from textbook_csuh import Textbook, critical_ratio, surface_factor
from torch import Tensor

from granbench.cells.contract import Conditions
from granbench.errors import ModelError
from granbench.models.csuh import CSUH
from granbench.models.csuh.formulas import reference_void_ratio
from granbench.models.csuh.yielding import FLOOR
from granbench.models.substepping import Substepping

SETS = tuple(CSUH.parameter_sets)
CASES = [*((name, "principal") for name in SETS), ("toyoura", "plane"), ("toyoura", "full")]
"""Every material, and every order with the one whose formulas all have a part."""
SHARP = Substepping(tolerance=1e-6, most=100_000)
"""Where formulas are checked, and not the control of the errors."""

INCREMENT = dict.fromkeys(SETS, 4e-3) | {"toyoura": 5e-4}
"""Strain increments that yield, turn and unload, but keep p above the floor."""

COMPRESSION, EXTENSION, SHEAR = (1.0, -0.5, -0.5), (-1.0, 0.5, 0.5), (1.0, 0.0, -1.0)

seeds = st.integers(0, 2**31 - 1)


def csuh(name: str = "toyoura", order: str = "principal", **values: float) -> CSUH:
    return CSUH(values, parameter_set=name, order=order)


def dense(cell: CSUH, void_ratios: list[float], pressures: list[float]) -> Tensor:
    """State at isotropic stresses with given void ratios."""
    stress = torch.tensor(pressures, dtype=torch.float64)[:, None].expand(-1, 3)
    e_0 = torch.tensor(void_ratios, dtype=torch.float64)
    with torch.no_grad():
        return cell.initial_state(Conditions(stress, {"initial_void_ratio": e_0}))


def internal(cell: CSUH, states: Tensor, name: str) -> Tensor:
    return states[..., cell.layout[name]].squeeze(-1)


def shearing(cell: CSUH, points: int, steps: int, size: float, seed: int = 0) -> Tensor:
    """Random paths, mostly of shear, which turn and unload: (step, point, component)."""
    increments = random_increments(cell, points, steps, size, seed)
    volumetric = (increments * cell.rows.normal[: cell.component_count, 0]).sum(dim=-1)
    return increments - 0.25 * volumetric[..., None] * cell.rows.normal[: cell.component_count, 0]


@torch.no_grad()
def critical_distance(cell: CSUH, states: Tensor) -> Tensor:
    """E - e_cs(p), (point,)."""
    c, p = cell.constants(), invariants(cell, states)[0]
    surface = 2.0 * p / (1.0 - c.critical_spacing)  # A p at eta = M
    line = reference_void_ratio(p, surface + c.p_s, c.intercept, c.swelling_slope, c.plastic, c.p_s)
    return internal(cell, states, "void_ratio") - line


# Starts.


def test_the_overconsolidation_ratio_of_toyoura_is_that_of_its_void_ratio():
    """The source gives e_0 = 0.833 at 100 kPa; the set, the OCR that implies it."""
    state = isotropic(csuh(), 1)
    # Four digits of the OCR are half a unit of 0.01, times 0.095 p_0/(OCR p_0 + p_s).
    assert float(internal(csuh(), state, "void_ratio")) == pytest.approx(0.833, abs=8e-6)


@pytest.mark.parametrize("name", SETS)
def test_the_initial_density_is_given_by_void_ratio_or_overconsolidation_ratio(name):
    cell = csuh(name)
    stress = torch.tensor([[1e5, 1e5, 1e5], [2e5, 1.8e5, 1.7e5]], dtype=torch.float64)
    ratio = torch.tensor([3.0, 20.0], dtype=torch.float64)
    with torch.no_grad():
        by_ratio = cell.initial_state(Conditions(stress, {"overconsolidation_ratio": ratio}))
        e_0 = internal(cell, by_ratio, "void_ratio")
        by_void_ratio = cell.initial_state(Conditions(stress, {"initial_void_ratio": e_0}))
    assert torch.equal(by_ratio, by_void_ratio)
    # SPEC 4 at an isotropic stress, where A = 1, in kPa.
    values, p_s = cell.reference, float(cell.constants().p_s.detach()) / 1e3
    e_eta = values["low_pressure_intercept"] - values["compression_slope"] * math.log(
        (100.0 + p_s) / (1.0 + p_s)
    )
    plastic = values["compression_slope"] - values["swelling_slope"]
    expected = e_eta - plastic * math.log((300.0 + p_s) / (100.0 + p_s))
    assert float(e_0[0]) == pytest.approx(expected, abs=1e-12)


def test_what_no_material_can_be_is_refused():
    with pytest.raises(ModelError, match=r"swelling_slope \(kappa\) is 0.2 but must lie below"):
        csuh(swelling_slope=0.2)
    with pytest.raises(ModelError, match=r"swelling_slope \(kappa\) is 0.135 but must lie below"):
        csuh(swelling_slope=0.135)
    with pytest.raises(ModelError, match=r"point 1 .* void ratio of 0.9300, .* has 0.9280"):
        dense(csuh(), [0.8, 0.93], [PRESSURE, PRESSURE])
    with pytest.raises(ModelError, match=r"point 0 .* void ratio of nan"):
        dense(csuh(), [math.nan], [PRESSURE])
    with pytest.raises(ModelError, match="point 0 starts at a mean stress of -1 Pa"):
        dense(csuh(), [0.8], [-1.0])
    steep = torch.tensor([[5e5, 1e3, 1e3]], dtype=torch.float64)
    with pytest.raises(ModelError, match=r"starts at q/p = 2.98, which no yield surface"):
        csuh().initial_state(Conditions(steep))
    loose = {"overconsolidation_ratio": torch.tensor([0.5], dtype=torch.float64)}
    with pytest.raises(ModelError, match=r"overconsolidation ratio of point 0 is 0.5; give"):
        csuh().initial_state(Conditions(torch.full((1, 3), PRESSURE).double(), loose))


# Against the textbook.


@pytest.mark.parametrize("name", SETS)
def test_paths_are_those_of_the_textbook(name):
    """Published formulas, complex-step gradients and a hundred Runge-Kutta steps an increment.

    Stress, void ratio and H along random paths that yield, unload and turn in principal axes.
    """
    cell, points = csuh(name), 8
    cell.substepping = SHARP
    increments = shearing(cell, points, 5, INCREMENT[name], seed=3)
    start = isotropic(cell, points)
    states = run(cell, increments, start)
    e_0, values = internal(cell, start, "void_ratio").numpy(), cell.reference
    textbook = Textbook(
        M=values["critical_ratio"],
        slope=values["compression_slope"],
        swelling=values["swelling_slope"],
        nu=values["poisson_ratio"],
        intercept=values["compression_intercept"],
        low=values["low_pressure_intercept"],
        chi=values["critical_spacing"],
        m=values["dilatancy"],
        e0=e_0,
        size=np.full(points, PRESSURE / 1e3),
    )
    expected = np.array([*(start[:, :3].T.numpy() / 1e3), np.zeros(points), e_0])
    for state, increment in zip(states, increments, strict=True):
        expected = textbook.advanced(expected, increment.T.numpy(), 100)
        size = np.abs(expected[:3]).max(axis=0) + 1.0
        # Some ten pieces of 1e-6 an increment.
        error = np.abs(stress_of(cell, state).T.numpy() / 1e3 - expected[:3]) / size
        assert error.max() < 2e-5
        hardening = np.abs(internal(cell, state, "hardening").numpy() - expected[3])
        assert (hardening / textbook.c_p).max() < 2e-5
        np.testing.assert_allclose(internal(cell, state, "void_ratio"), expected[4], atol=1e-13)
    hardened = internal(cell, states, "hardening")
    assert ((hardened[1:] == hardened[:-1]).any()) and ((hardened[1:] != hardened[:-1]).any())


# Critical state.


@pytest.mark.parametrize(
    ("direction", "ratio"), [(COMPRESSION, 1.25), (EXTENSION, 0.75 * 1.25), (SHEAR, 1.25 * 6 / 7)]
)
def test_undrained_shear_ends_at_the_critical_state_of_its_void_ratio(direction, ratio):
    """Toyoura at e = 0.833: p = 977 kPa from any pressure, q = M p = 1221 kPa in compression.

    In extension M is 3/4 of it, in pure shear 6/7 (Eq 7.35); the critical p is the same.
    """
    cell = csuh()
    start = dense(cell, [0.833, 0.833, 0.833, 0.735, 0.907], [1e5, 1e6, 2e6, 1e5, 1e5])
    path = 0.25 * torch.tensor(direction, dtype=torch.float64).expand(4, 5, 3)
    state = run(cell, path, start)[-1]
    p, q = invariants(cell, state)
    # What is left decays with the strain, and control of errors lets eta swing by 1e-4 about M.
    torch.testing.assert_close(p[:3] / 1e3, torch.full((3,), 977.0).double(), rtol=3e-4, atol=0.0)
    torch.testing.assert_close(q / p, torch.full_like(p, ratio), rtol=2e-4, atol=0.0)
    assert float(critical_distance(cell, state).abs().max()) < 2e-5
    if direction == COMPRESSION:
        assert float(q[0]) / 1e3 == pytest.approx(1221.0, rel=4e-4)


@torch.no_grad()
def held_at_the_side(cell: CSUH, state: Tensor, axial: float, steps: int) -> Tensor:
    """State after drained compression in the first axis, s22 = s33 within 1e-4 of the start.

    By secants, for derivatives of hundreds of pieces cost more.
    """
    held = state[:, 1].clone()

    def miss(lateral: Tensor) -> tuple[Tensor, Tensor]:
        strain = torch.stack([torch.full_like(held, axial / steps), lateral, lateral], dim=1)
        stress, after = cell.step(strain, state)
        return stress[:, 1] - held, after

    guess = torch.full_like(held, -0.4 * axial / steps)
    for _ in range(steps):
        one, other = guess, guess - 1e-6
        of_one, of_other = miss(one)[0], miss(other)[0]
        for _ in range(40):
            change = torch.where(of_one == of_other, 0.0, (one - other) / (of_one - of_other))
            step = (change * of_other).clamp(-3e-3, 3e-3)
            one, of_one, other = other, of_other, other - step
            of_other, after = miss(other)
            if (of_other.abs() < 1e-4 * held).all():
                break
        else:
            raise ArithmeticError(f"lateral stress off by {of_other.abs().max():g} Pa")
        state, guess = after, other
    return state


def test_drained_compression_ends_on_the_same_critical_line():
    """Dense sand dilates to it, loose sand contracts: p = p_0/(1 - M/3), q = M p, e = e_cs(p)."""
    cell = csuh()
    start = dense(cell, [0.735, 0.924], [PRESSURE] * 2)
    state = held_at_the_side(cell, start, axial=0.7, steps=10)
    p, q = invariants(cell, state)
    expected = PRESSURE / (1.0 - 1.25 / 3.0)
    torch.testing.assert_close(p, torch.full_like(p, expected), rtol=1e-3, atol=0.0)
    torch.testing.assert_close(q / p, torch.full_like(p, 1.25), rtol=1e-3, atol=0.0)
    assert float(critical_distance(cell, state).abs().max()) < 2e-4
    change = internal(cell, state, "void_ratio") - internal(cell, start, "void_ratio")
    assert (change > 0.0).tolist() == [True, False]


# Limits.


def test_the_loosest_state_compresses_along_its_line():
    """xi stays 0: e = Z - lambda ln((p + p_s)/(1 + p_s)), the curved line of sand and the straight
    one of clay."""
    for name in ("toyoura", "guan2023-tab7.3-original"):
        cell = csuh(name)
        cell.substepping = SHARP
        stress = torch.full((1, 3), PRESSURE, dtype=torch.float64)
        loosest = {"overconsolidation_ratio": torch.ones(1, dtype=torch.float64)}
        with torch.no_grad():
            start = cell.initial_state(Conditions(stress, loosest))
        states = run(cell, torch.full((5, 1, 3), 0.01, dtype=torch.float64), start)
        p, _ = invariants(cell, states[:, 0])
        c, kpa = cell.reference, p / 1e3
        p_s = float(cell.constants().p_s.detach()) / 1e3
        line = c["low_pressure_intercept"] - c["compression_slope"] * torch.log(
            (kpa + p_s) / (1.0 + p_s)
        )
        e = internal(cell, states[:, 0], "void_ratio")
        torch.testing.assert_close(e, line, rtol=0.0, atol=1e-6)
        assert float(p[-1]) > 3.0 * PRESSURE


def uh_clay(ratio: float, steps: int, strain: float) -> tuple[float, float]:
    """P and q, kPa, of UH clay after undrained compression, as Yao et al. (2009) have it.

    From 100 kPa and an overconsolidation ratio. The reference surface p(1 + eta^2/M^2) = p_ref
    hardens as that of modified Cam-Clay, R = p (1 + eta^2/M^2)/p_ref; no void ratio occurs.
    """
    M, slope, swelling, nu = 1.25, 0.135, 0.04, 0.2
    e_0 = 1.9 - slope * math.log(100.0) - (slope - swelling) * math.log(ratio)
    c_p = (slope - swelling) / (1.0 + e_0)

    def rate(state: np.ndarray) -> np.ndarray:
        p, q, reference = state
        eta, bulk = q / p, (1.0 + e_0) * p / swelling
        shear = 3.0 * (1.0 - 2.0 * nu) / (2.0 * (1.0 + nu)) * bulk
        over = M**2 / (12.0 * (3.0 - M)) / (p * (1.0 + eta**2 / M**2) / reference)
        failure = 6.0 * (math.sqrt(over * (1.0 + over)) - over)
        of_p = (M**2 - eta**2) / (p * (M**2 + eta**2))
        of_q = 2.0 * eta / (p * (M**2 + eta**2))
        # dH = (M_f^4 - eta^4)/(M^4 - eta^4) d eps_v^p with d eps_v^p = L of_p.
        hardening = (failure**4 - eta**4) / (p * (M**2 + eta**2) ** 2) / c_p
        trial = of_q * 3.0 * shear
        flow = trial / (of_p**2 * bulk + 3.0 * shear * of_q**2 + hardening)
        plastic = flow * of_p
        return np.array(
            [-bulk * plastic, 3.0 * shear * (1.0 - flow * of_q), reference * plastic / c_p]
        )

    state, part = np.array([100.0, 0.0, 100.0 * ratio]), strain / steps
    for _ in range(steps):
        first = rate(state) * part
        second = rate(state + 0.5 * first) * part
        third = rate(state + 0.5 * second) * part
        fourth = rate(state + third) * part
        state = state + (first + 2.0 * second + 2.0 * third + fourth) / 6.0
    return float(state[0]), float(state[1])


@pytest.mark.parametrize("ratio", [1.0, 4.0, 20.0])
def test_without_inflection_spacing_and_dilatancy_it_is_uh_clay(ratio):
    cell = csuh("guan2023-tab7.3-original", dilatancy=1e-12)
    cell.substepping = SHARP
    stress = torch.full((1, 3), PRESSURE, dtype=torch.float64)
    scalars = {"overconsolidation_ratio": torch.tensor([ratio], dtype=torch.float64)}
    with torch.no_grad():
        state = cell.initial_state(Conditions(stress, scalars))
    for strain in (0.01, 0.09):
        state = run(cell, strain * torch.tensor(COMPRESSION).double().expand(1, 1, 3), state)[-1]
    p, q = (float(value) / 1e3 for value in invariants(cell, state))
    assert (p, q) == pytest.approx(uh_clay(ratio, 2000, 0.1), rel=2e-5)


# Consistency.


@pytest.mark.parametrize(("name", "order"), CASES)
def test_after_every_step_the_stress_lies_on_its_yield_surface_or_inside(name, order):
    cell = csuh(name, order)
    points = 20
    start = isotropic(cell, points)
    states = run(cell, shearing(cell, points, 12, INCREMENT[name]), start)
    on_surface = 0
    with torch.no_grad():
        c = cell.constants()
        e_0 = internal(cell, start, "void_ratio")
        for before, state in zip(torch.cat([start[None], states]), states, strict=False):
            p, s = cell.rows.split(all_rows(cell, state))
            sin3 = 13.5 * determinant(cell, s) / cell.rows.deviatoric_stress(s) ** 3
            critical = critical_ratio(c.critical_ratio, sin3)
            eta = cell.rows.deviatoric_stress(s) / p
            through = surface_factor(eta, critical, c.critical_spacing) * p
            hardening = internal(cell, state, "hardening")
            f = torch.log((through + c.p_s) / (PRESSURE + c.p_s))
            f = f - hardening * (1.0 + e_0) / c.plastic
            yielded = hardening != internal(cell, before, "hardening")
            # H is read from f = 0; ln and the third invariant are good to some 1e-14.
            assert float(f.max()) < 1e-12
            on_surface += int((yielded & (f.abs() < 1e-12)).sum())
    assert on_surface > 0.3 * 12 * points


def determinant(cell: CSUH, s: Tensor) -> Tensor:
    """Determinants of symmetric tensors (component, point)."""
    if cell.order == "principal":
        return s.prod(dim=0)
    if cell.order == "plane":
        x, y, xy, z = s
        return z * (x * y - xy * xy)
    x, y, z, yz, xz, xy = s
    rows = torch.stack([x, xy, xz, xy, y, yz, xz, yz, z], dim=-1).reshape(-1, 3, 3)
    return torch.linalg.det(rows)


@pytest.mark.parametrize("name", SETS)
def test_the_void_ratio_counts_the_volume_and_nothing_else(name):
    cell = csuh(name)
    start = isotropic(cell, 10)
    increments = shearing(cell, 10, 5, INCREMENT[name])
    states = run(cell, increments, start)
    e_0, volume = internal(cell, start, "void_ratio"), increments.sum(dim=-1).cumsum(dim=0)
    expected = e_0 - (1.0 + e_0) * volume
    torch.testing.assert_close(internal(cell, states, "void_ratio"), expected, rtol=0.0, atol=1e-14)
    assert torch.equal(internal(cell, states, "reference_void_ratio"), e_0.expand(5, -1))
    first = internal(cell, start, "initial_yield_pressure")
    assert torch.equal(internal(cell, states, "initial_yield_pressure"), first.expand(5, -1))


@pytest.mark.parametrize("name", SETS)
def test_plastic_work_is_never_negative(name):
    """sigma:(d eps - C^-1 d sigma) in small steps, with sigma and C at their middle."""
    cell = csuh(name)
    state = isotropic(cell, 20)
    coarse = shearing(cell, 20, 8, INCREMENT[name], seed=5)
    c, e_0 = cell.constants(), internal(cell, state, "reference_void_ratio")
    worst, largest = 0.0, 0.0
    with torch.no_grad():
        for increment in (coarse / 5.0).repeat_interleave(5, dim=0):
            _, after = cell.step(increment, state)
            rows, change = (
                0.5 * (all_rows(cell, after) + all_rows(cell, state)),
                all_rows(cell, after) - all_rows(cell, state),
            )
            bulk = (1.0 + e_0) * (cell.rows.mean(rows) + c.p_s) / c.swelling_slope
            mean, deviator = cell.rows.split(change)
            elastic = cell.rows.normal * mean / (3.0 * bulk) + deviator / (c.shear * bulk)
            work = cell.rows.contraction(rows, increment.T - elastic)
            relative = work / (rows.abs().amax(dim=0) * increment.abs().amax(dim=1))
            worst = min(worst, float(relative.min()))
            largest = max(largest, float(relative.max()))
            state = after
    # Middles leave what shrinks with the square of the steps: 9e-5 here, 6e-6 in steps of 1/20.
    assert worst > -1.5e-4
    assert largest > 0.05


# Invariance.


@pytest.mark.parametrize(("name", "order"), CASES)
def test_zero_increment_returns_the_same_state_to_the_last_bit(name, order):
    cell = csuh(name, order)
    start = isotropic(cell, 10)
    increments = shearing(cell, 10, 8, INCREMENT[name])
    # The last pull goes down to the floor, or a long way towards it.
    pull = -0.05 * cell.rows.normal[: cell.component_count, 0].expand(1, 10, -1)
    states = torch.cat([start[None], run(cell, torch.cat([increments, pull]), start)])
    zero = torch.zeros_like(increments[0])
    for state in states:
        stress, after = cell.step(zero, state)
        assert torch.equal(after, state)
        assert torch.equal(stress, stress_of(cell, state))


@pytest.mark.parametrize(
    ("name", "order"),
    [("guan2023-tab5.1", "plane"), ("toyoura", "plane"), ("toyoura", "full")],
)
@given(seed=seeds)
@settings(max_examples=2, deadline=None)
def test_stress_is_objective_under_rotation(name, order, seed):
    cell = csuh(name, order)
    turn = rotation(seed, plane=order == "plane")
    increments = shearing(cell, 4, 5, INCREMENT[name], seed % 1000)
    start = isotropic(cell, 4)
    straight = stress_of(cell, run(cell, increments, start))
    turned = stress_of(cell, run(cell, rotated(increments, order, turn), start))
    # Rounding, 1e-14; paths that have been at the floor of 10 Pa multiply it, to 2e-8.
    torch.testing.assert_close(turned, rotated(straight, order, turn), rtol=1e-6, atol=1e-2)


@pytest.mark.parametrize(("name", "order"), CASES)
def test_swapping_the_axes_swaps_the_stress(name, order):
    cell = csuh(name, order)
    swap = {"principal": [1, 0, 2], "plane": [1, 0, 2], "full": [1, 0, 2, 4, 3, 5]}[order]
    increments, start = shearing(cell, 10, 8, INCREMENT[name]), isotropic(cell, 10)
    stress = stress_of(cell, run(cell, increments, start))
    swapped = stress_of(cell, run(cell, increments[..., swap], start))
    torch.testing.assert_close(swapped, stress[..., swap], rtol=1e-8, atol=1e-3)


def test_a_plane_strain_view_is_the_space_with_nothing_out_of_plane():
    plane, space = csuh(order="plane"), csuh(order="full")
    increments = shearing(plane, 10, 8, 1e-3)
    zero = torch.zeros_like(increments[..., 0])
    x, y, xy = increments.unbind(dim=-1)
    whole = torch.stack([x, y, zero, zero, zero, xy], dim=-1)
    here, there = (
        run(plane, increments, isotropic(plane, 10)),
        run(space, whole, isotropic(space, 10)),
    )
    torch.testing.assert_close(here[..., :4], there[..., [0, 1, 5, 2]], rtol=1e-10, atol=1e-5)


# Tension.


def lowest_pressure(cell: CSUH, states: Tensor) -> float:
    return min(float(invariants(cell, state)[0].min()) for state in states)


AT_LEAST = FLOOR * (1.0 - 1e-5)
"""Pa; a piece may end a rounding of its stages below the floor."""


@pytest.mark.parametrize("name", SETS)
@given(seed=seeds)
@settings(max_examples=3, deadline=None)
def test_no_path_leads_below_the_smallest_pressure_or_to_nan(name, seed):
    """Random increments of up to 1 %, which pull most points apart and press some together."""
    cell = csuh(name)
    generator = torch.Generator().manual_seed(seed)
    random = torch.rand(4, 6, 3, generator=generator, dtype=torch.float64)
    states = run(cell, 0.02 * random - 0.0105, isotropic(cell, 6))
    assert torch.isfinite(states).all()
    assert lowest_pressure(cell, states) >= AT_LEAST


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("direction", [(-1.0, -1.0, -1.0), (-1.0, -0.2, -0.2), (0.5, -1.0, -1.0)])
def test_extension_ends_at_the_floor_and_compression_leads_away_from_it(name, direction):
    cell = csuh(name)
    pull = torch.tensor(direction, dtype=torch.float64).expand(1, 1, 3)
    start = isotropic(cell, 1)
    apart = run(cell, 0.4 * pull, start)
    p, q = invariants(cell, apart[-1])
    assert float(p) >= AT_LEAST
    if cell.reference["low_pressure_intercept"] < cell.reference["compression_intercept"]:
        # With p_s a finite strain takes p there; without, it decays exponentially.
        assert float(p) == pytest.approx(FLOOR, rel=1e-5)
        assert float(q) < 1e-6
    again = run(cell, -0.4 * pull, apart[-1])
    assert torch.isfinite(again).all()
    # Back at the first void ratio, or a denser one than any that it can have at the floor.
    assert float(invariants(cell, again[-1])[0]) >= AT_LEAST
    e_0 = internal(cell, start, "void_ratio")
    assert float(internal(cell, again[-1], "void_ratio")) == pytest.approx(float(e_0), abs=1e-14)


def test_a_jump_that_cannot_be_followed_affects_only_its_point():
    """A dilating jump of 9 %, most of it in sand at 45 Pa whose stiffness is that of p_s = 2.2 MPa.

    That allows pieces of 2e-6 of strain: 2000 attempts come a fifth of the way.
    """
    cell = csuh()
    cell.substepping = Substepping(most=300)
    jump = torch.tensor([[-0.0413, 0.0576, -0.0672], [1e-3, 0.0, 0.0]], dtype=torch.float64)
    state = run(cell, jump[None], isotropic(cell, 2))[-1]
    assert torch.isnan(state[0]).all()
    assert torch.equal(state[1:], run(cell, jump[None, 1:], isotropic(cell, 1))[-1])
