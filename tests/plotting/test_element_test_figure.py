import numpy as np

from granbench.element_test.response_files import response_records
from granbench.plotting.element_test import MOST_CURVES, element_test_figure, path_invariants
from granbench.plotting.style import model_styles


def answer(order="principal", paths=1, **internals):
    count = 6 if order == "full" else 3
    strain = np.cumsum(np.random.default_rng(0).normal(0.0, 1e-3, (paths, 9, count)), axis=1)
    strain -= strain[:, :1]
    stress = 1e5 + 1e7 * strain
    return response_records(
        order, strain, stress, internals, family="prescribed", configuration={}, version="0"
    )


def test_three_panels_show_strength_volume_and_stress_path():
    records = answer()
    figure = element_test_figure(records, "j2", "22")
    strength, volume, path = figure.axes
    p, q, volumetric = path_invariants(records)
    strain = 100.0 * records["strain"].values[0, :, 1]
    for axis, x, y in (
        (strength, strain, q[0] / 1e3), (volume, strain, 100.0 * volumetric[0]),
        (path, p[0] / 1e3, q[0] / 1e3),
    ):  # fmt: skip
        (line,) = axis.lines
        np.testing.assert_array_equal(line.get_xdata(), x)
        np.testing.assert_array_equal(line.get_ydata(), y)
        assert line.get_color() == model_styles(["j2"])["j2"].colour
        assert axis.get_xlabel().endswith("]") and axis.get_ylabel().endswith("]")
    assert "22" in strength.get_xlabel()


def test_the_component_with_the_largest_strain_is_the_abscissa():
    records = answer()
    records["strain"][:, -1, 2] = 0.5
    assert "33" in element_test_figure(records, "j2").axes[0].get_xlabel()


def test_of_many_paths_a_dozen_are_drawn():
    figure = element_test_figure(answer(paths=40), "j2")
    assert [len(axis.lines) for axis in figure.axes] == [MOST_CURVES] * 3


def test_plane_strain_has_three_dimensional_invariants():
    """With its stress out of the plane, a plane record is the full one that it stands for."""
    plane = answer("plane", paths=2)
    zz = 2e5 + 0.0 * plane["strain"].values[..., 0]
    with_zz = answer("plane", paths=2, out_of_plane_stress=zz)
    stress = plane["stress"].values
    p, q, _ = path_invariants(with_zz)
    np.testing.assert_allclose(p, (stress[..., 0] + stress[..., 1] + 2e5) / 3.0)
    s = np.stack([stress[..., 0] - p, stress[..., 1] - p, 2e5 - p])
    expected = np.sqrt(1.5 * ((s**2).sum(axis=0) + 2.0 * stress[..., 2] ** 2))
    np.testing.assert_allclose(q, expected)
    p, _, _ = path_invariants(plane)
    np.testing.assert_allclose(p, (stress[..., 0] + stress[..., 1]) / 2.0)
