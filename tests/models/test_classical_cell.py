"""What every classical model inherits: parameters, sets, orders, starts, blocks."""

import pytest
import torch
from plastic_paths import isotropic, random_increments, run, stress_of

from granbench.cells.contract import Conditions, History
from granbench.errors import ConfigurationError, ModelError
from granbench.models import MODELS, classical, find_model
from granbench.models.drucker_prager import DruckerPrager
from granbench.models.ground_truth import recording_cell
from granbench.models.ime import IME
from granbench.models.j2 import J2
from granbench.models.j2_hardening import J2Hardening


@pytest.fixture(params=MODELS)
def model(request):
    return MODELS[request.param]


def test_every_published_value_is_in_range_and_is_what_the_model_computes_with(model):
    for name, published in model.parameter_sets.items():
        assert set(published) == {parameter.name for parameter in model.parameter_table}
        values = model(parameter_set=name).values()
        for parameter, value in values.items():
            # To the last bit, but for one rounding where a bound below is not zero.
            assert value == pytest.approx(published[parameter], rel=3e-16)


def test_the_first_set_is_the_default(model):
    first = next(iter(model.parameter_sets))
    assert model().values() == model(parameter_set=first).values()


def test_names_are_unique_and_have_units(model):
    table = model.parameter_table
    for field in ("name", "symbol"):
        assert len({getattr(parameter, field) for parameter in table}) == len(table)
    assert all(parameter.units in ("1", "Pa") for parameter in table)


def test_given_values_replace_those_of_the_set():
    cell = IME({"poisson_ratio": 0.3}, parameter_set="guan2023-tab7.1")
    assert cell.values()["poisson_ratio"] == pytest.approx(0.3, rel=1e-15)
    assert cell.values()["yield_stress"] == 1e5
    copy = cell.copy_with({"young_modulus": 1e7})
    assert copy.values() == {**cell.values(), "young_modulus": 1e7}
    assert (copy.order, copy.dtype) == (cell.order, cell.dtype)


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        ({"parameter_set": "guan"}, "j2 has no parameter set 'guan'; there are guan2023-sec6.6"),
        ({"values": {"yeild_stress": 1.0}}, "did you mean 'yield_stress'"),
        ({"values": {"yield_stress": -1.0}}, r"\(sigma_Y, Pa\) is -1 but must be above 0"),
        ({"values": {"yield_stress": float("nan")}}, "is nan but must be above 0"),
    ],
)
def test_a_wrong_parameter_is_named(mistake, message):
    with pytest.raises(ModelError, match=message):
        J2(**mistake)


def test_a_wrong_order_is_named():
    with pytest.raises(ConfigurationError, match="unknown component order 'planar'"):
        J2(order="planar")


def test_a_wrong_model_is_named():
    with pytest.raises(ModelError, match="did you mean 'drucker-prager'"):
        find_model("drucker-praguer")


@pytest.mark.parametrize(
    ("order", "names"),
    [
        ("principal", ("11", "22", "33")),
        ("plane", ("xx", "yy", "xy", "zz")),
        ("full", ("xx", "yy", "zz", "yz", "xz", "xy")),
    ],
)
def test_internal_tensors_have_the_components_of_the_stress(order, names):
    cell = IME(order=order)
    expected = tuple(f"plastic_strain_{name}" for name in names)
    out_of_plane = ("out_of_plane_stress",) if order == "plane" else ()
    assert cell.internals == out_of_plane + expected


def test_constants_follow_the_free_numbers_however_they_are_changed():
    """They are remembered between steps without gradients: never longer than they are true."""
    cell = J2()
    strain, state = torch.tensor([[0.1, -0.1, 0.0]], dtype=torch.float64), isotropic(cell, 1)

    @torch.no_grad()
    def strength() -> float:
        stress, _ = cell.step(strain, state)
        return float(stress[0, 0] - stress[0, 1])

    assert strength() == pytest.approx(1e5, rel=1e-12)
    with torch.no_grad():
        cell.free["yield_stress"].fill_(0.5)
    assert strength() == pytest.approx(1e5 * 2.718281828459045**0.5, rel=1e-12)
    cell.free["yield_stress"].data.fill_(-0.5)
    assert strength() == pytest.approx(1e5 * 2.718281828459045**-0.5, rel=1e-12)
    cell.free["yield_stress"].data = torch.zeros((), dtype=torch.float64)
    assert strength() == pytest.approx(1e5, rel=1e-12)
    cell.free["yield_stress"] = torch.nn.Parameter(torch.full((1,), 1.0, dtype=torch.float64))
    assert strength() == pytest.approx(1e5 * 2.718281828459045, rel=1e-12)


def test_gradients_after_a_run_without_them():
    cell = J2()
    with torch.inference_mode():
        cell.step(torch.full((1, 3), 0.1, dtype=torch.float64), isotropic(cell, 1))
    strain = torch.tensor([[0.1, -0.1, 0.0]], dtype=torch.float64, requires_grad=True)
    cell.requires_grad_(False)
    stress, _ = cell.step(strain, isotropic(cell, 1))
    stress.sum().backward()
    assert torch.isfinite(strain.grad).all()


def test_parameters_per_point_are_as_many_models(model):
    """How several starts of a fit run as one batch."""
    cell = model()
    free = 0.1 * torch.randn(
        len(cell.parameter_table), 3, generator=torch.Generator().manual_seed(0),
        dtype=torch.float64,
    )  # fmt: skip
    for parameter, numbers in zip(cell.parameter_table, free, strict=True):
        cell.free[parameter.name] = torch.nn.Parameter(numbers)
    increments = random_increments(cell, 3, 15, 5e-3)
    together = stress_of(cell, run(cell, increments, isotropic(cell, 3)))
    for point in range(3):
        single = model()
        with torch.no_grad():
            for parameter, numbers in zip(cell.parameter_table, free, strict=True):
                single.free[parameter.name].fill_(numbers[point])
        alone = run(single, increments[:, point : point + 1], isotropic(single, 1))
        torch.testing.assert_close(
            together[:, point], stress_of(single, alone)[:, 0], rtol=1e-10, atol=1e-5
        )
    _, _, tangent = cell.tangent(increments[0], isotropic(cell, 3))
    assert tangent.shape == (3, 3, 3)
    with pytest.raises(ModelError, match="differ from point to point"):
        cell.values()


def test_blocks_of_points_give_what_one_batch_gives(monkeypatch):
    cell = J2Hardening()
    increments = random_increments(cell, 50, 10, 2e-2)
    whole = run(cell, increments, isotropic(cell, 50))
    monkeypatch.setattr(classical, "FEW_POINTS", 3)
    monkeypatch.setattr(classical, "BLOCK", 7)
    blocks = run(cell, increments, isotropic(cell, 50))
    _, state = cell.step(increments[0], isotropic(cell, 50))
    # Newton's iterations end together in a batch: one more for some moves the last bits.
    torch.testing.assert_close(blocks, whole, rtol=1e-12, atol=1e-9)
    assert state.T.is_contiguous()


@pytest.mark.parametrize("order", ["principal", "plane", "full"])
@pytest.mark.filterwarnings("error")
def test_few_points_in_numpy_go_where_many_go_in_torch(model, order, monkeypatch):
    cell = model(order=order)
    increments = random_increments(cell, 20, 12, 2e-3)
    few = run(cell, increments, isotropic(cell, 20))
    monkeypatch.setattr(classical, "FEW_POINTS", 0)
    many = run(cell, increments, isotropic(cell, 20))
    # One text, rounded in another order.
    for one, other in zip(few.unbind(-1), many.unbind(-1), strict=True):
        scale = float(other.abs().max())
        torch.testing.assert_close(one, other, rtol=1e-12, atol=1e-12 * scale)


def test_the_cell_that_makes_records_keeps_to_torch(model, monkeypatch):
    """To the last bit, whatever the number of points."""
    recording = recording_cell(model.name, model().values())
    increments = random_increments(recording, 20, 12, 2e-3)
    records = run(recording, increments, isotropic(recording, 20))
    monkeypatch.setattr(classical, "FEW_POINTS", 0)
    many = run(model(), increments, isotropic(recording, 20))
    assert torch.equal(records, many)


def test_numpy_keeps_single_precision(model):
    cell = model(dtype=torch.float32)
    state = run(cell, random_increments(cell, 5, 3, 5e-4), isotropic(cell, 5))
    assert state.dtype == torch.float32


@pytest.mark.filterwarnings("error")
def test_a_strain_that_is_no_number_is_one_in_silence(model):
    cell = model()
    increment = random_increments(cell, 3, 1, 1e-3)[0]
    increment[1] = torch.nan
    with torch.no_grad():
        stress, _ = cell.step(increment, isotropic(cell, 3))
    assert torch.isnan(stress[1]).all()
    assert torch.isfinite(stress[[0, 2]]).all()


def test_the_memory_order_of_the_increment_does_not_matter():
    cell = IME()
    increment = random_increments(cell, 9, 1, 5e-3)[0]
    state = isotropic(cell, 9)
    stored_by_component = increment.T.contiguous().T
    with torch.no_grad():
        one, other = (cell.step(d, state)[1] for d in (increment, stored_by_component))
        point_major = cell.step(increment, state.contiguous())[1]
    assert torch.equal(one, other)
    assert torch.equal(one, point_major)


def test_a_step_leaves_its_state_unchanged(model):
    cell = model()
    state = isotropic(cell, 4)
    before = state.clone()
    cell.step(random_increments(cell, 4, 1, 5e-3)[0], state)
    assert torch.equal(state, before)


def test_single_precision_stays_single():
    cell = J2(dtype=torch.float32)
    with torch.no_grad():
        stress, state = cell.step(torch.tensor([[0.1, -0.1, 0.0]]).double(), isotropic(cell, 1))
    assert stress.dtype == state.dtype == torch.float32
    # Rounding of float32.
    assert float(stress[0, 0] - stress[0, 1]) == pytest.approx(1e5, rel=1e-6)


def test_a_true_record_replaces_stress_and_internals():
    cell = J2Hardening()
    increments = random_increments(cell, 2, 10, 2e-2)
    states = torch.cat([isotropic(cell, 2)[None], run(cell, increments, isotropic(cell, 2))])
    strain = torch.cat([torch.zeros(1, 2, 3), increments.cumsum(dim=0)]).transpose(0, 1)
    internals = {
        name: states[..., cell.layout[name]].squeeze(-1).T + 0.01 for name in cell.internals
    }
    stress = stress_of(cell, states).transpose(0, 1) + 5.0
    history = History(strain, stress, internals, Conditions(stress[:, 0]))
    with torch.no_grad():
        state = cell.condition(history)
    torch.testing.assert_close(state, states[-1] + torch.tensor([5.0] * 3 + [0.01] * 3).double())


def test_a_rollout_hands_out_the_internals():
    cell = IME()
    strain = torch.cat([torch.zeros(1, 4, 3), random_increments(cell, 4, 6, 2e-3)]).cumsum(dim=0)
    stress = torch.tensor([1e5, 1e5, 0.0]).double().expand(4, 3)
    with torch.no_grad():
        rollout = cell.rollout(strain.transpose(0, 1), Conditions(stress))
    assert set(rollout.internals) == set(cell.internals)
    assert rollout.internals["out_of_plane_stress"].shape == (4, 7)


@pytest.mark.parametrize("plastic", [J2, DruckerPrager])
def test_compiled_and_eager_steps_agree(plastic):
    """Their steps are one graph: no branch depends on a number."""
    cell = plastic()
    increment, state = random_increments(cell, 8, 1, 0.1)[0], isotropic(cell, 8)
    compiled = torch.compile(cell.step, backend="eager", fullgraph=True)
    torch.testing.assert_close(compiled(increment, state)[1], cell.step(increment, state)[1])
