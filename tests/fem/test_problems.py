"""What all boundary-value problems have in common, and what their choices do."""

from dataclasses import fields, replace

import numpy as np
import pytest
from plane_bodies import elastic_cell

from granbench.errors import ConfigurationError
from granbench.fem import (
    PROBLEMS,
    ExplicitSettings,
    ImplicitSettings,
    Problem,
    find_problem,
    run,
)
from granbench.fem.assembled_loading import assemble_loading
from granbench.fem.operators import Operators, build_operators
from granbench.fem.problems import chosen_from_text
from granbench.fem.problems.dog_bone import GAUGE_WIDTH, HEIGHT, WIDTH, width_at
from granbench.fem.problems.perforated_plate import RADIUS, SIDE
from granbench.models import MODELS
from granbench.paths.confining_pressure import RandomConfinement

NAMES = list(PROBLEMS)
DENSITY = ImplicitSettings().density


@pytest.fixture(params=NAMES)
def name(request: pytest.FixtureRequest) -> str:
    return request.param


def variants(name: str) -> list[Problem]:
    """The problem with each of its words and yes-or-no choices in turn."""
    kind = PROBLEMS[name]
    words = [{field: word} for field, known in kind.choices.items() for word in known]
    switches = [{field.name: True} for field in fields(kind) if field.default is False]
    return [find_problem(name, **choice) for choice in ({}, *words, *switches)]


def out_of_balance(
    problem: Problem, operators: Operators, stress: np.ndarray, at_end: bool
) -> float:
    """Largest nodal force that is left over at a free node, relative to the largest force.

    Parameters
    ----------
    stress : (3 point,), Pa
    """
    loading = assemble_loading(problem.loading(operators.mesh), operators, DENSITY)
    time = loading.loading.drive.end if at_end else 0.0
    internal = operators.force @ stress
    left = loading.external_force(loading.force_values(time)) - internal
    # No stress at all is in balance with no load.
    return np.abs(left[loading.free_places]).max() / (np.abs(internal).max() or 1.0)


@pytest.mark.parametrize("model", ["j2", "drucker-prager", "csuh"])
def test_start_is_in_balance(name: str, model: str) -> None:
    """No force is left over at the free nodes: stress, pressures and weight agree."""
    cell = MODELS[model]()
    for variant in variants(name):
        problem = variant.confined_for(cell)
        assert problem.initial_pressure == (0.0 if model == "j2" else 1e5)
        operators = build_operators(problem.mesh("coarse"))
        stress = problem.initial_stress(operators.points, DENSITY).ravel()
        assert out_of_balance(problem, operators, stress, at_end=False) <= 1e-10


def test_end_is_in_balance(name: str) -> None:
    for problem in variants(name):
        problem = replace(problem, end_strain=1e-3, confinement=1e5)
        found = run(problem, MODELS["ime"](), solver=ImplicitSettings(steps=2), mesh="coarse")
        stress = found.check()["stress"].isel(step=-1).transpose("component", "point").values
        operators = build_operators(problem.mesh("coarse"))
        # The tolerance of Newton's iteration, which is relative to forces and reactions.
        assert out_of_balance(problem, operators, stress.ravel(), at_end=True) <= 1e-5


def test_ground_truth_has_no_error_against_itself(name: str) -> None:
    """The same analysis twice gives the same numbers, with either solver."""
    problem = find_problem(name, end_strain=1e-3)
    for solver in (ImplicitSettings(steps=2), ExplicitSettings(outputs=2)):
        once, again = (
            run(problem, MODELS["ime"](), solver=solver, mesh="coarse").check() for _ in range(2)
        )
        clocks = ["cell_seconds", "solver_seconds"]
        assert once.drop_vars(clocks).equals(again.drop_vars(clocks))


def test_every_mesh_has_the_boundaries_of_its_problem_and_the_same_body(name: str) -> None:
    areas = []
    for mesh_name in PROBLEMS[name].meshes:
        mesh = find_problem(name).mesh(mesh_name)
        for problem in variants(name):
            for boundary in problem.loading(mesh).boundaries:
                assert len(mesh.nodes_on(boundary)) > 0
        areas.append(mesh.area)
    assert find_problem(name).default_mesh in PROBLEMS[name].meshes
    # Polygons stand for curved edges.
    assert np.ptp(areas) <= 0.01 * max(areas)


def test_explicit_run_balances_its_energy(name: str) -> None:
    problem = find_problem(name, end_strain=0.01, speed=1.0, cycles="cyclic-8-4")
    found = run(problem, MODELS["j2"](), solver=ExplicitSettings(outputs=10), mesh="coarse").check()
    # Rounding of some thousand steps.
    assert np.abs(found["energy_error"]).max() < 1e-10
    assert float(found["damping_work"][-1]) != 0.0


@pytest.mark.parametrize(
    ("problem", "end"),
    [
        ("retaining-wall", 0.02),
        ("strip-footing", 0.04),
        ("dog-bone", 0.02),
        ("perforated-plate", 0.02),
    ],
)
def test_explicit_and_implicit_agree_in_the_quasi_static_limit(problem: str, end: float) -> None:
    """A fifth of the speed and gamma = 0.1; the biaxial test has its own."""
    chosen = find_problem(problem, end_strain=end, speed=0.02)
    slow = ExplicitSettings(damping=0.1, outputs=20)
    dynamic = run(chosen, MODELS["j2"](), solver=slow, mesh="coarse").check()["reaction"]
    steps = ImplicitSettings(steps=20)
    static = run(chosen, MODELS["j2"](), solver=steps, mesh="coarse").check()["reaction"]
    assert np.abs(dynamic - static).max() < 0.01 * float(static.max())


@pytest.mark.parametrize("model", list(MODELS))
def test_every_classical_model_runs_in_every_problem(name: str, model: str) -> None:
    problem = find_problem(name, end_strain=1e-3)
    steps = ImplicitSettings(steps=2)
    found = run(problem, MODELS[model](), solver=steps, mesh="coarse").check()
    assert abs(float(found["reaction"][-1] - found["reaction"][0])) > 0.0


def test_elastic_body_gives_back_all_work_in_a_cycle(name: str) -> None:
    problem = find_problem(name, end_strain=0.01, cycles="cyclic")
    found = run(problem, elastic_cell(), solver=ImplicitSettings(steps=20), mesh="coarse").check()
    drive, reaction = found["driving_strain"].values, found["reaction"].values
    assert (np.diff(drive) < 0.0).any()
    np.testing.assert_allclose(reaction / reaction[-1], drive / drive[-1], atol=1e-6)


@pytest.mark.parametrize(
    ("problem", "points"), [("biaxial", 484), ("retaining-wall", 272), ("strip-footing", 544)]
)
def test_meshes_of_the_thesis_table_5_2(problem: str, points: int) -> None:
    """It has 484, 271 and 546 Gauss points; odd counts come from triangles."""
    assert build_operators(find_problem(problem).mesh("table-5.2")).point_count == points


def test_meshes_grow_finer(name: str) -> None:
    counts = [
        build_operators(find_problem(name).mesh(mesh)).point_count
        for mesh in ("coarse", "medium", "fine")
    ]
    assert counts == sorted(counts) and counts[2] > 2 * counts[1] > 4 * counts[0]


def test_areas_are_those_of_the_drawings() -> None:
    area = {name: build_operators(find_problem(name).mesh("fine")).volumes.sum() for name in NAMES}
    assert area["biaxial"] == pytest.approx(0.5)
    assert area["retaining-wall"] == pytest.approx(2.5)
    assert area["strip-footing"] == pytest.approx(2.5 * 1.5)
    # A polygon stands for the hole.
    hole = 0.25 * np.pi * RADIUS**2
    assert area["perforated-plate"] == pytest.approx(SIDE**2 - hole, abs=2e-3 * hole)
    y = np.linspace(0.0, HEIGHT, 20001)
    assert area["dog-bone"] == pytest.approx(np.trapezoid(width_at(y), y), rel=2e-3)
    assert (width_at(y).min(), width_at(y).max()) == (GAUGE_WIDTH, WIDTH)


def test_random_confinement_reaches_the_boundary() -> None:
    problem = chosen_from_text(
        "biaxial", ["confinement=random:3:1", "ends=smooth", "end_strain=0.02"]
    )
    assert problem.confinement == RandomConfinement(3.0, 1)
    found = run(problem, elastic_cell(), solver=ImplicitSettings(steps=100), mesh="coarse").check()
    lateral = found["stress"].sel(component="xx")
    x, pressure = RandomConfinement(3.0, 1).pressures()
    expected = np.interp(found["time"] / found["time"][-1], x, pressure)
    np.testing.assert_allclose(
        lateral, np.broadcast_to(expected[:, None], lateral.shape), rtol=1e-6
    )


def test_rough_base_and_wall_carry_no_less() -> None:
    for problem, choice in (("strip-footing", "base"), ("retaining-wall", "wall")):
        rough, smooth = (
            run(find_problem(problem, end_strain=0.01, **{choice: kind}), MODELS["ime"](),
                solver=ImplicitSettings(steps=10), mesh="coarse").check()["reaction"]
            for kind in ("rough", "smooth")
        )  # fmt: skip
        assert (rough[1:] >= smooth[1:]).all()


def test_choices_are_read_from_text() -> None:
    wall = chosen_from_text("retaining-wall", ["weight=yes", "speed=0.2", "wall=rough"])
    assert wall == find_problem("retaining-wall", weight=True, speed=0.2, wall="rough")
    assert chosen_from_text("biaxial", ["confinement=5e4"]).initial_pressure == 5e4
    assert chosen_from_text("biaxial", ["confinement=random"]).confinement == RandomConfinement()
    with pytest.raises(ConfigurationError, match="confinement=random:1:x: the seed"):
        chosen_from_text("biaxial", ["confinement=random:1:x"])
    with pytest.raises(ConfigurationError, match="confinement=randomly"):
        chosen_from_text("biaxial", ["confinement=randomly"])


@pytest.mark.slow
def test_cyclic_footing_with_csuh_stays_finite_and_without_tension() -> None:
    """Some 6000 explicit steps; at the floor of the model grains hardly touch."""
    problem = find_problem("strip-footing", cycles="cyclic")
    found = run(problem, MODELS["csuh"](), mesh="table-5.2").check()
    stress = found["stress"].values
    zz = found["out_of_plane_stress"].values
    assert np.isfinite(stress).all()
    mean = (stress[..., 0] + stress[..., 1] + zz) / 3.0
    assert mean.min() >= 10.0 * (1.0 - 1e-9)
    assert float(np.abs(found["energy_error"]).max()) < 1e-9
