"""Limit loads of the problems against plasticity theory.

The material is perfectly plastic and stiff, so that small displacements reach the limit. The plane
`j2` model has the shear strength k = sigma_Y/2. A load on a mesh is above the exact
one, but for the 2 x 2 points, which integrate a little less than the work.
"""

import numpy as np
import pytest

from granbench.fem import ImplicitSettings, Problem, find_problem, run
from granbench.fem.problems.dog_bone import GAUGE_WIDTH
from granbench.fem.problems.perforated_plate import RADIUS, SIDE
from granbench.fem.problems.retaining_wall import GRAVITY, HEIGHT
from granbench.fem.problems.strip_footing import HALF
from granbench.models import MODELS, ClassicalCell

YOUNG, STRENGTH = 200e6, 1e5
SHEAR_STRENGTH = 0.5 * STRENGTH
PRESSURE = 1e5
STIFF = {"bulk_modulus": YOUNG / 1.6, "shear_modulus": YOUNG / 2.4}

J2 = MODELS["j2"]({**STIFF, "yield_stress": STRENGTH})
DRUCKER_PRAGER = MODELS["drucker-prager"](STIFF)
DENSITY = ImplicitSettings().density


def limit_load(problem: Problem, cell: ClassicalCell, mesh: str, steps: int = 40) -> float:
    """Reaction at the end, N/m, where it has come to rest."""
    reaction = run(problem, cell, solver=ImplicitSettings(steps=steps), mesh=mesh).check()[
        "reaction"
    ]
    assert abs(float(reaction[-1] - reaction[-3])) < 2e-3 * abs(float(reaction[-1]))
    return float(reaction[-1])


def footing(base: str, mesh: str) -> float:
    problem = find_problem("strip-footing", base=base, end_strain=0.012)
    return limit_load(problem, J2, mesh, 25) / HALF / SHEAR_STRENGTH


PRANDTL = 2.0 + np.pi


@pytest.mark.parametrize(
    ("base", "mesh", "error"),
    [
        ("rough", "coarse", 0.12),
        ("smooth", "coarse", 0.05),
        ("rough", "medium", 0.07),
        ("smooth", "medium", 0.03),
        pytest.param("rough", "fine", 0.05, marks=pytest.mark.slow),
        pytest.param("smooth", "fine", 0.02, marks=pytest.mark.slow),
    ],
)
def test_footing_load_converges_to_prandtls(base: str, mesh: str, error: float) -> None:
    """(2 + pi) c on weightless soil, for any base; the error is due to the mesh."""
    assert PRANDTL <= footing(base, mesh) <= (1.0 + error) * PRANDTL


def test_footing_load_increases_by_the_surcharge() -> None:
    problem = find_problem("strip-footing", confinement=PRESSURE, end_strain=0.012)
    found = run(problem, J2, solver=ImplicitSettings(steps=20), mesh="coarse").check()["reaction"]
    assert float(found[0]) == pytest.approx(PRESSURE * HALF)
    without = run(
        find_problem("strip-footing", end_strain=0.012), J2, solver=ImplicitSettings(steps=20),
        mesh="coarse",
    ).check()["reaction"]  # fmt: skip
    # A material that does not feel pressure: the surcharge adds itself.
    np.testing.assert_allclose(found - PRESSURE * HALF, without, rtol=1e-3, atol=1.0)


@pytest.mark.parametrize(
    ("mesh", "error"), [("coarse", 0.015), ("table-5.2", 0.01), ("medium", 0.006)]
)
def test_smooth_wall_has_rankines_cohesive_load(mesh: str, error: float) -> None:
    """P = 2 k H + q0 H."""
    problem = find_problem("retaining-wall", confinement=PRESSURE, end_strain=0.01)
    exact = (2.0 * SHEAR_STRENGTH + PRESSURE) * HEIGHT
    assert limit_load(problem, J2, mesh) == pytest.approx(exact, rel=error)


def test_weight_of_the_soil_adds_to_rankines_load() -> None:
    """P = gamma H^2/2 + 2 k H; at first the wall carries the horizontal stress of the weight."""
    problem = find_problem("retaining-wall", weight=True, end_strain=0.01)
    of_weight = 0.5 * DENSITY * GRAVITY * HEIGHT**2
    found = run(problem, J2, solver=ImplicitSettings(steps=40), mesh="medium").check()["reaction"]
    # The toe's node, and its share of the load, belongs to the base.
    assert float(found[0]) == pytest.approx(of_weight, rel=0.06)
    assert float(found[-1]) == pytest.approx(of_weight + 2.0 * SHEAR_STRENGTH * HEIGHT, rel=0.015)


def passive_coefficient(cell: ClassicalCell) -> float:
    """K_p of q = M p in the plane: sin phi = (s1 - s3)/(s1 + s3) = M/2."""
    sine = 0.5 * cell.values()["friction_slope"]
    return (1.0 + sine) / (1.0 - sine)


def test_frictional_wall_has_rankines_coefficient() -> None:
    """P = K_p q0 H, though the flow is not associated: the stress is Rankine's all over."""
    problem = find_problem("retaining-wall", end_strain=0.02)
    exact = passive_coefficient(DRUCKER_PRAGER) * PRESSURE * HEIGHT
    assert limit_load(problem, DRUCKER_PRAGER, "medium") == pytest.approx(exact, rel=0.01)


@pytest.mark.parametrize(
    ("cell", "ratio"),
    [(J2, STRENGTH / PRESSURE), (DRUCKER_PRAGER, passive_coefficient(DRUCKER_PRAGER) - 1.0)],
    ids=["j2", "drucker-prager"],
)
def test_smooth_biaxial_specimen_has_its_plane_strength(cell: ClassicalCell, ratio: float) -> None:
    problem = find_problem("biaxial", ends="smooth", confinement=PRESSURE, end_strain=0.02)
    strength = limit_load(problem, cell, "coarse", 10) / 0.5 - PRESSURE
    assert strength == pytest.approx(ratio * PRESSURE, rel=1e-6)


@pytest.mark.parametrize(("mesh", "error"), [("coarse", 0.02), ("medium", 0.008)])
def test_perforated_plate_converges_to_the_net_section_load(mesh: str, error: float) -> None:
    exact = 2.0 * SHEAR_STRENGTH * (SIDE - RADIUS)
    found = limit_load(find_problem("perforated-plate", end_strain=0.01), J2, mesh)
    assert exact <= found <= (1.0 + error) * exact


def test_dog_bone_has_the_limit_load_of_its_gauge() -> None:
    found = limit_load(find_problem("dog-bone", end_strain=0.01), J2, "medium")
    assert found == pytest.approx(2.0 * SHEAR_STRENGTH * GAUGE_WIDTH, rel=1e-3)


def test_steps_beyond_the_limit_send_no_node_away() -> None:
    """A nearly singular tangent led to balances with nodes kilometres off, and their forces."""
    problem = find_problem("retaining-wall", end_strain=0.02)
    found = run(problem, DRUCKER_PRAGER, solver=ImplicitSettings(steps=40), mesh="medium").check()
    farthest = np.abs(found["displacement"]).max(dim=("node", "direction"))
    assert (farthest <= 2.0 * found["driving_displacement"] + 1e-12).all()
    assert (np.diff(found["reaction"]) > -1e-4 * float(found["reaction"][-1])).all()
