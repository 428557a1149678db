"""Small multiples of a model's tests: what an axis shows, and what is refused."""

import numpy as np
import pytest
import xarray as xr

from granbench.element_test.response_files import response_records
from granbench.errors import DatasetError
from granbench.plotting.model import QUANTITIES, ClosedForm, Panel, model_figure
from granbench.plotting.style import ordered_colours
from granbench.tensors import COMPONENT_ORDERS, deviatoric_stress


def records(order: str, label: str = "test", **internals: np.ndarray) -> xr.Dataset:
    count = len(COMPONENT_ORDERS[order])
    strain = np.linspace(0.0, 0.01, 5)[:, None] * np.arange(1.0, count + 1.0)
    answer = response_records(
        order, strain[None], 1e5 + 1e7 * strain[None], internals, family="prescribed",
        configuration={}, version="0",
    )  # fmt: skip
    return answer.assign_coords(path_id=("path", [label]))


@pytest.mark.parametrize(("order", "axial", "lateral"), [("principal", 0, 2), ("plane", 1, 0),
                                                         ("full", 1, 0)])  # fmt: skip
def test_axial_and_lateral_are_the_directions_of_a_test(order, axial, lateral):
    answer = records(order)
    strain = QUANTITIES["axial_strain"].of(answer)
    np.testing.assert_array_equal(strain, answer["strain"].values[..., axial])
    difference = QUANTITIES["stress_difference"].of(answer)
    stress = answer["stress"].values
    np.testing.assert_array_equal(difference, stress[..., axial] - stress[..., lateral])


def test_the_norm_of_the_plastic_strain_counts_shear_twice():
    parts = {f"plastic_strain_{label}": np.full((1, 5), 0.1) for label in ("xx", "yy", "xy")}
    norm = QUANTITIES["plastic_strain_norm"].of(records("plane", **parts))
    np.testing.assert_allclose(norm, 0.2)


def test_curves_boundaries_and_points_are_drawn_in_the_units_of_the_axes():
    answer = records("principal")
    forms = [
        ClosedForm("line", [0.0, 0.01], [0.0, 2e5], line=True),
        ClosedForm("end", [0.01], [1e5]),
    ]
    panel = Panel("a test", "axial_strain", "deviatoric_stress", [answer], forms)
    (axis,) = model_figure([panel], columns=1).axes
    curve, line, point = axis.lines
    q = deviatoric_stress(answer["stress"].values[0], "principal")
    np.testing.assert_allclose(curve.get_ydata(), q / 1e3)
    np.testing.assert_array_equal(line.get_xydata(), [[0.0, 0.0], [1.0, 200.0]])
    np.testing.assert_array_equal(point.get_xydata(), [[1.0, 100.0]])
    assert point.get_linestyle() == "None" and line.get_marker() in ("None", "", None)
    names = [text.get_text() for text in axis.get_legend().get_texts()]
    assert names == ["test", "line", "end"]


def test_curves_of_one_panel_differ_in_grey_too():
    tests = [records("principal", str(number)) for number in range(5)]
    panel = Panel("five", "axial_strain", "mean_stress", tests)
    lines = model_figure([panel]).axes[0].lines
    assert not lines[0].is_dashed() and all(line.is_dashed() for line in lines[1:])
    lightness = [np.dot(line.get_color()[:3], (0.21, 0.72, 0.07)) for line in lines]
    assert np.all(np.diff(lightness) > 0.05)
    # The palest of the scale, which is left out, is lighter than any of them.
    assert lightness[-1] < 0.9 * np.dot(ordered_colours([0.0, 1.0])[0][1][:3], (0.21, 0.72, 0.07))


def test_an_unfinished_row_has_no_empty_axes():
    panel = Panel("one", "axial_strain", "mean_stress", [records("principal")], legend=None)
    figure = model_figure([panel] * 3)
    assert len(figure.axes) == 3
    assert figure.axes[0].get_legend() is None


def test_two_curves_of_one_name_are_refused():
    panel = Panel("twice", "axial_strain", "mean_stress", [records("plane"), records("full")])
    with pytest.raises(DatasetError, match="'twice' has two curves 'test'"):
        model_figure([panel])
