"""Differences in place of an expensive tangent: the same stresses, nearly the same tangent."""

import pytest
import torch
from driven_cells import BULK, elastic, elastic_stiffness

from granbench.cells.contract import Conditions
from granbench.cells.difference_tangent import DifferenceTangent, with_cheap_tangent
from granbench.models import find_model
from granbench.models.csuh import CSUH

PRESSURES = torch.tensor([5e4, 1e5, 4e5], dtype=torch.float64)


def loaded(cell, order="principal"):
    """States of some points under deviatoric load, and a further increment that yields."""
    stress = torch.zeros(len(PRESSURES), cell.component_count, dtype=torch.float64)
    stress[:, :3] = PRESSURES[:, None]
    state = cell.initial_state(Conditions(stress))
    dstrain = torch.zeros_like(stress)
    dstrain[:, :3] = torch.tensor([2e-3, -0.5e-3, -0.7e-3], dtype=torch.float64)
    with torch.no_grad():
        for _ in range(4):
            _, state = cell.step(dstrain, state)
    return dstrain, state


class Counting(CSUH):
    """Counts its steps."""

    steps = 0

    def step(self, dstrain, state):
        self.steps += 1
        return super().step(dstrain, state)


def test_closed_forms_and_networks_keep_their_own_tangent():
    for cell in (find_model("j2")(), elastic()):
        assert with_cheap_tangent(cell) is cell
    assert isinstance(with_cheap_tangent(CSUH()), DifferenceTangent)


@pytest.mark.parametrize("order", ["principal", "full"])
def test_stresses_are_those_of_the_cell_but_for_rounding(order):
    """A larger batch may be rounded differently in its last bits."""
    cell = CSUH(order=order)
    dstrain, state = loaded(cell)
    with torch.no_grad():
        stress, after = cell.step(dstrain, state)
    own_stress, own_after = DifferenceTangent(cell).step(dstrain, state)
    torch.testing.assert_close(own_stress, stress, rtol=1e-10, atol=1e-6)
    torch.testing.assert_close(own_after, after, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("order", ["principal", "full"])
def test_the_tangent_is_that_of_automatic_differentiation(order):
    cell = CSUH(order=order)
    dstrain, state = loaded(cell)
    *_, exact = cell.tangent(dstrain, state)
    *_, found = DifferenceTangent(cell).tangent(dstrain, state)
    # A share of 1e-3 of a curved path, and an integration that is good to 3e-4.
    scale = exact.abs().amax(dim=(1, 2), keepdim=True)
    assert ((found - exact) / scale).abs().max() < 2e-3


def test_the_tangent_of_elasticity_is_exact():
    cell = DifferenceTangent(elastic())
    state = torch.full((2, 3), 1e5, dtype=torch.float64)
    *_, tangent = cell.tangent(torch.zeros_like(state), state)
    stiffness = elastic_stiffness("principal").expand(2, 3, 3)
    # Differences of 1e5 Pa over a strain of 1e-8 lose eight of sixteen digits.
    torch.testing.assert_close(tangent, stiffness, rtol=0.0, atol=1e-5 * BULK)


def test_a_step_and_its_tangent_call_the_cell_once():
    counting = Counting(order="principal")
    dstrain, state = loaded(CSUH(order="principal"))
    cell = DifferenceTangent(counting)
    cell.step(dstrain, state)
    *_, first = cell.tangent(dstrain, state)
    # Stress control sends no strain to the points that it is done with.
    done = torch.tensor([True, False, True])
    *_, second = cell.tangent(torch.where(done[:, None], 0.0, dstrain), state)
    assert counting.steps == 1
    assert torch.equal(first, second)


def test_other_increments_and_states_are_not_taken_for_the_last():
    counting = Counting(order="principal")
    dstrain, state = loaded(CSUH(order="principal"))
    cell = DifferenceTangent(counting)
    cell.step(dstrain, state)
    *_, other = cell.tangent(-dstrain, state)
    assert counting.steps == 2
    *_, again = DifferenceTangent(counting).tangent(-dstrain, state)
    assert torch.equal(other, again)
    cell.tangent(dstrain, state.clone())
    assert counting.steps == 4


def test_a_point_that_cannot_be_followed_leaves_the_others_alone():
    cell = CSUH(order="principal")
    dstrain, state = loaded(cell)
    state[1] = torch.nan
    stress, after, tangent = DifferenceTangent(cell).tangent(dstrain, state)
    assert stress[1].isnan().all()
    others = torch.tensor([0, 2])
    for part in (stress, after, tangent):
        assert part[others].isfinite().all()
