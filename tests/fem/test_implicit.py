"""Implicit statics: how iterations converge, and what helps where they do not."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from driven_cells import elastic
from plane_bodies import STIFFNESS, elastic_cell
from torch import Tensor

from granbench.cells.contract import ModuleCell
from granbench.errors import AnalysisError, ConfigurationError
from granbench.fem import Analysis, ImplicitSettings, run
from granbench.fem.implicit_settings import SINGLE_TOLERANCE, TOLERANCE
from granbench.fem.iteration import SCHEMES
from granbench.fem.problems.biaxial import Biaxial
from granbench.models import MODELS

PROBLEM = Biaxial(end_strain=0.05, confinement=1e5)


@pytest.mark.parametrize("name", ["j2", "j2-hardening", "ime", "drucker-prager"])
def test_newton_converges_quadratically_with_the_consistent_tangent(name: str) -> None:
    """Each residual is about the square of the last, over the forces: e' <= C e^2."""
    settings = ImplicitSettings(steps=10, tolerance=1e-13)
    found = run(
        Biaxial(end_strain=0.1, confinement=1e5), MODELS[name](), solver=settings, mesh="medium"
    )
    history = found.dataset["residual"].values
    assert found.failure is None or "does not converge" in str(found.failure)
    pairs = np.stack([history[:, :-1].ravel(), history[:, 1:].ravel()], axis=1)
    # Near enough for the square to rule, far enough for rounding not to.
    near = pairs[(pairs[:, 0] < 1e-3) & (pairs[:, 0] > 1e-6) & (pairs[:, 1] > 1e-14)]
    assert len(near) >= 3
    order = np.log(near[:, 1]) / np.log(near[:, 0])
    assert np.median(order) > 1.6


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("name", ["j2", "drucker-prager", "ime", "csuh"])
def test_every_scheme_comes_to_the_same_balance(name: str, scheme: str) -> None:
    cell = MODELS[name]()
    problem = replace(PROBLEM, end_strain=0.01) if name == "csuh" else PROBLEM
    exact = run(problem, cell, solver=replace(FEW, tolerance=1e-9), mesh="coarse").check()
    settings = replace(FEW, scheme=scheme, displacement_tolerance=1e-6)
    found = run(problem, cell, solver=settings, mesh="coarse").check()
    # Out of balance by 1e-6 of the forces; ten times that for what it adds up to over 10 steps.
    np.testing.assert_allclose(found["reaction"], exact["reaction"], rtol=1e-5)
    assert (found["iterations"][1:] >= 0).all()


FEW = ImplicitSettings(steps=10)


def test_first_step_of_an_elastic_body_takes_one_iteration() -> None:
    found = run(PROBLEM, elastic_cell(), solver=ImplicitSettings(steps=4), mesh="coarse").check()
    # Later steps begin at the last increment, which is exact.
    assert found["iterations"].values.tolist() == [0, 1, 0, 0, 0]
    assert np.isfinite(found["residual"].values[1, :2]).all()


def test_work_of_the_stresses_is_that_of_the_loads() -> None:
    found = run(
        Biaxial(cycles="cyclic", confinement=1e5), MODELS["ime"](), solver="implicit", mesh="coarse"
    ).check()
    # Unbalanced forces of 1e-6 do the rest.
    assert np.abs(found["energy_error"]).max() < 1e-5
    assert float(found["driving_strain"][-1]) == pytest.approx(0.1)
    # Turning points are outputs.
    assert {0.03, 0.05, 0.07, 0.09} <= set(found["driving_strain"].values.round(12))


class Fragile(torch.nn.Module):
    """Elastic for increments below a size, lost beyond it: only cut load steps pass."""

    def __init__(self, largest: float) -> None:
        super().__init__()
        self.largest = largest

    def forward(self, dstrain: Tensor, stress: Tensor) -> Tensor:
        after = stress + dstrain @ torch.from_numpy(STIFFNESS)
        return torch.where(dstrain.abs().amax(dim=1, keepdim=True) > self.largest, torch.nan, after)


def test_load_step_is_cut_until_it_passes() -> None:
    cell = ModuleCell(Fragile(5e-3), name="fragile", order="plane", dtype=torch.float64)
    problem = Biaxial(ends="smooth", end_strain=0.08, confinement=1e5)
    found = run(problem, cell, solver=ImplicitSettings(steps=4), mesh="coarse").check()
    assert (found["pieces"].values[1:] >= 4).all()
    exact = run(problem, elastic_cell(), solver=ImplicitSettings(steps=4), mesh="coarse").check()
    np.testing.assert_allclose(found["reaction"], exact["reaction"], rtol=1e-9)


def test_step_that_no_cut_saves_keeps_the_steps_before() -> None:
    cell = ModuleCell(Fragile(5e-3), name="fragile", order="plane", dtype=torch.float64)
    found = run(PROBLEM, cell, solver=ImplicitSettings(steps=4, cuts=0), mesh="coarse")
    assert "fragile gives no finite stress" in str(found.failure)
    assert found.dataset.sizes["step"] == 1


class Misleading(torch.nn.Module):
    """Elastic, with a derivative of the wrong sign, as a badly trained network may have it."""

    def forward(self, dstrain: Tensor, stress: Tensor) -> Tensor:
        linear = dstrain @ torch.from_numpy(STIFFNESS)
        return stress + 2.0 * linear.detach() - linear


def misleading_cell() -> ModuleCell:
    return ModuleCell(Misleading(), name="misleading", order="plane", dtype=torch.float64)


def test_a_wrong_gradient_is_found_and_replaced_by_differences() -> None:
    found = run(PROBLEM, misleading_cell(), solver=FEW, mesh="coarse").check()
    exact = run(PROBLEM, elastic_cell(), solver=FEW, mesh="coarse").check()
    np.testing.assert_allclose(found["reaction"], exact["reaction"], rtol=1e-5)
    assert "the tangent of misleading differs" in str(found.attrs["notes"])


def test_cell_without_a_useful_tangent_says_so_and_converges_with_a_given_stiffness() -> None:
    def run_unchecked(solver: ImplicitSettings) -> Analysis:
        return run(PROBLEM, misleading_cell(), solver=solver, mesh="coarse", check=False)

    failed = run_unchecked(replace(FEW, cuts=1))
    assert isinstance(failed.failure, AnalysisError)
    assert "load step 1 does not converge with the scheme 'newton'" in str(failed.failure)
    assert "'initial-stiffness', which needs no tangent" in str(failed.failure)
    secant = replace(FEW, scheme="initial-stiffness")
    with pytest.raises(ConfigurationError, match="stiffness"):
        run_unchecked(secant)
    stiffness = tuple(map(tuple, 1.5 * STIFFNESS))  # not even the right one
    found = run_unchecked(replace(secant, stiffness=stiffness)).check()
    exact = run(PROBLEM, elastic_cell(), solver=FEW, mesh="coarse").check()
    np.testing.assert_allclose(found["reaction"], exact["reaction"], rtol=1e-5)


@pytest.mark.parametrize(
    ("choice", "sentence"),
    [
        ({"scheme": "bfgs"}, "'bfgs'.*newton, restart, initial-stiffness"),
        ({"steps": 0}, "steps is 0"),
        ({"cuts": -1}, "cuts is -1"),
        ({"steps": 2.5}, "steps is 2.5"),
        ({"iterations": "few"}, "iterations is 'few'"),
        ({"stiffness": ((1.0,),)}, r"\(1, 1\).*\(3, 3\)"),
    ],
)
def test_setting_out_of_range_is_refused_by_name(choice: dict, sentence: str) -> None:
    with pytest.raises(ConfigurationError, match=sentence):
        ImplicitSettings(**choice)


def test_a_cell_in_single_precision_is_balanced_as_well_as_its_stress_is_known() -> None:
    single = elastic("plane", dtype=torch.float32)
    settings = ImplicitSettings(steps=4)
    assert settings.suited_to(single).tolerance == SINGLE_TOLERANCE
    assert settings.suited_to(elastic("plane")).tolerance == TOLERANCE
    chosen = ImplicitSettings(tolerance=1e-3)
    assert chosen.suited_to(single) is chosen
    runs = [
        run("biaxial", cell, solver=settings, mesh="coarse").check()
        for cell in (single, elastic("plane"))
    ]
    reactions = [analysis["reaction"].values for analysis in runs]
    np.testing.assert_allclose(reactions[0], reactions[1], rtol=10 * SINGLE_TOLERANCE)
