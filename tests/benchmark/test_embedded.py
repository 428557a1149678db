"""A model in place of the ground truth: what is exact, what is known, and what breaks."""

import json

import numpy as np
import pytest
import torch
import xarray as xr
from embedded_tasks import (
    OUTPUTS,
    ROUGH,
    SMOOTH,
    Elastic,
    Untraceable,
    analysis,
    cell,
    embedding_records,
    task_of,
)

from granbench.benchmark.axes.embedded import predict as module
from granbench.benchmark.axes.embedded.axis import AXIS, EMBEDDED_FAILURES, EMBEDDED_OBSTACLE
from granbench.benchmark.evaluation import predict
from granbench.benchmark.predictions import evaluated
from granbench.benchmark.scorecard import Scorecard
from granbench.benchmark.scored_task import ScoredTask
from granbench.benchmark.scoring import score
from granbench.cells.contract import Conditions, MaterialCell
from granbench.cells.find import find_cells
from granbench.data.normalisation import Normalisation
from granbench.errors import ConfigurationError, ModelError
from granbench.fem.statement import EMBEDDED_ANALYSES, SOLVERS
from granbench.models import find_model
from granbench.models.j2 import J2


def made(model: MaterialCell, records: xr.Dataset, seeds: tuple[int, ...] = (0,)) -> xr.Dataset:
    cells = dict.fromkeys(seeds, model)
    return predict(cells, evaluated(records), ["embedded"], task=task_of(records))


def card(predictions: xr.Dataset, records: xr.Dataset) -> Scorecard:
    normalisation = Normalisation.from_training(records)
    return score(predictions, evaluated(records), normalisation, task_of(records))


def values(found: Scorecard, solver: str, group: str = "all") -> dict[str, float | None]:
    return {
        metric.name: found.find(part.name, "all", metric.name, group).value
        for part in AXIS.parts
        if part.name == f"embedded-{solver}"
        for metric in AXIS.metrics()
        if metric.applies_to(part)
    }


@pytest.fixture(scope="module")
def soft() -> tuple[xr.Dataset, xr.Dataset]:
    """An elastic truth, and a cell with four fifths of its stiffness."""
    records = embedding_records()
    return made(cell(Elastic(0.8)), records), records


@pytest.mark.parametrize(
    ("name", "confinement", "outputs"), [("j2", 0.0, 4), ("ime", 5e4, 4), ("csuh", 1e5, 2)]
)
def test_the_ground_truth_scores_exactly_zero(name: str, confinement: float, outputs: int) -> None:
    truth = find_model(name)()
    rough = analysis(
        "rough", modulus=2.5e7, outputs=outputs, points=40,
        choices={"ends": "rough", "confinement": confinement, "end_strain": 0.004 * outputs,
                 "speed": 1.0},
    )  # fmt: skip
    records = embedding_records(truth, (rough,))
    found = card(made(find_model(name)(), records), records)
    for solver in SOLVERS:
        of_solver = values(found, solver)
        for metric in AXIS.metrics():
            if metric.of_truth == 0.0:
                assert of_solver[metric.name] == 0.0, (solver, metric.name)
        assert of_solver["reached_share"] == 1.0
    assert values(found, "explicit")["acceleration_ratio"] == 1.0
    assert all(not any(curve.value) for curve in found.curves)
    assert not found.perfect  # zero inside an analysis is no sign of a ceiling


def test_reaction_of_a_softer_body_is_that_of_linear_elasticity(soft) -> None:
    """Displacements are prescribed, so all forces scale with the stiffness and no strain does."""
    predictions, records = soft
    found = values(card(predictions, records), "implicit")
    assert found["reaction_error"] == pytest.approx(0.2, abs=1e-4)  # kept with 15 bits
    assert found["volumetric_strain_error"] == pytest.approx(0.0, abs=1e-4)
    true = predictions["embedded_truth_stress"].sel(solver="implicit").isel(output=slice(1, None))
    scale = xr.DataArray(Normalisation.from_training(records).std["stress"], dims="component")
    assert found["point_stress_mse"] == pytest.approx(
        0.04 * float(((true / scale) ** 2).mean()), rel=1e-3
    )
    assert found["error_point_share"] == 0.0  # 20 % is below 50


def test_the_explicit_error_at_low_speed_is_due_to_inertia(soft) -> None:
    """The drive starts at once, so inertia is a share of the reaction."""
    found = values(card(*soft), "explicit", "smooth")
    assert found["reaction_error"] == pytest.approx(0.2, abs=0.05)
    assert found["reached_share"] == 1.0


def test_the_reaction_of_the_truth_is_that_of_plane_elasticity(soft) -> None:
    """Smooth ends, free sides: R = E eps b with E = 4KG/(K+G) in two dimensions, b = 0.5 m."""
    predictions, _ = soft
    elastic = J2().values()
    k, g = elastic["bulk_modulus"], elastic["shear_modulus"]
    reaction = predictions["embedded_truth_reaction"].sel(solver="implicit", analysis="smooth")
    expected = 4.0 * k * g / (k + g) * np.linspace(0.0, 2e-3, OUTPUTS + 1) * 0.5
    np.testing.assert_allclose(reaction.values, expected, rtol=1e-4)


def test_the_time_of_an_analysis_is_that_of_its_fastest_run(monkeypatch) -> None:
    runs, original = [], module.run

    def counted(*args, **settings):
        runs.append(args[0].name)
        return original(*args, **settings)

    monkeypatch.setattr(module, "run", counted)
    records = embedding_records(analyses=(SMOOTH,))
    found = module.embedded(cell(Elastic(0.8)), ScoredTask(records, (SMOOTH,)))
    # Two to warm up, then three each: these take a fraction of a second.
    assert len(runs) == 2 + len(SOLVERS) * 3
    assert (found["embedded_cell_seconds"] < found["embedded_seconds"]).all()


def test_error_points_are_those_off_by_more_than_half() -> None:
    records = embedding_records()
    shares = [
        values(card(made(cell(Elastic(share)), records), records), "implicit")["error_point_share"]
        for share in (0.51, 0.49)
    ]
    assert shares == [0.0, 1.0]


def test_a_cell_that_breaks_keeps_what_it_reached_and_the_other_analyses() -> None:
    """At 5.5 eighths of the loading; the other analysis goes to a quarter only."""
    records = embedding_records()
    predictions = made(cell(Elastic(limit=5.5 / OUTPUTS * 2e-3)), records)
    found = card(predictions, records)
    for solver in SOLVERS:
        assert values(found, solver, "smooth")["reached_share"] == 5.0 / OUTPUTS
        assert values(found, solver, "rough")["reached_share"] == 1.0
        assert values(found, solver)["reached_share"] == 0.5 * (5.0 / OUTPUTS + 1.0)
        # Three of eight steps count ten times the true curve's root mean square.
        error = values(found, solver, "smooth")["reaction_error"]
        assert error == pytest.approx(np.sqrt(3.0 / OUTPUTS * 100.0), rel=2e-3)
        assert values(found, solver, "smooth")["error_point_share"] == 3.0 / OUTPUTS
        assert values(found, solver, "smooth")["error_point_growth"] > 0.0
        timed = found.find(f"embedded-{solver}", "all", "analysis_speed_ratio", "smooth")
        assert timed.status == "not_applicable" and "ended early" in timed.reason
    # A run that fails counts as the largest ratio; the mean of ratios is geometric.
    failed, other, mean = (
        values(found, "explicit", group)["acceleration_ratio"]
        for group in ("smooth", "rough", "all")
    )
    assert failed == 1000.0
    assert mean == pytest.approx(np.sqrt(failed * other), rel=1e-6)
    reasons = json.loads(predictions.attrs[EMBEDDED_FAILURES])
    assert set(reasons) == {"0/explicit/smooth", "0/implicit/smooth"}
    assert "gives no finite stress at Gauss point" in reasons["0/explicit/smooth"]


@pytest.mark.parametrize(
    ("model", "tolerance"),
    [
        (cell(Elastic(), torch.float32), 1e-4),
        (cell(Untraceable()), 1e-4),
    ],
    ids=["single precision", "no tangent"],
)
def test_networks_and_cells_without_a_tangent_work_in_both_solvers(model, tolerance) -> None:
    records = embedding_records()
    found = card(made(model, records), records)
    for solver in SOLVERS:
        assert values(found, solver)["reached_share"] == 1.0
        assert values(found, solver)["reaction_error"] < tolerance


def test_a_model_is_given_the_same_start_as_along_a_record() -> None:
    """At every start that there is, that which only warms up included."""
    known: set[float] = set()

    def start(conditions: Conditions) -> torch.Tensor:
        void_ratio = conditions.require("initial_void_ratio")
        known.update(void_ratio.tolist())
        return torch.cat([conditions.stress, torch.zeros_like(conditions.stress)], dim=1)

    truth = find_model("csuh")()
    pressed = analysis("pressed", outputs=1, solvers=("explicit",), modulus=2e7,
                       choices={"confinement": 1e5, "speed": 1.0})  # fmt: skip
    model = cell(Elastic(8.0))
    model._start = start
    made(model, embedding_records(truth, (pressed,)))
    state = truth.initial_state(Conditions(torch.tensor([[1e5, 1e5, 0.0]], dtype=torch.float64)))
    assert known == {float(state.detach()[0, truth.layout["void_ratio"]])}


def test_a_floor_without_stiffness_says_why_it_fails() -> None:
    """Persistence takes no additional load: no load step of the implicit solver balances."""
    records = embedding_records(J2(), (analysis("pressed", choices={"confinement": {
        "curvature": 1.0, "seed": 0, "mean": 1e5, "deviation": 2e4}}),))  # fmt: skip
    predictions = made(find_cells("persistence", records).cell, records)
    found = card(predictions, records)
    assert values(found, "explicit")["reached_share"] == 1.0
    assert values(found, "implicit")["reached_share"] == 0.0
    reasons = json.loads(predictions.attrs[EMBEDDED_FAILURES])
    assert "does not converge" in reasons["0/implicit/pressed"]


def test_an_analysis_that_converges_too_seldom_is_given_up(monkeypatch) -> None:
    monkeypatch.setattr(module, "UPDATES", 0)
    predictions = made(J2(), embedding_records(J2(), (SMOOTH,)))
    (reason,) = json.loads(predictions.attrs[EMBEDDED_FAILURES]).values()
    assert "given up after 0 updates" in reason


def test_a_score_that_does_not_apply_has_a_reason() -> None:
    records = embedding_records()
    oracle = find_cells("oracle", records).cell
    predictions = made(oracle, records)
    assert "reads its answers" in predictions.attrs[EMBEDDED_OBSTACLE]
    found = [s for s in card(predictions, records).scores if s.axis == "embedded"]
    assert {s.status for s in found} == {"not_applicable"}
    left_out = predict({0: oracle}, evaluated(records), ["rollout"])
    found = [s for s in card(left_out, records).scores if s.axis == "embedded"]
    assert {s.status for s in found} == {"not_run"}


def test_a_task_without_analyses_has_what_it_always_had() -> None:
    """Whatever the attribute of the file says: the analyses are those of the task."""
    records = embedding_records()
    assert EMBEDDED_ANALYSES in records.attrs
    predictions = predict({0: J2()}, evaluated(records), ["embedded"])
    assert "no boundary-value problem" in predictions.attrs[EMBEDDED_OBSTACLE]
    alone = score(predictions, evaluated(records), Normalisation.from_training(records))
    (found,) = [s for s in alone.scores if s.axis == "embedded"]
    assert found.key == ("embedded", "embedded", "test", "all", "all")
    assert found.reason == "this task has no boundary-value problem with a ground-truth cell"


def test_both_solvers_have_the_stated_steps() -> None:
    """Turning points that no load step ends at would make other steps."""
    cycles = analysis("cycles", outputs=2, choices={"cycles": "cyclic-8-4"})
    with pytest.raises(ConfigurationError, match="choose a number that its turning points divide"):
        made(cell(Elastic()), embedding_records(analyses=(cycles,)))


def test_user_code_that_raises_is_named() -> None:
    class Broken(Elastic):
        def forward(self, dstrain, state):
            raise KeyError("fabric")

    with pytest.raises(
        ModelError, match=r"failed with KeyError \(.fabric.\) at test_embedded.py line"
    ):
        made(cell(Broken()), embedding_records(analyses=(ROUGH,)))
