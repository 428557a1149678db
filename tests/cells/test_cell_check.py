"""The check before scoring: what breaks the contract of cells is corrected or refused."""

import copy

import numpy as np
import pytest
import torch
import xarray as xr
from badly_behaved import (
    HARMLESS,
    LATE_HARMLESS,
    LATE_MEMORIES,
    LATE_MIXED,
    LATE_RANDOM,
    MEMORIES,
    MIXED,
    RANDOM,
    REFUSED,
    STIFFNESS,
    UNSEEN,
    WITHOUT_GRADIENTS,
    DetachesOneComponent,
    DropsOut,
    HardensItself,
    Module,
    Plain,
    PlainBuffer,
    cell,
)
from driven_cells import learnt
from lawless_cells import Coarse, Mortal, WrongTangent
from lawless_cells import cell as plane_cell
from small_cells import Fragile, Oracle, Persistence, secant

from granbench.benchmark.axes.physics.tangent import tangent_obstacle
from granbench.benchmark.evaluation import predict
from granbench.benchmark.predictions import CELL_NOTES, evaluated, is_deterministic
from granbench.cells.check import (
    DifferentResultsError,
    MixedRowsError,
    check_cell,
    checked_cell,
    probe_increments,
)
from granbench.cells.contract import Conditions, MaterialCell, MissingScalarError, ModuleCell
from granbench.element_test.run import run_test
from granbench.errors import ModelError
from granbench.models import MODELS
from granbench.paths.mixed_control import MixedControl
from granbench.paths.standard_tests import find_test, strain_history

ORDERS = {2: ("plane",), 3: ("principal", "plane", "full")}
CLASSICAL = [(name, order) for name, model in MODELS.items() for order in ORDERS[model.dimension]]


@pytest.fixture
def scored(records: xr.Dataset) -> xr.Dataset:
    return evaluated(records)


def stress_of(cell: MaterialCell, scored: xr.Dataset) -> np.ndarray:
    return predict({0: cell}, scored, ["single-step", "window", "rollout"])["stress"].values


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize("module", HARMLESS, ids=lambda module: module.__name__)
def test_a_corrected_model_scores_as_the_pure_one(module, dtype, scored):
    found = stress_of(cell(module, dtype=dtype), scored)
    # 15 bits of mantissa are kept; some of the modules round differently before.
    np.testing.assert_allclose(found, stress_of(cell(Module, dtype=dtype), scored), rtol=1e-4)


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize("module", MEMORIES, ids=lambda module: module.__name__)
def test_memory_outside_of_the_state_is_named(module, dtype, scored):
    for use in (check_cell, lambda one: predict({0: one}, scored, ["rollout"])):
        with pytest.raises(DifferentResultsError, match="StateLayout") as failed:
            use(cell(module, dtype=dtype))
        assert any(name.startswith(MEMORIES[module]) for name in failed.value.remembers)
        assert not failed.value.draws


@pytest.mark.parametrize("module", RANDOM, ids=lambda module: module.__name__)
def test_random_results_are_refused(module, scored):
    for use in (check_cell, lambda one: predict({0: one}, scored, ["rollout"])):
        with pytest.raises(DifferentResultsError) as failed:
            use(cell(module))
        assert failed.value.draws


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize("module", MIXED, ids=lambda module: module.__name__)
def test_points_that_depend_on_each_other_are_refused(module, dtype, scored):
    for use in (check_cell, lambda one: predict({0: one}, scored, ["rollout"])):
        with pytest.raises(MixedRowsError, match=module.__name__):
            use(cell(module, dtype=dtype))


@pytest.mark.parametrize("kind", REFUSED, ids=lambda kind: kind.__name__)
def test_what_breaks_the_contract_is_refused_with_what_to_change(kind):
    with pytest.raises(ModelError, match=REFUSED[kind]):
        check_cell(kind())


def test_memory_that_shows_late_is_found_after_the_use(scored):
    class Wears(Module):
        """Softens after many calls, more than a check makes."""

        calls = 0

        def forward(self, dstrain, stress):
            self.calls += 1
            return stress + STIFFNESS * dstrain * (1.0 if self.calls < 100 else 0.5)

    assert check_cell(cell(Wears)) == ()
    with pytest.raises(ModelError, match=r"module\.calls"):
        predict({0: cell(Wears)}, scored, ["single-step", "window", "rollout", "noise"])


@pytest.fixture
def sheared() -> tuple[torch.Tensor, Conditions]:
    """Paths up to 1 MPa and more: strain (path, step, component) of unlike sizes, and the start."""
    share = torch.tensor([1.0, 0.5, 0.3, 0.1, 0.02], dtype=torch.float64)
    direction = torch.tensor([1.0, -0.2, -0.2], dtype=torch.float64)
    steps = torch.arange(61, dtype=torch.float64) * 1.2e-3
    strain = share[:, None, None] * steps[:, None] * direction
    return strain, Conditions(torch.full((5, 3), 1e5, dtype=torch.float64))


def use(model: MaterialCell, sheared: tuple[torch.Tensor, Conditions]) -> None:
    with torch.no_grad(), checked_cell(model):
        model.rollout(*sheared)


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize("module", LATE_MEMORIES, ids=lambda module: module.__name__)
def test_memory_that_is_written_only_at_yield_is_found_in_the_use(module, dtype, sheared):
    check_cell(cell(module, dtype=dtype))
    with pytest.raises(DifferentResultsError) as failed:
        use(cell(module, dtype=dtype), sheared)
    assert any(name.startswith(LATE_MEMORIES[module]) for name in failed.value.remembers)


@pytest.mark.parametrize("module", LATE_RANDOM, ids=lambda module: module.__name__)
def test_chance_at_large_stress_is_found_in_the_use(module, sheared):
    check_cell(cell(module))
    with pytest.raises(DifferentResultsError) as failed:
        use(cell(module), sheared)
    assert failed.value.draws


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize("module", LATE_MIXED, ids=lambda module: module.__name__)
def test_points_that_depend_on_each_other_at_large_stress_are_found_in_the_use(
    module, dtype, sheared
):
    check_cell(cell(module, dtype=dtype))
    with pytest.raises(MixedRowsError, match=module.__name__):
        use(cell(module, dtype=dtype), sheared)


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize("module", [Module, *LATE_HARMLESS], ids=lambda module: module.__name__)
def test_caches_and_substeps_of_each_point_pass_the_use(module, dtype, sheared):
    model = cell(module, dtype=dtype)
    use(model, sheared)
    assert "step" not in vars(model)


def test_trials_of_newtons_method_that_harden_the_module_are_found():
    model = cell(HardensItself)
    programme = find_test("triaxial-drained").programme(1e5, 0.2, None)
    control = MixedControl.of_programme(programme, strain_history([0.2], 30), "principal")
    with (
        pytest.raises(ModelError, match=r"module\.plastic"),
        checked_cell(model),
    ):
        run_test(model, control, torch.full((1, 3), 1e5, dtype=torch.float64))


@pytest.mark.parametrize("module", UNSEEN, ids=lambda module: module.__name__)
def test_results_that_change_without_a_trace_name_no_attribute(module):
    with pytest.raises(DifferentResultsError) as failed:
        check_cell(cell(module))
    assert not failed.value.remembers and not failed.value.draws


def test_the_use_is_repeated_in_few_calls(sheared):
    class Counted(Module):
        calls = 0

        def forward(self, dstrain, stress):
            type(self).calls += 1
            return super().forward(dstrain, stress)

    model = cell(Counted)
    check_cell(model)
    of_the_check = Counted.calls
    Counted.calls = 0
    with torch.no_grad(), checked_cell(model):
        for _ in range(20):
            model.rollout(*sheared)
    assert Counted.calls - of_the_check - 20 * 60 <= 30


@pytest.mark.parametrize(("name", "order"), CLASSICAL)
def test_classical_models_pass_without_a_note(name, order):
    assert check_cell(MODELS[name](order=order)) == ()


@pytest.mark.parametrize(
    "model",
    [learnt(), learnt("plane", torch.float64), secant(), Plain(), WrongTangent(),
     plane_cell(Coarse()), Persistence(), Mortal(True), Mortal(False), Fragile(0.1, True)],
    ids=lambda model: f"{type(model).__name__} {model.name} {model.dtype}",
)  # fmt: skip
def test_models_that_keep_the_contract_pass(model):
    check_cell(model)


def test_the_oracle_passes_on_its_records(scored):
    assert CELL_NOTES not in predict({0: Oracle(scored)}, scored, ["rollout"]).attrs


def test_counting_without_an_effect_is_no_memory():
    class Profiled(Module):
        def __init__(self):
            super().__init__()
            self.calls, self.sizes = 0, []

        def forward(self, dstrain, stress):
            self.calls += 1
            self.sizes.append(len(dstrain))
            return super().forward(dstrain, stress)

    assert check_cell(cell(Profiled)) == ()


def test_the_mode_is_noted_and_given_back(scored):
    model = cell(DropsOut)
    found = predict({0: model}, scored, ["rollout"])
    assert "Dropout" in found.attrs[CELL_NOTES]
    assert "evaluation mode" in found.attrs[CELL_NOTES]
    assert model.module.training and model.module.drop.training
    model.module.eval()
    assert check_cell(model) == ()


def test_nothing_of_a_cell_is_changed_by_the_check():
    model = learnt()
    before = copy.deepcopy(model.module.state_dict())
    state = torch.get_rng_state()
    check_cell(model)
    assert all(
        torch.equal(value, before[name]) for name, value in model.module.state_dict().items()
    )
    assert torch.equal(torch.get_rng_state(), state)


def test_a_start_and_increments_of_ones_own_are_used():
    read = []

    class Demanding(Plain):
        def initial_state(self, conditions):
            read.append(float(conditions.require("density_index")[0]))
            return super().initial_state(conditions)

    with pytest.raises(MissingScalarError, match="density_index"):
        check_cell(Demanding())
    stress = torch.full((2, 3), 1e5, dtype=torch.float64)
    start = Conditions(stress, {"density_index": torch.tensor([0.4, 0.4])})
    check_cell(Demanding(), start, probe_increments("principal", 2))
    assert set(read) == {float(torch.tensor(0.4))}
    check_cell(Demanding(), stress)  # states need no start


class Skewed(Module):
    """The detached component lies in a shear coupling."""

    def forward(self, dstrain, stress):
        turned = dstrain.roll(1, dims=1)
        return stress + STIFFNESS * (dstrain + 0.8 * turned.detach())


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize("module", [*WITHOUT_GRADIENTS, Skewed], ids=lambda module: module.__name__)
def test_held_stresses_are_met_without_gradients(module, dtype):
    """The same test as with gradients: elasticity without Poisson's effect is uniaxial."""
    model = cell(module, dtype=dtype)
    programme = find_test("triaxial-drained").programme(1e5, 0.01, None)
    control = MixedControl.of_programme(programme, strain_history([0.01], 5), "principal")
    pure = cell(Module, dtype=dtype) if module is not Skewed else None
    with checked_cell(model) as check:
        assert check.by_differences
        assert "differences" in " ".join(check.notes)
        assert not model.cheap_tangent
        stress = torch.full((1, 3), 1e5, dtype=dtype)
        found = run_test(model, control, stress)
    assert model.cheap_tangent
    assert not found.failures
    rounding = 1e-9 if dtype == torch.float64 else 2e-5
    np.testing.assert_allclose(found.stress[0, :, 1:], 1e5, rtol=5.0 * rounding * 10.0)
    if pure is not None:
        expected = run_test(pure, control, stress)
        np.testing.assert_allclose(found.stress, expected.stress, rtol=1e-4)


def test_a_tangent_without_gradients_is_that_of_the_stresses():
    for module in WITHOUT_GRADIENTS[:-1]:
        model = cell(module)
        dstrain = probe_increments("principal", 2)[:, 0]
        state = torch.full((2, 3), 1e5, dtype=torch.float64)
        _, _, tangent = model.tangent(dstrain, state)
        expected = (STIFFNESS * torch.eye(3, dtype=torch.float64)).expand(2, 3, 3)
        torch.testing.assert_close(tangent, expected, rtol=1e-3, atol=1e3)
        assert "differences" in str(tangent_obstacle(model, dstrain, state)), module


def test_a_stress_that_strain_does_not_change_has_the_tangent_zero():
    model = Persistence()
    state = torch.full((2, 3), 1e5, dtype=torch.float64)
    dstrain = probe_increments("principal", 2)[:, 0]
    assert not model.tangent(dstrain, state)[2].any()
    assert tangent_obstacle(model, dstrain, state) is None
    assert check_cell(model) == ()


def test_a_gradient_that_is_partly_missing_names_the_component():
    (note,) = check_cell(cell(DetachesOneComponent))
    assert "stress 22" in note and "differences" in note


def seeded(seed: int) -> ModuleCell:
    return secant_of(1e6 * (1 + seed))


class Secant(torch.nn.Module):
    def __init__(self, stiffness: float) -> None:
        super().__init__()
        self.stiffness = torch.nn.Parameter(torch.tensor(stiffness))

    def forward(self, dstrain, stress):
        return stress + self.stiffness * dstrain


def secant_of(stiffness: float) -> ModuleCell:
    return ModuleCell(Secant(stiffness), name="secant")


@pytest.mark.parametrize("axes", [["rollout"], ["window", "noise"], ["cost"], ["physics"]])
def test_one_model_under_three_seeds_is_one_deterministic_model(axes, scored):
    found = predict({seed: secant_of(1e6) for seed in (0, 1, 2)}, scored, axes)
    assert "one deterministic model" in found.attrs[CELL_NOTES]
    assert is_deterministic(found) == ("protocol" in found.dims)
    different = predict({seed: secant_of(1e6 + seed * 1e5) for seed in (0, 1, 2)}, scored, axes)
    assert CELL_NOTES not in different.attrs
    assert not is_deterministic(different)


def test_one_cell_for_all_seeds_is_deterministic_without_a_note(scored):
    shared = secant_of(1e6)
    found = predict({0: shared, 1: shared}, scored, ["rollout", "noise"])
    assert is_deterministic(found)
    assert CELL_NOTES not in found.attrs
    assert not is_deterministic(predict({0: shared}, scored, ["rollout"]))


@pytest.mark.parametrize("axes", [["rollout"], ["cost"]])
def test_a_model_that_is_given_twice_among_others_is_refused(axes, scored):
    cells = {0: secant_of(1e6), 1: secant_of(2e6), 2: secant_of(1e6)}
    with pytest.raises(ModelError, match="seeds 0 and 2 are one and the same model"):
        predict(cells, scored, axes)


def test_models_that_differ_only_beyond_yield_are_not_one(scored):
    """Two models may agree at small strain and differ at large strain."""

    class Capped(Module):
        def __init__(self, cap):
            super().__init__()
            self.cap = cap

        def forward(self, dstrain, stress):
            return (stress + STIFFNESS * dstrain).clamp(max=self.cap)

    cells = {n: ModuleCell(Capped(cap), name="capped") for n, cap in enumerate((2e8, 4e6, 3e6))}
    found = predict(cells, scored, ["rollout"])
    assert not is_deterministic(found)


def test_a_scratch_buffer_of_a_module_is_no_memory():
    assert "differences" not in " ".join(check_cell(cell(HARMLESS[4])))
    with pytest.raises(ModelError):
        check_cell(PlainBuffer())
