"""Laws of every wrapper of a cell, found by searching the subclasses of `CellWrapper`."""

import importlib
import inspect
import itertools
from collections.abc import Iterable
from pathlib import Path

import pytest
import torch
from driven_cells import learnt
from registered_cells import cell_of, record_of, rounding
from small_cells import Persistence, secant

from granbench.benchmark.axes.embedded.timed_cell import TimedCell
from granbench.cells import check_cell
from granbench.cells.check.probe import default_start, probe_increments
from granbench.cells.contract import CONTRACT_ATTRIBUTES, Conditions, History, MaterialCell
from granbench.cells.difference_tangent import DifferenceTangent
from granbench.cells.wrapper import CellWrapper
from granbench.errors import AnalysisError
from granbench.fem.problems import find_problem
from granbench.fitting.cell_of_each_point import CellOfEachPoint
from granbench.models import ClassicalCell
from granbench.models.modified_cam_clay import ModifiedCamClay

POINTS = 4
PACKAGES = ("granbench", "granbench.generators", "granbench.baselines", "granbench.leaderboard")

MODELS = ("j2 plane", "drucker-prager plane", "csuh full", "modified-cam-clay principal")
BASELINES = ("gru", "lstm", "oracle", "linear-elastic")
CELLS = (*MODELS, *BASELINES)
READS_RECORDS = ("oracle",)
"""They have stresses for the recorded strain only, and no tangent."""
PREDICTS = tuple(case for case in CELLS if case not in READS_RECORDS)

ARGUMENTS = {
    CellOfEachPoint: lambda cell: (
        {name: torch.zeros(POINTS, dtype=cell.dtype) for name in cell.free},
    )
}
"""Arguments, besides the cell, with which a wrapper changes nothing."""


def wrappers() -> list[type[CellWrapper]]:
    """Every wrapper of the package, of modules that are imported because they name the class."""
    for package in PACKAGES:
        folder = Path(str(importlib.import_module(package).__file__)).parent
        for file in folder.rglob("*.py"):
            if "CellWrapper" in file.read_text(encoding="utf-8"):
                parts = file.relative_to(folder).with_suffix("").parts
                importlib.import_module(".".join([package, *parts]))
    found, waiting = [CellWrapper], [CellWrapper]
    while waiting:
        own = waiting.pop().__subclasses__()
        found += own
        waiting += own
    return [kind for kind in found if kind.__module__.startswith("granbench")]


WRAPPERS = wrappers()


def each_of(kinds: Iterable[type[CellWrapper]], cases: Iterable[str]) -> pytest.MarkDecorator:
    """Every wrapper around every cell that it can wrap: some take classical models alone."""
    pairs = [
        pytest.param(kind, case, id=f"{kind.__name__} {case}")
        for kind, case in itertools.product(kinds, cases)
        if kind not in ARGUMENTS or case in MODELS
    ]
    return pytest.mark.parametrize(("wrapper", "case"), pairs)


@pytest.fixture
def cell(case: str) -> MaterialCell:
    return cell_of(case)


def wrapped_by(kind: type[CellWrapper], cell: MaterialCell) -> CellWrapper:
    return kind(cell, *(ARGUMENTS[kind](cell) if kind in ARGUMENTS else ()))


def close(cell: MaterialCell, found: torch.Tensor, expected: torch.Tensor) -> None:
    """Equal but for the rounding of another batch."""
    scale = float(expected.nan_to_num().abs().max())
    torch.testing.assert_close(
        found, expected, rtol=rounding(cell), atol=rounding(cell) * scale, equal_nan=True
    )


def test_the_wrappers_of_the_package_are_found() -> None:
    assert {CellWrapper, DifferenceTangent, TimedCell, CellOfEachPoint} <= set(WRAPPERS)


def test_the_wrapper_forwards_every_method_of_the_contract() -> None:
    """All but those that follow from others, which no wrapper may override."""
    for name, member in vars(MaterialCell).items():
        follows = getattr(member, "__final__", False) or name == "component_count"
        if not name.startswith("_") and not follows and name not in CONTRACT_ATTRIBUTES:
            assert name in vars(CellWrapper), name


@pytest.mark.parametrize("case", CELLS)
def test_the_cases_say_which_cells_read_records_and_which_are_models(
    case: str, cell: MaterialCell
) -> None:
    assert cell.reads_records == (case in READS_RECORDS)
    assert isinstance(cell, ClassicalCell) == (case in MODELS)


@each_of(WRAPPERS, CELLS)
def test_every_attribute_is_that_of_the_cell(
    wrapper: type[CellWrapper], cell: MaterialCell
) -> None:
    found = wrapped_by(wrapper, cell)
    for name in CONTRACT_ATTRIBUTES:
        if wrapper is CellWrapper or name not in vars(wrapper):
            assert getattr(found, name) == getattr(cell, name), name
    assert found.component_count == cell.component_count
    assert found.parameters_count() == cell.parameters_count()
    if "tangent" not in vars(wrapper):
        assert found.has_own_tangent == cell.has_own_tangent


class HalfSteps(CellWrapper):
    """A wrapper as docs/own_models.md describes one."""

    def step(self, dstrain: torch.Tensor, state: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        return self.wrapped.step(0.5 * dstrain, state)


@each_of([*WRAPPERS, HalfSteps], PREDICTS)
def test_the_tangent_belongs_to_the_step(
    wrapper: type[CellWrapper], case: str, cell: MaterialCell
) -> None:
    record = record_of(case, cell)
    found = wrapped_by(wrapper, cell)
    state = cell.initial_state(record.conditions).detach()
    increment = (record.strain[:, 1] - record.strain[:, 0]).to(cell.dtype)
    stress, after, tangent = found.tangent(increment, state)
    expected = [part.detach() for part in found.step(increment, state)]
    close(cell, stress, expected[0])
    close(cell, after, expected[1])
    width = 1e-6 if cell.dtype == torch.float64 else 1e-4
    shift = torch.zeros_like(increment)
    shift[:, 0] = width
    forward, backward = (found.step(increment + s, state)[0] for s in (shift, -shift))
    column = (forward - backward) / (2.0 * width)
    difference = ((tangent[:, :, 0] - column).norm(dim=1) / column.norm(dim=1)).detach()
    assert float(difference.median()) < 0.05


@pytest.mark.parametrize("case", PREDICTS)
@torch.no_grad()
def test_a_changed_step_changes_what_is_made_of_steps(case: str, cell: MaterialCell) -> None:
    record, found = record_of(case, cell), HalfSteps(cell)
    assert found.name == f"{cell.name} + HalfSteps"
    assert not found.has_own_tangent
    states = [found.initial_state(record.conditions)]
    for step in range(1, record.strain.shape[1]):
        increment = (record.strain[:, step] - record.strain[:, step - 1]).to(cell.dtype)
        _, after = found.step(increment, states[-1])
        states.append(found._with_truth(after, record, step))
    close(cell, found.condition(record), states[-1])
    close(cell, found.condition_each(record), torch.stack(states, dim=1))


def test_a_changed_step_passes_the_check_without_notes() -> None:
    half = HalfSteps(ModifiedCamClay())
    assert check_cell(half) == ()


def test_a_wrapper_may_have_a_name_and_a_tangent_of_its_own() -> None:
    class Own(HalfSteps):
        name = "own"

        def step(self, dstrain, state):
            return self.wrapped.step(0.25 * dstrain, state)

        def tangent(self, dstrain, state):
            stress, after, tangent = self.wrapped.tangent(0.25 * dstrain, state)
            return stress, after, 0.25 * tangent

    found = Own(secant())
    assert found.name == "own" and found.has_own_tangent
    assert Own(found).name == "own"
    assert HalfSteps(found).name == "own + HalfSteps"


def test_a_changed_start_changes_the_conditioning() -> None:
    class FromZero(CellWrapper):
        def initial_state(self, conditions: Conditions) -> torch.Tensor:
            return torch.zeros_like(self.wrapped.initial_state(conditions))

    record = record_of("persistence", cell_of("persistence"))
    found = FromZero(Persistence())
    assert torch.equal(
        found.condition_each(record)[:, 0], torch.zeros_like(found.condition(record))
    )
    assert found.name == Persistence().name


def test_an_attribute_that_changes_in_the_cell_changes_in_the_wrapper() -> None:
    cell = secant()
    found = CellWrapper(cell)
    cell.cheap_tangent = False
    assert not found.cheap_tangent
    found.cheap_tangent = True
    assert found.cheap_tangent and not cell.cheap_tangent
    del found.cheap_tangent
    assert not found.cheap_tangent


@each_of(WRAPPERS, CELLS)
@torch.no_grad()
def test_states_stresses_and_conditioning_are_those_of_the_cell(
    wrapper: type[CellWrapper], case: str, cell: MaterialCell
) -> None:
    record = record_of(case, cell)
    found = wrapped_by(wrapper, cell)
    state = cell.initial_state(record.conditions)
    assert torch.equal(found.initial_state(record.conditions), state)
    for increment in record.strain.diff(dim=1).to(cell.dtype).unbind(dim=1):
        expected = cell.step(increment, state)
        for one, other in zip(found.step(increment, state), expected, strict=True):
            close(cell, one, other)
        _, state = expected
    close(cell, found.condition(record), cell.condition(record))
    close(cell, found.condition_each(record), cell.condition_each(record))


@each_of([kind for kind in WRAPPERS if kind is not DifferenceTangent], PREDICTS)
def test_tangents_are_those_of_the_cell(
    wrapper: type[CellWrapper], case: str, cell: MaterialCell
) -> None:
    record = record_of(case, cell)
    found = wrapped_by(wrapper, cell)
    state = cell.initial_state(record.conditions).detach()
    increment = (record.strain[:, 1] - record.strain[:, 0]).to(cell.dtype)
    expected = cell.tangent(increment, state)
    for one, other in zip(found.tangent(increment, state), expected, strict=True):
        close(cell, one, other)


def test_a_plain_wrapper_changes_no_bit() -> None:
    cell = learnt()
    increments, start = probe_increments(cell.order, POINTS), default_start(cell)
    strain = increments.cumsum(dim=1)
    for kind in (CellWrapper, TimedCell):
        found = kind(cell).rollout(strain, start).stress
        assert torch.equal(found, cell.rollout(strain, start).stress)


@pytest.mark.parametrize("wrapper", WRAPPERS)
def test_a_wrapped_cam_clay_stays_pressure_dependent(wrapper: type[CellWrapper]) -> None:
    cell = ModifiedCamClay()
    problem = find_problem("biaxial")
    found = CellWrapper(wrapped_by(wrapper, cell))
    assert found.pressure_dependent
    assert problem.confined_for(found) == problem.confined_for(cell)
    assert problem.confined_for(found).initial_pressure > 0.0


def test_conditioning_that_a_cell_does_itself_is_forwarded() -> None:
    class Own(Persistence):
        def condition(self, history: History) -> torch.Tensor:
            return super().condition(history) + 1.0

    record = record_of("persistence", cell_of("persistence"))
    found = CellWrapper(Own())
    assert torch.equal(found.condition(record), Own().condition(record))


def test_a_timed_cell_counts_its_calls_up_to_the_limit() -> None:
    cell = TimedCell(Persistence(), limit=2)
    state = cell.initial_state(Conditions(torch.full((1, 3), 1e5, dtype=torch.float64)))
    for _ in range(2):
        cell.step(torch.zeros_like(state), state)
    assert cell.calls == 2 and cell.seconds >= 0.0
    with pytest.raises(AnalysisError, match="persistence"):
        cell.tangent(torch.zeros_like(state), state)


def test_a_new_wrapper_needs_no_more_than_a_cell() -> None:
    for kind in WRAPPERS:
        required = [
            name
            for name, parameter in inspect.signature(kind).parameters.items()
            if parameter.default is parameter.empty
        ]
        assert required == ["cell"] or kind in ARGUMENTS, kind.__name__
