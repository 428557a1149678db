"""Runs in which some points fail: the others are unchanged, a failed one keeps its first steps."""

import pytest
import torch
from driven_cells import Limited
from small_cells import Fragile

from granbench.cells.contract import Conditions, History
from granbench.cells.robust_runs import (
    robust_call,
    robust_condition_each,
    robust_rollout,
    robust_states,
    robust_step,
)

LIMIT = 0.0105
FAILS_AT = (11, 6, 21, 4, 11)
"""First step at which a path's axial strain is beyond the limit; 21 for never."""


@pytest.fixture
def start() -> Conditions:
    return Conditions(1e5 * torch.arange(1.0, 6.0, dtype=torch.float64)[:, None].repeat(1, 3))


@pytest.fixture
def strain() -> torch.Tensor:
    """(5, 21, 3): paths that reach the limit sooner or later, and one that does not."""
    share = torch.tensor([1.0, 2.0, 0.5, 3.0, 1.0], dtype=torch.float64)
    steps = 1e-3 * torch.arange(21, dtype=torch.float64)
    direction = torch.tensor([1.0, -0.2, -0.2], dtype=torch.float64)
    return share[:, None, None] * steps[:, None] * direction


@pytest.mark.parametrize("raises", [False, True])
def test_a_path_is_kept_up_to_the_step_at_which_it_fails(raises, strain, start) -> None:
    found = robust_rollout(Fragile(LIMIT, raises), strain, start)["stress"]
    for path, step in enumerate(FAILS_AT):
        assert found[path, :step].isfinite().all()
        assert found[path, step:].isnan().all()
    assert torch.equal(found[2], Fragile(1.0, raises).rollout(strain, start).stress[2])


def test_raising_and_nan_are_the_same_failure(strain, start) -> None:
    for run in (robust_rollout, robust_states):
        one, other = (run(Fragile(LIMIT, raises), strain, start) for raises in (True, False))
        broken = other["stress"].isnan().any(dim=-1)
        for name in one:
            assert torch.equal(one[name][~broken], other[name][~broken])
        assert one["stress"][broken].isnan().all()


def test_states_of_a_record_are_nan_from_the_failure_on(strain, start) -> None:
    stress = start.stress[:, None].repeat(1, strain.shape[1], 1)
    found = robust_condition_each(Fragile(LIMIT, True), History(strain, stress, {}, start))
    for path, step in enumerate(FAILS_AT):
        assert found[path, :step].isfinite().all() and found[path, step:].isnan().all()


@pytest.mark.parametrize("failing", [(), (0,), (2, 3), (0, 1, 2, 3, 4)])
def test_a_point_that_raises_leaves_the_others_as_they_are(failing, start) -> None:
    cell = Limited(largest_increment=1e-3, raises=True)
    state = cell.initial_state(start)
    dstrain = torch.full((5, 3), 1e-4, dtype=torch.float64)
    dstrain[list(failing)] = 1e-2
    others = [point for point in range(5) if point not in failing]
    for method in (cell.step, cell.tangent):
        found = robust_call(method, dstrain, state)
        for part in found:
            assert part[list(failing)].isnan().all()
        if others:
            for part, expected in zip(found, method(dstrain[others], state[others]), strict=False):
                torch.testing.assert_close(part[others], expected, rtol=1e-12, atol=1e-6)
    stress = robust_step(cell, dstrain, state)["stress"]
    assert torch.equal(stress.isnan().any(dim=1).nonzero().flatten(), torch.tensor(failing).long())


def test_the_tensors_themselves_are_passed_on(start) -> None:
    """A difference tangent recognises the state of its last step."""
    state = start.stress
    dstrain = torch.zeros_like(state)
    found = robust_call(lambda *given: given, dstrain, state)
    assert found[0] is dstrain and found[1] is state


def test_other_errors_are_raised(start) -> None:
    def broken(dstrain, state):
        raise ValueError("a mistake in the code")

    with pytest.raises(ValueError):
        robust_call(broken, torch.zeros_like(start.stress), start.stress)
