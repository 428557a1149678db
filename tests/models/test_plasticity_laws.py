"""Laws that every plastic model obeys, whatever its equations."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from plastic_paths import (
    all_rows,
    invariants,
    isotropic,
    plastic_rows,
    random_increments,
    rotated,
    rotation,
    run,
    stress_of,
)
from torch import Tensor

from granbench.cells.contract import MaterialCell
from granbench.models import ClassicalCell, find_model

PLASTIC = ("j2", "drucker-prager", "j2-hardening", "ime", "enhanced-ime")
ORDERS = ("principal", "plane", "full")
CASES = [(name, order) for name in PLASTIC for order in ORDERS]
INCREMENT = {"ime": 2e-3, "enhanced-ime": 5e-3}
"""Strain increment that takes a model well beyond yield in a few steps; 2e-2 for the soft ones."""

seeds = st.integers(0, 2**31 - 1)


def increment_of(name: str) -> float:
    return INCREMENT.get(name, 2e-2)


@torch.no_grad()
def limit(cell: ClassicalCell, state: Tensor) -> Tensor:
    """Largest q that the model allows at a state, (point,), written down anew for the test."""
    c, (p, _) = cell.constants(), invariants(cell, state)
    if cell.name == "j2":
        return c.yield_stress.expand_as(p)
    if cell.name == "drucker-prager":
        return c.friction_slope * p
    plastic = plastic_rows(cell, state)
    norm = cell.rows.contraction(plastic, plastic).sqrt()
    if cell.name == "j2-hardening":
        return c.hardening_modulus * (norm + c.hardening_strain) ** c.hardening_exponent
    if cell.name == "ime":
        power = (norm + c.hardening_strain) ** c.hardening_exponent
        return c.yield_stress + c.hardening_modulus * power
    compaction, shear = cell.rows.trace(plastic), cell.rows.deviator(plastic)
    eps_s = (cell.rows.contraction(shear, shear) / 1.5).sqrt()
    sheared = (eps_s + c.shear_hardening_strain) ** c.shear_hardening_exponent
    compacted = compaction.clamp(min=0.0) + c.volumetric_hardening_strain
    return (
        c.yield_stress
        + c.shear_hardening_modulus * sheared
        + c.volumetric_hardening_modulus * compacted**c.volumetric_hardening_exponent
        - c.pressure_slope * p
    )


@pytest.fixture(params=CASES, ids=lambda case: "-".join(case))
def cell(request) -> ClassicalCell:
    name, order = request.param
    return find_model(name)(order=order)


@pytest.fixture
def states(cell) -> Tensor:
    """Every state along random paths from an isotropic stress."""
    increments = random_increments(cell, 40, 60, increment_of(cell.name))
    start = isotropic(cell, 40)
    return torch.cat([start[None], run(cell, increments, start)])


def test_a_step_beyond_yield_ends_on_the_surface(cell, states):
    # Rounding of the rows, some 1e-16 p, and of the power in the hardening law.
    for state in states:
        p, q = invariants(cell, state)
        allowed = limit(cell, state)
        assert (q <= allowed + 1e-12 * (allowed.abs() + p.abs() + 1.0)).all()
    yielding = torch.stack([invariants(cell, state)[1] for state in states])
    allowed = torch.stack([limit(cell, state) for state in states])
    assert ((yielding - allowed).abs() < 1e-9 * allowed.abs() + 1e-6).double().mean() > 0.3


def test_zero_increment_returns_the_same_state_to_the_last_bit(cell, states):
    for state in states:
        stress, after = cell.step(torch.zeros(len(state), cell.component_count), state)
        assert torch.equal(after, state)
        assert torch.equal(stress, stress_of(cell, state))


@torch.no_grad()
def test_zero_increment_changes_nothing_far_up_the_pressure_axis(cell):
    # p/q of a hundred: the rounding of p is a hundred times that of q.
    state = isotropic(cell, 200, 3e7)
    increments = random_increments(cell, 200, 5, 20.0 * increment_of(cell.name))
    for increment in increments - increments.mean(dim=-1, keepdim=True):
        _, state = cell.step(increment, state)
        assert torch.equal(cell.step(torch.zeros_like(increment), state)[1], state)


@torch.no_grad()
def test_plastic_work_is_never_negative(cell):
    # What is not stored elastically: sigma:(d_eps - C^-1 d_sigma), sigma at the step's end.
    state = isotropic(cell, 40)
    rows = cell.rows
    for increment in random_increments(cell, 40, 60, increment_of(cell.name)):
        _, after = cell.step(increment, state)
        if "plastic_strain_xx" in cell.layout or "plastic_strain_11" in cell.layout:
            plastic = plastic_rows(cell, after) - plastic_rows(cell, state)
        else:
            c = cell.constants()
            change, deviator = rows.split(all_rows(cell, after) - all_rows(cell, state))
            elastic = rows.normal * change / (rows.dimension * c.bulk_modulus)
            elastic = elastic + deviator / (2.0 * c.shear_modulus)
            plastic = increment.T - elastic
        work = rows.contraction(all_rows(cell, after), plastic)
        size = all_rows(cell, after).abs().amax(dim=0) * increment.abs().amax()
        assert (work >= -1e-11 * size).all()
        state = after


@pytest.mark.parametrize("name", PLASTIC)
@pytest.mark.parametrize("order", ["plane", "full"])
@given(seed=seeds)
@settings(max_examples=10, deadline=None)
def test_stress_is_objective_under_rotation(name, order, seed):
    cell = find_model(name)(order=order)
    turn = rotation(seed, plane=order == "plane")
    increments = random_increments(cell, 3, 12, 2.0 * increment_of(name), seed)
    straight = stress_of(cell, run(cell, increments, isotropic(cell, 3)))
    turned = stress_of(cell, run(cell, rotated(increments, order, turn), isotropic(cell, 3)))
    # Rounding of a rotation, carried along twelve steps.
    expected = rotated(straight, order, turn)
    torch.testing.assert_close(turned, expected, rtol=1e-9, atol=1e-6 * 1e5)


def test_swapping_the_axes_swaps_the_stress(cell):
    swap = {"principal": [1, 0, 2], "plane": [1, 0, 2], "full": [1, 0, 2, 4, 3, 5]}[cell.order]
    increments = random_increments(cell, 10, 30, increment_of(cell.name))
    stress = stress_of(cell, run(cell, increments, isotropic(cell, 10)))
    swapped = stress_of(cell, run(cell, increments[..., swap], isotropic(cell, 10)))
    # Only the order in which three numbers are added differs.
    torch.testing.assert_close(swapped, stress[..., swap], rtol=1e-10, atol=1e-5)


def end_of_straight_path(cell: ClassicalCell, steps: int) -> Tensor:
    """Stress after a strain that grows in one direction, from an isotropic stress."""
    total = random_increments(cell, 20, 1, 20.0 * increment_of(cell.name))
    total = total[0] - 0.9 * total[0].mean(dim=-1, keepdim=True)
    path = (total / steps).expand(steps, -1, -1)
    return stress_of(cell, run(cell, path, isotropic(cell, 20, 5e5))[-1])


@pytest.mark.parametrize(
    "cell",
    # The stiffness of enhanced IME changes along the path: see test_enhanced_ime.py.
    [case for case in CASES if case[0] != "enhanced-ime"],
    indirect=True,
    ids="-".join,
)
def test_a_straight_path_is_one_step_or_a_hundred(cell):
    whole = end_of_straight_path(cell, 1)
    # The direction of flow never changes, so the implicit return is exact in any number of steps.
    for steps in (10, 100):
        torch.testing.assert_close(end_of_straight_path(cell, steps), whole, rtol=1e-8, atol=1e-3)


def test_a_curved_path_converges_with_the_first_order_of_the_return(cell):
    # Smaller steps than elsewhere, for the error to be proportional to them.
    increments = random_increments(cell, 10, 40, 0.3 * increment_of(cell.name))

    def stress_in(pieces: int) -> Tensor:
        finer = (increments / pieces).repeat_interleave(pieces, dim=0)
        return stress_of(cell, run(cell, finer, isotropic(cell, 10)))[8 * pieces - 1 :: 8 * pieces]

    best = stress_in(16)
    coarse, fine = (float((stress_in(pieces) - best).norm()) for pieces in (1, 4))
    # With errors h: (1/4 - 1/16)/(1 - 1/16) = 0.2.
    assert fine == pytest.approx(0.2 * coarse, rel=0.25)


@torch.no_grad()
def finite_differences(cell: ClassicalCell, increment: Tensor, state: Tensor) -> Tensor:
    columns = []
    for j in range(cell.component_count):
        shift = torch.zeros_like(increment)
        shift[:, j] = 1e-7
        right, left = (cell.step(increment + sign * shift, state)[0] for sign in (1.0, -1.0))
        columns.append((right - left) / 2e-7)
    return torch.stack(columns, dim=-1)


def test_tangent_is_the_derivative_of_the_step(cell):
    increments = random_increments(cell, 30, 25, increment_of(cell.name))
    state = run(cell, increments[:-1], isotropic(cell, 30))[-1]
    stress, after, tangent = cell.tangent(increments[-1], state)
    by_step = cell.step(increments[-1], state)
    assert torch.equal(stress, by_step[0])
    assert torch.equal(after, by_step[1])
    scale = tangent.abs().max()
    by_ad = MaterialCell.tangent(cell, increments[-1], state)[2]
    torch.testing.assert_close(tangent, by_ad, rtol=0.0, atol=1e-11 * scale)
    # Central differences over 2e-7 of strain: curvature and rounding leave some 1e-6.
    difference = finite_differences(cell, increments[-1], state)
    torch.testing.assert_close(tangent, difference, rtol=0.0, atol=1e-5 * scale)


def test_gradients_are_those_of_finite_differences(cell):
    """With respect to strain, state and every parameter, on points inside and on the surface."""
    if cell.name == "enhanced-ime":  # away from eps_v^p = 0, where compaction begins to harden
        cell = cell.copy_with({"flow_slope": 0.05})
    increments = random_increments(cell, 3, 8, increment_of(cell.name))
    state = run(cell, increments[:-1], isotropic(cell, 3))[-1]
    free = [torch.zeros(3, dtype=torch.float64) for _ in cell.parameter_table]
    scale = torch.cat([torch.full((cell.rows.count,), 1e5), torch.ones(len(state.T))])
    scale = scale[: state.shape[1]].double()

    def scaled_step(strain: Tensor, scaled_state: Tensor, *free: Tensor) -> Tensor:
        names = [f"free.{parameter.name}" for parameter in cell.parameter_table]
        arguments = (strain, scaled_state * scale)
        after = torch.func.functional_call(cell, dict(zip(names, free, strict=True)), arguments)[1]
        return after / scale

    inputs = (increments[-1], state / scale, *free)
    inputs = tuple(tensor.detach().requires_grad_() for tensor in inputs)
    # In units of 1e5 Pa and of strain; moduli of 1e7 Pa make the largest entries some 100.
    assert torch.autograd.gradcheck(scaled_step, inputs, eps=1e-7, atol=2e-4, rtol=1e-4)
