"""The physics axis: what obeys a law passes, and what breaks one fails that one and no other."""

import json
from collections.abc import Callable

import numpy as np
import pytest
import torch
import xarray as xr
from lawless_cells import (
    SHEAR,
    Coarse,
    Elastic,
    Generous,
    Mortal,
    Numeric,
    Relaxing,
    Restless,
    StiffAlongY,
    StiffInShear,
    WrongTangent,
    cell,
)
from plane_records import plane_records
from small_cells import secant

from granbench.benchmark.axes.physics.checks import (
    CHECKED_PATHS,
    CHECKED_STEPS,
    CHECKS,
    PHYSICS_OBSTACLES,
    checked_paths,
    checked_steps,
)
from granbench.benchmark.axes.physics.energy import cycle_work
from granbench.benchmark.axes.physics.symmetry import asymmetry, exchanges, turn
from granbench.benchmark.axes.physics.tangent import tangent_errors
from granbench.benchmark.comparison import CEILING
from granbench.benchmark.evaluation import predict
from granbench.benchmark.predictions import evaluated
from granbench.benchmark.scorecard import Scorecard
from granbench.benchmark.scoring import score
from granbench.cells.contract import Conditions, MaterialCell, ModuleCell, StateLayout
from granbench.cells.find import find_cells
from granbench.data.normalisation import Normalisation
from granbench.generators.classical.design import DATASETS
from granbench.models import find_model


def physics_card(model: MaterialCell, records: xr.Dataset) -> Scorecard:
    scored = evaluated(records)
    predictions = predict({0: model}, scored, ["physics"])
    return score(predictions, scored, Normalisation.from_training(records))


def values(card: Scorecard, metric: str, split: str = "test") -> dict[str, float | None]:
    return {name: card.find(name, split, metric).value for name in CHECKS}


def violated(model: MaterialCell, records: xr.Dataset) -> set[str]:
    """Checks that some path of some split fails."""
    card = physics_card(model, records)
    return {
        item.protocol
        for item in card.scores
        if item.axis == "physics" and item.metric == "violated_share" and item.value
    }


def applicable(card: Scorecard) -> set[str]:
    return {name for name in CHECKS if values(card, "violation_worst")[name] is not None}


QUICK = [name for name in DATASETS if name != "gp-csuh"]


@pytest.mark.parametrize("name", [*QUICK, pytest.param("gp-csuh", marks=pytest.mark.slow)])
def test_classical_models_pass_every_check_on_their_own_task(name: str) -> None:
    records = plane_records(name)
    model = find_model(DATASETS[name].model)()
    card = physics_card(model, records)
    passed = applicable(card)
    assert passed == set(CHECKS) - (set() if model.pressure_dependent else {"compression"})
    splits = {item.split for item in card.scores} - {"all"}
    for split in splits:
        beyond = values(card, "violated_share", split)
        assert {check: beyond[check] for check in passed} == dict.fromkeys(passed, 0.0)
        worst = values(card, "violation_worst", split)
        # In double precision: a zero increment changes no bit, a cycle loses nothing but rounding.
        assert worst["zero-increment"] == 0.0
        assert max(worst["rotation"], worst["swap"]) < 1e-10
        assert worst["dissipation"] < 1e-12
        assert worst["tangent"] < 1e-6


def test_classical_models_pass_on_a_task_that_is_not_theirs() -> None:
    """Laws do not depend on how well a model fits: states are those that it reaches itself."""
    assert violated(find_model("j2")(), plane_records("gp-dp")) <= {"compression"}
    assert violated(find_model("j2-hardening")(), plane_records("gp-ime")) == set()


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_ten_lines_of_linear_elasticity_pass(dtype: torch.dtype) -> None:
    assert violated(cell(Elastic(), dtype), plane_records()) == set()


def test_floors_pass() -> None:
    records = plane_records()
    for floor in ("persistence", "linear-elastic"):
        assert violated(find_cells(floor, records).cell, records) == set()


LAWLESS: dict[str, tuple[Callable[[], MaterialCell], set[str]]] = {
    "not objective": (lambda: cell(StiffInShear()), {"rotation"}),
    "another axis": (lambda: cell(StiffAlongY()), {"rotation", "swap"}),
    "wrong tangent": (WrongTangent, {"tangent"}),
    "makes energy": (lambda: cell(Generous()), {"dissipation"}),
    "creeps at rest": (lambda: cell(Restless()), {"zero-increment"}),
    "depends on the size of steps": (lambda: cell(Coarse()), {"substeps-10", "substeps-100"}),
}


@pytest.mark.parametrize("case", LAWLESS)
def test_who_breaks_a_law_fails_that_check_and_no_other(case: str) -> None:
    make, expected = LAWLESS[case]
    assert violated(make(), plane_records()) == expected


def test_who_relaxes_with_every_call_also_depends_on_the_number_of_calls() -> None:
    found = violated(cell(Relaxing()), plane_records())
    assert {"zero-increment", "substeps-10", "substeps-100"} <= found
    assert not found & {"tangent", "rotation", "swap"}


def test_elasticity_carries_tension_where_sand_would_not() -> None:
    records = plane_records("gp-dp")
    assert violated(cell(Elastic()), records) == {"compression"}
    card = physics_card(cell(Elastic()), plane_records("gp-j2"))
    score_of_j2 = card.find("compression", "test", "violation_worst")
    assert score_of_j2.status == "not_applicable" and "tension" in score_of_j2.reason


def test_without_the_stress_out_of_the_plane_there_is_no_mean_stress() -> None:
    records = plane_records("gp-dp")
    records["out_of_plane_stress"] = records["stress"].isel(component=0, drop=True)
    found = json.loads(
        predict({0: cell(Elastic())}, evaluated(records), ["physics"]).attrs[PHYSICS_OBSTACLES]
    )
    assert list(found) == ["compression"] and "out of the plane" in found["compression"]


@pytest.mark.parametrize("raises", [False, True])
def test_a_breakdown_is_the_worst_violation(raises: bool) -> None:
    records = plane_records("gp-dp")
    card = physics_card(Mortal(raises), records)
    broken = {name for name, value in values(card, "violation_worst").items() if value == CEILING}
    assert broken == set(CHECKS)
    assert card.find("rotation", "test", "violated_share").value == 1.0


def test_a_broken_tangent_is_not_excused_as_a_kink() -> None:
    class NoTangent(WrongTangent):
        def tangent(self, dstrain, state):
            stress, after, tangent = super().tangent(dstrain, state)
            return stress, after, tangent * torch.nan

    card = physics_card(NoTangent(), plane_records())
    assert card.find("tangent", "test", "violation_mean").value == CEILING


def test_a_cell_outside_torch_has_no_tangent_and_says_so() -> None:
    card = physics_card(Numeric(), plane_records())
    tangent = card.find("tangent", "test", "violation_worst")
    assert tangent.status == "not_applicable"
    assert "by differences" in tangent.reason
    assert applicable(card) == set(CHECKS) - {"tangent", "compression"}


def test_principal_records_can_be_exchanged_but_not_turned(records: xr.Dataset) -> None:
    card = physics_card(secant(), records)
    assert applicable(card) == set(CHECKS) - {"rotation"}
    assert "principal" in card.find("rotation", "test", "violation_worst").reason
    assert violated(secant(), records) == set()

    class Laid(torch.nn.Module):
        """Stiffer along the third axis."""

        def forward(self, dstrain, stress):
            return stress + 2e6 * dstrain * torch.tensor([1.0, 1.0, 1.2])

    assert violated(ModuleCell(Laid(), name="laid"), records) - {"compression"} == {"swap"}


def test_the_axis_needs_neither_other_axes_nor_several_evaluations() -> None:
    predictions = predict({0: cell(Elastic()), 4: cell(Elastic())}, evaluated(plane_records()),
                          ["physics"])  # fmt: skip
    assert "stress" not in predictions and "protocol" not in predictions.dims
    first, second = (predictions["stress_change"].isel(seed=i).values for i in (0, 1))
    np.testing.assert_array_equal(first, second)


def test_every_model_is_checked_on_the_same_paths() -> None:
    scored = evaluated(plane_records())
    rows = checked_paths(scored)
    names = list(scored["path_id"].values[rows])
    splits, counts = np.unique(scored["split"].values[rows].astype(str), return_counts=True)
    assert set(splits) == set(scored["split"].values.astype(str))
    assert counts.max() <= CHECKED_PATHS
    shuffled = scored.isel(path=np.random.default_rng(0).permutation(scored.sizes["path"]))
    assert set(shuffled["path_id"].values[checked_paths(shuffled)]) == set(names)
    many = xr.concat([scored.assign_coords(path_id=("path", [f"{i}/{n}" for n in
                      scored["path_id"].values])) for i in range(9)], dim="path")  # fmt: skip
    _, counts = np.unique(many["split"].values[checked_paths(many)].astype(str),
                          return_counts=True)  # fmt: skip
    assert (counts == CHECKED_PATHS).all()


def test_checked_steps_are_of_the_path_and_have_a_step_before_them() -> None:
    for name in ("test/0000", "test/0001"):
        steps = checked_steps(name, 201)
        assert len(steps) == len(set(steps)) == CHECKED_STEPS
        assert steps.min() >= 1 and steps.max() <= 200
        assert list(checked_steps(name, 201)) == list(steps)
    assert list(checked_steps("test/0000", 4)) == [1, 2, 3]
    assert list(checked_steps("test/0000", 201)) != list(checked_steps("test/0001", 201))


class Corner(torch.nn.Module):
    """Stiffer from an increment of 1e-3 of the first component on."""

    def forward(self, dstrain, stress):
        return stress + elastic_and_corner(dstrain)


def elastic_and_corner(dstrain):
    return 2.0 * SHEAR * (dstrain + torch.relu(dstrain - 1e-3))


def test_a_kink_is_left_out_and_what_lies_beside_it_is_not() -> None:
    dstrain = torch.zeros(4, 3, dtype=torch.float64)
    # At the kink; nearer to it than all widths but the narrowest; on either side.
    dstrain[:, 0] = torch.tensor([1e-3, 1e-3 + 5e-7, 5e-4, 2e-3])
    found = tangent_errors(cell(Corner()), dstrain, torch.zeros_like(dstrain), SHEAR)
    assert found.kink.tolist() == [True, False, False, False]
    # Rounding of a difference of width 1e-7, some 1e-9; at the right width less.
    assert (found.error[1:] < 1e-8).all()
    assert torch.isinf(found.error[0])


def test_a_tangent_that_is_small_beside_the_rounding_of_the_stress_is_not_wrong() -> None:
    """1e7 Pa in single precision is known to 1 Pa: differences of it say nothing of 1 MPa."""

    class Soft(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.base = torch.nn.Parameter(torch.tensor(1e7))

        def forward(self, dstrain, stress):
            return self.base + 1e6 * torch.tanh(dstrain)

    dstrain = 1e-3 * torch.ones(5, 3, dtype=torch.float64)
    found = tangent_errors(cell(Soft(), torch.float32), dstrain, torch.zeros_like(dstrain), SHEAR)
    assert found.error.max() < 1e-6


def test_a_cell_that_cannot_be_copied_into_double_precision_is_checked_as_it_is() -> None:
    class Loose(MaterialCell):
        name, order, dtype, layout = "loose", "plane", torch.float32, StateLayout.of(stress=3)
        stiffness = torch.tensor([[2e6, 0.0, 0.0], [0.0, 2e6, 0.0], [0.0, 0.0, 2e6]])

        def initial_state(self, conditions):
            return conditions.stress

        def step(self, dstrain, state):
            stress = state + dstrain @ self.stiffness  # refuses doubles
            return stress, stress

    dstrain = 1e-3 * torch.ones(5, 3, dtype=torch.float64)
    found = tangent_errors(Loose(), dstrain, torch.zeros_like(dstrain), SHEAR)
    # Some roundings of 2e3 Pa over 2e-4.
    assert found.error.max() < 1e-5 and not found.kink.any()


def test_checking_leaves_a_cell_in_its_own_precision() -> None:
    single = cell(Elastic(), torch.float32)
    physics_card(single, plane_records())
    assert single.dtype == torch.float32


def test_tangents_of_a_network_agree_with_differences() -> None:
    torch.manual_seed(0)
    network = torch.nn.Sequential(torch.nn.Linear(3, 20), torch.nn.Tanh(), torch.nn.Linear(20, 3))

    class Smooth(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.network = network

        def forward(self, dstrain, stress):
            return stress + 1e4 * self.network(300.0 * dstrain)

    dstrain = 1e-3 * torch.randn(200, 3, dtype=torch.float64)
    found = tangent_errors(cell(Smooth(), torch.float32), dstrain, torch.zeros_like(dstrain), SHEAR)
    assert not found.kink.any()
    assert found.error.max() < CHECKS["tangent"].tolerance


def test_a_response_of_rounding_has_no_wrong_tangent() -> None:
    """Where nothing changes, the difference of two roundings is no stiffness."""

    class Still(torch.nn.Module):
        def forward(self, dstrain, stress):
            return stress + 1e-9 * torch.sin(1e9 * dstrain)

    dstrain = 1e-3 * torch.ones(5, 3, dtype=torch.float64)
    still = cell(Still())
    still.tangent = lambda dstrain, state: (state, state, torch.zeros(len(state), 3, 3))
    found = tangent_errors(still, dstrain, torch.zeros_like(dstrain), SHEAR)
    assert (found.error[~found.kink] < CHECKS["tangent"].tolerance).all()
    assert not found.kink.all()


def start(paths: int = 2) -> Conditions:
    return Conditions(torch.zeros(paths, 3, dtype=torch.float64))


def straight(paths: int = 2, steps: int = 101) -> torch.Tensor:
    """Paths straight out to a strain of 1 % in xx and xy."""
    way = torch.linspace(0.0, 1e-2, steps, dtype=torch.float64)[None, :, None]
    return way * torch.tensor([1.0, 0.0, 0.5]) * torch.ones(paths, 1, 1)


def test_elastic_cycles_dissipate_nothing_and_friction_its_work() -> None:
    assert (cycle_work(cell(Elastic()), straight(), start()).abs() < 1e-12).all()

    class Friction(torch.nn.Module):
        """Always 1 kPa against the increment, in xx and xy."""

        def forward(self, dstrain, stress):
            return 1e3 * torch.sign(dstrain)

    # sigma_xx d eps_xx and twice sigma_xy d eps_xy; one step at each of the two turning points,
    # of 200 steps, has a mean stress of zero.
    expected = 1e3 * 2e-2 * (1.0 + 2.0 * 0.5) * (1.0 - 2.0 / 200.0)
    assert cycle_work(cell(Friction()), straight(), start()).tolist() == pytest.approx(
        [expected, expected], rel=1e-12
    )


def test_stored_energy_may_be_given_back_once() -> None:
    """A spring that lets its prestress go in the first cycle gives nothing in the second."""

    class Slackening(torch.nn.Module):
        def forward(self, dstrain, stress):
            return torch.where(dstrain[:, :1] < 0.0, stress.clamp(max=0.0), stress)

    prestressed = Conditions(torch.full((2, 3), 1e5, dtype=torch.float64))
    assert (cycle_work(cell(Slackening()), straight(), prestressed) == 0.0).all()


def test_tensors_among_the_conditions_are_turned_with_the_path() -> None:
    class Backed(torch.nn.Module):
        """Moves towards a stress that it is given at the start, as kinematic hardening does."""

        def forward(self, dstrain, state):
            length = dstrain[:, :2].sum(dim=1, keepdim=True).abs()
            stress = state[:, :3] + length * state[:, 3:]
            return stress, torch.cat([stress, state[:, 3:]], dim=1)

    layout = StateLayout.of(stress=3, back_xx=1, back_yy=1, back_xy=1)
    backed = ModuleCell(Backed(), name="backed", order="plane", layout=layout, dtype=torch.float64)
    parts = {"back_xx": 2e5, "back_yy": -1e5, "back_xy": 3e5, "d50": 1.0}
    scalars = {name: torch.full((2,), part, dtype=torch.float64) for name, part in parts.items()}
    conditions = Conditions(torch.zeros(2, 3, dtype=torch.float64), scalars)
    stress = backed.rollout(straight(), conditions).stress
    for rotations in ([turn("plane")], exchanges("plane")):
        found = asymmetry(backed, straight(), conditions, stress, rotations)
        assert (found < 1e-9).all()  # rounding of some 1e4 Pa
    without = Conditions(conditions.stress, {name: scalars[name] for name in ("back_xx", "d50")})
    assert asymmetry(backed, straight(), without, stress, exchanges("plane")).max() > 1e2


def test_a_turn_in_space_keeps_every_invariant() -> None:
    rotation = turn("full")
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=1e-14)
    assert np.trace(rotation) == pytest.approx(1.0 + 2.0 * np.cos(np.pi / 6.0), abs=1e-14)
    j2 = find_model("j2")(order="full")
    strain = torch.randn(3, 30, 6, generator=torch.Generator().manual_seed(1)).double().cumsum(1)
    strain = 1e-3 * (strain - strain[:, :1])
    given = Conditions(torch.zeros(3, 6, dtype=torch.float64))
    with torch.no_grad():
        stress = j2.rollout(strain, given).stress
        assert asymmetry(j2, strain, given, stress, [rotation]).max() < 1e-8  # of some 1e5 Pa
        assert asymmetry(j2, strain, given, stress, exchanges("full")).max() < 1e-8
