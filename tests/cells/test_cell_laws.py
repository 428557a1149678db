"""Laws of every registered model and baseline: what the contract of material cells promises."""

import pytest
import torch
from registered_cells import BASELINE_CASES, CASES, MODEL_CASES, cell_of, record_of, rounding

from granbench.cells.baseline import BASELINES
from granbench.cells.contract import CONTRACT_ATTRIBUTES, History, MaterialCell

EXPLICIT = [
    case
    for case in CASES
    if case in MODEL_CASES
    or not (BASELINES[case].presets or cell_of(case).reads_records)
]  # fmt: skip
"""Cases that promise the same stress after a zero increment: laws, not networks, whose error there
is scored, and not the oracle, which has no stress for strain that is not recorded."""


@pytest.fixture(params=CASES)
def case(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def cell(case: str) -> MaterialCell:
    return cell_of(case)


@pytest.fixture
def record(case: str, cell: MaterialCell) -> History:
    return record_of(case, cell)


def increments_of(record: History, cell: MaterialCell) -> list[torch.Tensor]:
    return list(record.strain.diff(dim=1).to(cell.dtype).unbind(dim=1))


@torch.no_grad()
def states_along(record: History, cell: MaterialCell) -> list[torch.Tensor]:
    states = [cell.initial_state(record.conditions)]
    for increment in increments_of(record, cell):
        states.append(cell.step(increment, states[-1])[1])
    return states


def test_there_is_a_case_for_every_model_and_baseline() -> None:
    assert {case.split()[0] for case in CASES} >= {"j2", "csuh", "mlstm", "oracle"}
    assert set(BASELINE_CASES) <= set(CASES)


def test_every_attribute_of_the_contract_is_there(cell: MaterialCell) -> None:
    for name in CONTRACT_ATTRIBUTES:
        assert getattr(cell, name) is not None, name


@torch.no_grad()
@pytest.mark.parametrize("case", EXPLICIT)
def test_a_zero_increment_returns_the_same_stress(case: str) -> None:
    cell = cell_of(case)
    for state in states_along(record_of(case, cell), cell):
        stress, after = cell.step(torch.zeros_like(state[:, cell.layout["stress"]]), state)
        scale = float(state.abs().max())
        for found in (stress, after[:, cell.layout["stress"]]):
            before = state[:, cell.layout["stress"]]
            torch.testing.assert_close(found, before, rtol=0.0, atol=1e-9 * scale)
        for name in cell.internals:
            one, other = after[:, cell.layout[name]], state[:, cell.layout[name]]
            torch.testing.assert_close(one, other, rtol=1e-9, atol=1e-12)


@torch.no_grad()
def test_a_step_leaves_state_and_increment_unchanged(cell: MaterialCell, record: History) -> None:
    for increment, state in zip(
        increments_of(record, cell), states_along(record, cell)[:-1], strict=True
    ):
        kept = increment.clone(), state.clone()
        first = cell.step(increment, state)
        assert torch.equal(increment, kept[0]) and torch.equal(state, kept[1])
        for one, other in zip(first, cell.step(increment, state), strict=True):
            torch.testing.assert_close(one, other, rtol=0.0, atol=0.0, equal_nan=True)


@torch.no_grad()
def test_points_of_a_batch_do_not_depend_on_each_other(cell: MaterialCell, record: History) -> None:
    for increment, state in zip(
        increments_of(record, cell), states_along(record, cell)[:-1], strict=True
    ):
        together = cell.step(increment, state)
        for point in range(len(state)):
            alone = cell.step(increment[point : point + 1], state[point : point + 1])
            for one, other in zip(alone, together, strict=True):
                scale = float(other.abs().max())
                torch.testing.assert_close(
                    one[0], other[point], rtol=rounding(cell), atol=rounding(cell) * scale
                )


@torch.no_grad()
def test_a_rollout_is_step_after_step(cell: MaterialCell, record: History) -> None:
    found = cell.rollout(record.strain, record.conditions)
    assert torch.equal(found.stress[:, 0], record.conditions.stress.to(cell.dtype))
    state = cell.initial_state(record.conditions)
    for step, increment in enumerate(increments_of(record, cell), start=1):
        stress, state = cell.step(increment, state)
        assert torch.equal(found.stress[:, step], stress)
        for name in cell.internals:
            assert torch.equal(found.internals[name][:, step], state[:, cell.layout[name]][:, 0])


@torch.no_grad()
def test_condition_each_is_condition_of_every_beginning(
    cell: MaterialCell, record: History
) -> None:
    steps = range(record.strain.shape[1])
    stacked = torch.stack([cell.condition(record.until(step)) for step in steps], dim=1)
    found = cell.condition_each(record)
    scale = float(stacked.nan_to_num().abs().max())
    torch.testing.assert_close(
        found, stacked, rtol=rounding(cell), atol=rounding(cell) * scale, equal_nan=True
    )
    true = record.stress.to(cell.dtype)
    torch.testing.assert_close(found[..., cell.layout["stress"]], true, rtol=1e-6, atol=1e-6)
