"""The biaxial test against element tests, closed forms, and one solver against the other."""

import numpy as np
import pytest
from plane_bodies import elastic_cell

from granbench.cells.contract import Conditions, MaterialCell
from granbench.element_test.run import run_test
from granbench.errors import ConfigurationError
from granbench.fem import ExplicitSettings, ImplicitSettings, find_problem, rectangle, run
from granbench.fem.operators import build_operators
from granbench.fem.problems.biaxial import WIDTH, Biaxial
from granbench.models import MODELS
from granbench.paths.mixed_control import MixedControl

P0 = 1e5


def element_test(cell: MaterialCell, steps: int, axial_strain: float) -> np.ndarray:
    """Stress (step, component) at a constant lateral stress."""
    import torch

    strain = np.zeros((steps + 1, 3))
    strain[:, 1] = np.linspace(0.0, axial_strain, steps + 1)
    stress = np.tile([P0, 0.0, 0.0], (steps + 1, 1))
    control = MixedControl.of_components("plane", ["xx"], strain, stress)
    start = Conditions(
        torch.tensor([[P0, P0, 0.0]], dtype=torch.float64),
        {"initial_mean_stress": torch.tensor([P0], dtype=torch.float64)},
    )
    return run_test(cell, control, start, tolerance=1e-13).stress[0]


@pytest.mark.parametrize("name", ["j2", "drucker-prager", "ime", "csuh", "j2-hardening"])
def test_smooth_specimen_is_an_element_test(name: str) -> None:
    cell = MODELS[name]()
    settings = ImplicitSettings(steps=20, tolerance=1e-13)
    end = 0.02 if name == "csuh" else 0.1  # its large steps take many substeps
    problem = Biaxial(ends="smooth", end_strain=end, confinement=P0)
    found = run(problem, cell, solver=settings, mesh="coarse").check()
    expected = element_test(cell, 20, end)
    for point in range(found.sizes["point"]):
        np.testing.assert_allclose(
            found["stress"].values[:, point], expected, rtol=1e-9, atol=1e-9 * expected.max()
        )
    np.testing.assert_allclose(found["reaction"], WIDTH * expected[:, 1], rtol=1e-9)


def test_strength_of_a_von_mises_material_in_plane_strain() -> None:
    """sigma_1 - sigma_3 = 2 sigma_Y/sqrt(3), without hardening, whatever the confinement."""
    flat = {"hardening_modulus": 1e-3, "yield_stress": 2e5}
    problem = Biaxial(ends="smooth", end_strain=0.1, confinement=P0)
    found = run(problem, MODELS["ime"](flat), solver="implicit", mesh="coarse").check()
    difference = float(found["reaction"][-1]) / WIDTH - P0
    # The stress zz tends to the mean of the others as elastic strain dies out.
    assert difference == pytest.approx(2e5 * 2.0 / np.sqrt(3.0), rel=2e-4)


@pytest.mark.parametrize("solver", [ExplicitSettings(damping=0.1), ImplicitSettings()])
def test_first_yield_in_plane_strain(solver: ExplicitSettings | ImplicitSettings) -> None:
    """From an isotropic state at sigma_Y/sqrt(1 - nu + nu^2)."""
    flat = {"hardening_modulus": 1e-3, "yield_stress": 2e5}
    cell = MODELS["ime"](flat)
    nu, strength = 0.2, 2e5 / np.sqrt(1 - 0.2 + 0.2**2)
    modulus = 20e6 / (1 - nu**2)
    problem = Biaxial(ends="smooth", end_strain=1.5 * strength / modulus, confinement=P0)
    found = run(problem, cell, solver=solver, mesh="coarse").check()
    difference = found["reaction"].values / WIDTH - P0
    elastic = difference < 0.99 * strength
    # Explicit: drag of expanding sideways and waves of the start, some 1e-3 of the strength.
    np.testing.assert_allclose(
        difference[elastic], modulus * found["driving_strain"].values[elastic], rtol=5e-3, atol=300
    )
    beyond = modulus * found["driving_strain"].values > 1.05 * strength
    assert (difference[beyond] < 0.999 * modulus * found["driving_strain"].values[beyond]).all()


@pytest.mark.parametrize(
    ("damping", "plateau"), [(0.1, 50.15e3), (1.0, 51.2e3)], ids=["gamma 0.1", "gamma 1"]
)
def test_plateau_of_rough_j2_specimen(damping: float, plateau: float) -> None:
    """8 x 15 elements at 0.1 m/s: a trial with another program gave these."""
    found = run(
        Biaxial(confinement=0.0),
        MODELS["j2"](),
        solver=ExplicitSettings(damping=damping),
        mesh=rectangle(0.5, 1.0, 8, 15),
    ).check()
    assert found.sizes["point"] == 480
    # The trial's figures have three or four digits.
    assert float(found["reaction"][-1]) == pytest.approx(plateau, rel=1.5e-3)


@pytest.mark.parametrize(
    ("name", "confinement", "speed", "damping"),
    [
        ("j2", 0.0, 0.01, 1.0),
        ("drucker-prager", P0, 0.01, 0.3),
        ("ime", P0, 0.1, 0.1),
        ("csuh", P0, 0.1, 0.1),
    ],
)
def test_explicit_and_implicit_agree_in_the_quasi_static_limit(
    name: str, confinement: float, speed: float, damping: float
) -> None:
    end = 0.02 if name == "csuh" else 0.06
    problem = Biaxial(confinement=confinement, end_strain=end, speed=speed)
    dynamic = ExplicitSettings(damping=damping, outputs=50)
    slow = run(problem, MODELS[name](), solver=dynamic, mesh="coarse").check()
    static = run(problem, MODELS[name](), solver=ImplicitSettings(steps=50), mesh="coarse").check()
    np.testing.assert_allclose(slow["driving_strain"], static["driving_strain"], atol=1e-12)
    difference = np.abs(slow["reaction"] - static["reaction"]).max()
    assert difference < 0.01 * static["reaction"].max()


def test_rough_ends_are_stronger_than_smooth_ones() -> None:
    cell = MODELS["drucker-prager"]()
    reactions = [
        run(Biaxial(ends=ends), cell, solver="implicit", mesh="coarse").check()["reaction"].max()
        for ends in ("rough", "smooth")
    ]
    assert reactions[0] > reactions[1]


def test_finer_meshes_are_softer() -> None:
    """Rough ends on an elastic specimen: displacement elements come down to the stiffness."""
    stiffness = [
        float(
            run(Biaxial(confinement=0.0), elastic_cell(), solver=ONE, mesh=mesh)
            .check()["reaction"]
            .isel(step=-1)
        )
        for mesh in ("coarse", "medium", "fine")
    ]
    # 2 x 2 points integrate less than the stiffness: the bound from above is not strict.
    assert abs(stiffness[2] - stiffness[1]) < abs(stiffness[1] - stiffness[0])
    assert stiffness[2] == pytest.approx(stiffness[1], rel=2e-3)


ONE = ImplicitSettings(steps=1)


@pytest.mark.parametrize(
    ("mesh", "points"), [("coarse", 32), ("medium", 128), ("fine", 512), ("table-5.2", 484)]
)
def test_meshes_have_the_thesis_gauss_points(mesh: str, points: int) -> None:
    assert build_operators(Biaxial().mesh(mesh)).point_count == points


@pytest.mark.parametrize(
    ("choices", "field"),
    [
        ({"end_strain": 0.0}, "end_strain"),
        ({"speed": -1.0}, "speed"),
        ({"confinement": -1.0}, "confinement"),
        ({"cycles": "many"}, "cycles"),
        ({"height": 2.0}, "'height'"),
    ],
)
def test_choice_out_of_range_is_refused(choices: dict, field: str) -> None:
    with pytest.raises(ConfigurationError, match=f"biaxial.*{field}"):
        find_problem("biaxial", **choices)
