"""Figures of finite-element analyses show what the dataset holds."""

import numpy as np
import pytest
import xarray as xr

from granbench.fem import find_problem, run
from granbench.models import MODELS
from granbench.plotting.fem import analysis_figure, outlines
from granbench.plotting.paraview import element_means
from granbench.plotting.style import model_styles
from granbench.tensors import deviatoric_stress, principal_difference


@pytest.fixture(scope="module")
def found() -> xr.Dataset:
    problem = find_problem("biaxial", end_strain=0.02)
    return run(problem, MODELS["j2"](), solver="implicit", mesh="coarse").check()


def test_curves_and_body_are_those_of_the_analysis(found: xr.Dataset) -> None:
    figure = analysis_figure(found)
    force, volume, effort, body, bar = figure.axes
    for axis, values in (
        (force, found["reaction"] / 1e3),
        (volume, 100.0 * found["volumetric_strain"]),
        (effort, found["iterations"]),
    ):
        (line,) = axis.lines
        np.testing.assert_array_equal(line.get_xdata(), 100.0 * found["driving_strain"])
        np.testing.assert_array_equal(line.get_ydata(), values)
        assert line.get_color() == model_styles(["j2"])["j2"].colour
        assert axis.get_ylabel().endswith("]") and axis.get_xlabel().endswith("]")
    (faces,) = body.collections
    shear = principal_difference(element_means(found.isel(step=[-1]), "strain")[0])
    np.testing.assert_allclose(faces.get_array(), 100.0 * shear)
    assert bar.get_ylabel().endswith("[%]")


def test_explicit_analysis_shows_its_accelerations_and_an_early_end() -> None:
    problem = find_problem("biaxial", end_strain=0.001)
    dataset = run(problem, MODELS["j2"](), mesh="coarse").check()
    figure = analysis_figure(dataset.assign_attrs(completed=0))
    assert "acceleration" in figure.axes[2].get_ylabel()
    assert "(ended early)" in figure.get_suptitle()


def test_driving_strain_from_which_elements_have_turned_over_is_marked(found: xr.Dataset) -> None:
    turned = np.zeros(found.sizes["step"], dtype=int)
    turned[40:] = 2
    figure = analysis_figure(found.assign(turned_elements=("step", turned)))
    for axis in figure.axes[:3]:
        assert axis.lines[1].get_xdata()[0] == pytest.approx(0.8)
    assert "elements have turned over, from 0.8 % on" in figure.get_suptitle()


def test_outlines_follow_the_displacement(found: xr.Dataset) -> None:
    begin, end = (outlines(found, step) for step in (0, -1))
    assert begin.shape == (found.sizes["element"], 4, 2)
    assert np.ptp(begin[..., 1]) == pytest.approx(1.0)
    assert np.ptp(end[..., 1]) == pytest.approx(0.98)


def test_principal_difference_is_the_difference_of_the_principal_strains() -> None:
    strain = np.random.default_rng(0).normal(size=(9, 3))
    # In the plane sqrt(2 e:e) of the deviator is that difference.
    np.testing.assert_allclose(principal_difference(strain), deviatoric_stress(strain, "plane"))
