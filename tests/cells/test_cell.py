"""Laws of the material cell: everything is derived from `step`."""

import inspect

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from granbench.cells.contract import Conditions, History, MaterialCell, ModuleCell, StateLayout
from granbench.data.adapters import conditions_of, history_of
from granbench.errors import ModelError


class Hardening(MaterialCell):
    """An explicit cell whose stiffness depends on stress, void ratio and accumulated strain."""

    name = "hardening"
    layout = StateLayout.of(stress=3, void_ratio=1, accumulated=3)
    internals = ("void_ratio",)

    def initial_state(self, conditions: Conditions) -> Tensor:
        return self.layout.pack(
            stress=conditions.stress,
            void_ratio=conditions.require("initial_void_ratio"),
            accumulated=conditions.past_strain(),
        )

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        stress, void_ratio = state[:, self.layout["stress"]], state[:, self.layout["void_ratio"]]
        accumulated = state[:, self.layout["accumulated"]] + dstrain.abs()
        stiffness = 50.0 * stress.mean(1, keepdim=True).abs() / (void_ratio + accumulated.sum())
        stress = stress + stiffness * dstrain
        void_ratio = void_ratio - (1.0 + void_ratio) * dstrain.sum(1, keepdim=True)
        state = self.layout.pack(stress=stress, void_ratio=void_ratio, accumulated=accumulated)
        return stress, state


class Recurrent(torch.nn.Module):
    """A network with a hidden state after the stress."""

    def __init__(self) -> None:
        super().__init__()
        self.cell = torch.nn.GRUCell(3, 8)
        self.out = torch.nn.Linear(8, 3)

    def forward(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        hidden = self.cell(100.0 * dstrain, state[:, 3:])
        stress = 1e6 * self.out(hidden)
        return stress, torch.cat([stress, hidden], dim=1)


def recurrent() -> ModuleCell:
    torch.manual_seed(0)
    layout = StateLayout.of(stress=3, hidden=8)
    return ModuleCell(Recurrent(), name="recurrent", layout=layout, dtype=torch.float64)


@pytest.fixture(params=[Hardening, recurrent], ids=["explicit", "recurrent"])
def cell(request):
    return request.param()


@pytest.fixture
def history(records) -> History:
    return history_of(records.isel(path=slice(0, 6), step=slice(0, 12)))


@torch.no_grad()
def test_rollout_is_step_repeated(cell, history):
    rollout = cell.rollout(history.strain, history.conditions)
    state = cell.initial_state(history.conditions)
    torch.testing.assert_close(rollout.stress[:, 0], history.conditions.stress)
    for n in range(1, history.strain.shape[1]):
        stress, state = cell.step(history.strain[:, n] - history.strain[:, n - 1], state)
        torch.testing.assert_close(rollout.stress[:, n], stress, rtol=0.0, atol=0.0)
        for name in cell.internals:
            expected = state[:, cell.layout[name]].squeeze(1)
            torch.testing.assert_close(rollout.internals[name][:, n], expected, rtol=0.0, atol=0.0)


@torch.no_grad()
def test_condition_each_is_condition_stacked(cell, history):
    steps = range(history.strain.shape[1])
    stacked = torch.stack([cell.condition(history.until(n)) for n in steps], dim=1)
    torch.testing.assert_close(cell.condition_each(history), stacked, rtol=0.0, atol=0.0)


@torch.no_grad()
def test_condition_ends_at_the_last_true_state(cell, history):
    state = cell.condition(history)
    torch.testing.assert_close(state[:, cell.layout["stress"]], history.stress[:, -1])
    for name in cell.internals:
        true = history.internals[name][:, -1:]
        torch.testing.assert_close(state[:, cell.layout[name]], true)


@torch.no_grad()
def test_a_state_restarts_a_run(cell, history):
    """A stored state continues as if the run had never stopped: what Newton iterations need."""
    state = cell.initial_state(history.conditions)
    for n in range(1, 6):
        _, state = cell.step(history.strain[:, n] - history.strain[:, n - 1], state)
    stored = state.clone()
    dstrain = history.strain[:, 6] - history.strain[:, 5]
    first, _ = cell.step(dstrain, state)
    torch.testing.assert_close(state, stored, rtol=0.0, atol=0.0)  # the step left it unchanged
    again, _ = cell.step(dstrain, stored)
    torch.testing.assert_close(first, again, rtol=0.0, atol=0.0)


@torch.no_grad()
def test_the_future_changes_nothing_that_was_predicted(cell, history):
    whole = cell.rollout(history.strain, history.conditions)
    cut = cell.rollout(history.strain[:, :7], history.conditions)
    torch.testing.assert_close(whole.stress[:, :7], cut.stress, rtol=0.0, atol=0.0)


def test_gradients_flow_through_a_rollout(history):
    cell = recurrent()
    cell.rollout(history.strain, history.conditions).stress[:, 1:].sum().backward()
    assert all(parameter.grad is not None for parameter in cell.module.parameters())
    assert cell.parameters_count() == sum(p.numel() for p in cell.module.parameters())


@given(
    st.dictionaries(st.sampled_from("abcdef"), st.integers(1, 5), min_size=1),
    st.integers(1, 7),
)
def test_layout_packs_what_its_slices_take_out(widths, points):
    layout = StateLayout.of(**widths)
    generator = torch.Generator().manual_seed(0)
    parts = {n: torch.rand(points, w, generator=generator) for n, w in widths.items()}
    state = layout.pack(**dict(reversed(parts.items())))  # order of the words does not matter
    assert state.shape == (points, sum(widths.values()))
    for name, part in parts.items():
        assert torch.equal(state[:, layout[name]], part)


def test_states_are_stored_component_major():
    state = StateLayout.of(stress=3, void_ratio=1).pack(
        stress=torch.rand(5, 3), void_ratio=torch.rand(5)
    )
    assert state.shape == (5, 4)
    assert state.T.is_contiguous()


def test_a_layout_refuses_parts_that_are_not_its_own():
    layout = StateLayout.of(stress=3, void_ratio=1)
    with pytest.raises(ModelError, match="hidden"):
        layout.pack(stress=torch.rand(5, 3), void_ratio=torch.rand(5), hidden=torch.rand(5, 2))
    with pytest.raises(ModelError, match="void_ratio"):
        layout.pack(stress=torch.rand(5, 3))


def users_own_cell() -> ModuleCell:
    class Elastic(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.stiffness = torch.nn.Parameter(torch.tensor(30e6))

        def forward(self, dstrain, stress):
            return stress + self.stiffness * dstrain

    return ModuleCell(Elastic(), name="elastic")


def test_a_users_module_is_a_cell_in_under_ten_lines(records):
    body = inspect.getsource(users_own_cell).splitlines()[1:]
    assert len([line for line in body if line.strip()]) < 10
    cell = users_own_cell()
    history = history_of(records)
    with torch.no_grad():
        rollout = cell.rollout(history.strain, history.conditions)
    expected = history.stress[:, :1] + 30e6 * history.strain
    # float32 sums of forty increments of stresses up to 1e7 Pa.
    torch.testing.assert_close(rollout.stress.double(), expected, rtol=1e-4, atol=20.0)
    assert cell.parameters_count() == 1


def test_module_cell_starts_from_the_conditions_of_the_same_name(records):
    layout = StateLayout.of(stress=3, void_ratio=1, hidden=4)
    cell = ModuleCell(torch.nn.Identity(), name="any", layout=layout)
    conditions = conditions_of(records)
    state = cell.initial_state(conditions)
    void_ratio = state[:, layout["void_ratio"]].squeeze(1).double()
    torch.testing.assert_close(void_ratio, conditions.require("initial_void_ratio"))
    assert (state[:, layout["hidden"]] == 0.0).all()


def test_what_a_path_cannot_give_is_named(records):
    conditions = conditions_of(records.drop_vars("grading_index"))
    with pytest.raises(ModelError, match="'grading_index'"):
        conditions.require("grading_index")


def test_a_module_that_forgets_its_state_is_refused(records):
    module = torch.nn.Bilinear(3, 4, 3)
    layout = StateLayout.of(stress=3, hidden=1)
    cell = ModuleCell(module, name="forgetful", layout=layout)
    with pytest.raises(ModelError, match=r"return \(stress, state\)"):
        cell.rollout(history_of(records).strain, conditions_of(records))
