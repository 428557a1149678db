"""Explicit dynamics: energy, stability, statics as the limit, and what an ended run keeps."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import xarray as xr
from plane_bodies import LAME, SHEAR, STIFFNESS, Body, distorted, elastic_cell
from torch import Tensor

from granbench.cells.contract import ModuleCell
from granbench.errors import AnalysisError, ConfigurationError
from granbench.fem import ExplicitSettings, rectangle, run
from granbench.fem.gauss_points import GaussPoints
from granbench.fem.loading import Loading, LoadingHistory, Prescribed, Pressure
from granbench.fem.operators import build_operators
from granbench.fem.problems.biaxial import Biaxial
from granbench.fem.time_step import choose_time_step
from granbench.models import MODELS
from granbench.paths.confining_pressure import RandomConfinement

BALANCED = 1e-11
"""Relative tolerance of the energy: central differences conserve it exactly, and rounding adds up
over 1e3-1e4 steps."""

QUICK = ExplicitSettings(outputs=20)


@pytest.mark.parametrize("damping", [0.0, 1.0])
@pytest.mark.parametrize(
    "problem",
    [
        Biaxial(end_strain=0.02, speed=1.0, confinement=1e5),
        Biaxial(ends="smooth", end_strain=0.02, speed=1.0, confinement=RandomConfinement(5.0)),
        Biaxial(cycles="cyclic", end_strain=0.1, speed=2.0, confinement=1e5),
    ],
    ids=["monotonic", "random confinement", "cyclic"],
)
def test_energy_is_balanced_at_every_output(problem: Biaxial, damping: float) -> None:
    settings = replace(QUICK, damping=damping)
    found = run(problem, MODELS["ime"](), solver=settings, mesh="coarse").check()
    assert np.abs(found["energy_error"]).max() < BALANCED
    assert (found["damping_work"] >= -1e-9 * float(found["external_work"].max())).all()
    assert float(found["internal_energy"][-1]) > 0.0


def test_weight_and_a_pressure_on_an_elastic_body_oscillate_without_loss() -> None:
    rising = LoadingHistory((0.0, 0.05, 0.2), (0.0, 1e3, 1e3))
    still = LoadingHistory((0.0, 0.2), (0.0, 0.0))
    loading = Loading(
        (Prescribed("bottom", x=0.0, y=0.0),), still, (Pressure("right", rising),), (0.0, -9.81)
    )
    settings = replace(QUICK, damping=0.0)
    found = run(Body(loading), elastic_cell(), solver=settings, mesh=distorted("quad8")).check()
    assert float(found["kinetic_energy"].max()) > 0.0
    assert np.abs(found["energy_error"]).max() < BALANCED


@pytest.mark.parametrize("name", ["j2", "drucker-prager", "ime", "csuh"])
def test_confinement_alone_changes_nothing(name: str) -> None:
    still = LoadingHistory((0.0, 0.1), (0.0, 0.0))
    problem = Biaxial(ends="smooth", confinement=1e5)
    loading = replace(problem.loading(rectangle(0.5, 1.0, 2, 4)), drive=still)
    lid = Pressure("top", LoadingHistory.constant(1e5))
    free = replace(loading, prescribed=loading.prescribed[::2], forces=(*loading.forces, lid))
    found = run(
        Body(free, pressure=1e5), MODELS[name](), solver=replace(QUICK, damping=0.0), mesh=MESH
    ).check()
    expected = np.broadcast_to([1e5, 1e5, 0.0], found["stress"].shape)
    np.testing.assert_allclose(found["stress"], expected, rtol=1e-9, atol=1e-4)


MESH = rectangle(0.5, 1.0, 2, 4)


def test_body_carried_along_is_not_stressed() -> None:
    """All of the boundary moves as a rigid body."""
    sides = ("left", "right", "bottom", "top")
    moves = tuple(
        Prescribed(side, x=lambda x: 0.3 - x[:, 1], y=lambda x: -0.2 + x[:, 0]) for side in sides
    )
    loading = Loading(moves, LoadingHistory((0.0, 0.05), (0.0, 0.01)))
    found = run(Body(loading), elastic_cell(), solver=QUICK, mesh=distorted("quad8")).check()
    # An increment of 1e-5 m is known to 1e-21 m, over 0.1 m, times 1e7 Pa, some 1e3 times.
    assert np.abs(found["stress"]).max() < 1e-8
    assert np.abs(found["reaction"]).max() < 1e-8


def test_compression_is_positive_wherever_it_is_seen() -> None:
    found = run(
        Biaxial(end_strain=0.01, confinement=1e5), MODELS["ime"](), solver=QUICK, mesh="coarse"
    ).check()
    last = found.isel(step=-1)
    assert last["driving_displacement"] > 0.0
    assert last["reaction"] > 0.5 * 1e5
    assert last["volumetric_strain"] > 0.0
    assert (last["strain"].sel(component="yy") > 0.0).all()
    assert (last["strain"].sel(component="xx").mean()) < 0.0  # it bulges
    assert (last["stress"].sel(component="yy") > 1e5).all()
    assert last["displacement"].sel(direction="y").min() == pytest.approx(-0.01)
    assert float(last["reaction"]) == pytest.approx(
        float((last["stress"].sel(component="yy") * last["point_volume"]).sum()), rel=0.02
    )  # the mean axial stress times the width, in the quasi-static limit


def test_unstable_time_step_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="is unstable"):
        run(Biaxial(), MODELS["ime"](), solver=ExplicitSettings(time_step=1e-3), mesh="coarse")
    with pytest.raises(ConfigurationError, match="is unstable"):
        run(Biaxial(), MODELS["ime"](), solver=ExplicitSettings(safety=5.0), mesh="coarse")


@pytest.mark.parametrize("element", ["quad8", "quad4", "tri3", "tri6"])
def test_limit_of_the_time_step_is_safe_and_not_wasteful(element: str) -> None:
    """Undamped vibration is bounded at 0.99 of the limit; at 1.5 of it, it would not be."""
    mesh = distorted(element)
    operators = build_operators(mesh)
    stiffness = (
        operators.force
        @ np.kron(STIFFNESS, np.eye(operators.point_count))
        @ operators.strain.toarray()
    )
    root = 1.0 / np.sqrt(operators.lumped_mass(2650.0))
    frequency = np.sqrt(np.linalg.eigvalsh(root[:, None] * stiffness * root).max())
    points = GaussPoints(elastic_cell(), np.zeros((3, operators.point_count)), operators.points)
    step = choose_time_step(operators, points, ExplicitSettings())
    assert step.chosen < step.limit <= 2.0 / frequency < 1.5 * step.limit
    speed = np.sqrt((LAME + 2 * SHEAR) / 2650.0)
    assert step.chosen == pytest.approx(0.2 * mesh.characteristic_length / speed)


def test_material_that_stiffens_beyond_the_time_step_ends_the_run() -> None:
    class Stiffens(torch.nn.Module):
        def forward(self, dstrain: Tensor, stress: Tensor) -> Tensor:
            stiffer = torch.where(stress[:, 1:2] > 1.02e5, 1000.0, 1.0)
            return stress + stiffer * (dstrain @ torch.from_numpy(STIFFNESS))

    cell = ModuleCell(Stiffens(), name="stiffens", order="plane", dtype=torch.float64)
    found = run(Biaxial(end_strain=0.01, confinement=1e5), cell, solver=QUICK, mesh="coarse")
    assert isinstance(found.failure, AnalysisError)
    assert "became unstable by step" in str(found.failure)
    assert found.dataset.sizes["step"] > 1


def test_model_without_stiffness_needs_a_modulus() -> None:
    class Slack(torch.nn.Module):
        def forward(self, dstrain: Tensor, stress: Tensor) -> Tensor:
            return stress + 0.0 * dstrain

    cell = ModuleCell(Slack(), name="slack", order="plane", dtype=torch.float64)
    with pytest.raises(ConfigurationError, match="slack.*modulus"):
        run(Biaxial(), cell, mesh="coarse")
    settings = ExplicitSettings(modulus=2e7, outputs=5)
    assert run(Biaxial(end_strain=0.001), cell, solver=settings, mesh="coarse").failure is None


@pytest.mark.parametrize(
    ("name", "value"), [("density", 0.0), ("damping", -1.0), ("outputs", 0), ("outputs", 2.5)]
)
def test_setting_out_of_range_is_refused(name: str, value: float) -> None:
    with pytest.raises(ConfigurationError, match=f"{name} is"):
        ExplicitSettings(**{name: value})


def test_interrupted_run_keeps_its_output_so_far() -> None:
    def interrupt(step: int, steps: int) -> None:
        if step > steps // 2:
            raise KeyboardInterrupt

    found = run(Biaxial(end_strain=0.01), elastic_cell(), mesh="coarse", on_step=interrupt)
    assert isinstance(found.failure, KeyboardInterrupt)
    assert 50 < found.dataset.sizes["step"] < 60
    assert found.dataset.attrs["completed"] == 0
    with pytest.raises(KeyboardInterrupt):
        found.check()


def test_result_is_read_back_from_its_file(tmp_path) -> None:
    problem = Biaxial(end_strain=0.01, confinement=RandomConfinement(2.0))
    found = run(problem, MODELS["csuh"](), solver=QUICK, mesh="coarse")
    file = found.write(tmp_path / "biaxial.nc")
    with xr.open_dataset(file) as read:
        xr.testing.assert_identical(read.load(), found.dataset)
        assert read["reaction"].attrs["units"] == "N/m"
        assert read["stress"].dims == ("step", "point", "component")
        assert all("long_name" in read[name].attrs for name in read.data_vars)
        assert "void_ratio" in read


def test_file_that_cannot_be_written_is_one_sentence(tmp_path) -> None:
    found = run(Biaxial(end_strain=0.001), elastic_cell(), solver=QUICK, mesh="coarse")
    (tmp_path / "folder").mkdir()
    with pytest.raises(AnalysisError, match="cannot be written"):
        found.write(tmp_path / "folder")


def test_unknown_choices_are_named() -> None:
    with pytest.raises(ConfigurationError, match="'biaxal'.*'biaxial'"):
        run("biaxal", elastic_cell())
    with pytest.raises(ConfigurationError, match="biaxial.*'fin'.*'fine'"):
        run("biaxial", elastic_cell(), mesh="fin")
    with pytest.raises(ConfigurationError, match="'exact'"):
        run("biaxial", elastic_cell(), solver="exact")
    with pytest.raises(ConfigurationError, match="ends.*'sticky'"):
        Biaxial(ends="sticky")
    with pytest.raises(ConfigurationError, match="MaterialCell"):
        run("biaxial", 3)
