"""Dataset figures: they show what the records hold, labelled with symbols and units."""

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from synthetic_records import synthetic_records

from granbench.errors import DatasetError
from granbench.plotting import (
    critical_state_figure,
    cyclic_figure,
    dataset_figure,
    pi_plane_figure,
    preparation_figure,
    quality_figure,
)
from granbench.plotting.style import SETTINGS
from granbench.records.observations import comparable_compressions, select

FIGURES = (
    critical_state_figure,
    cyclic_figure,
    dataset_figure,
    pi_plane_figure,
    preparation_figure,
    quality_figure,
)


@pytest.fixture(scope="module")
def many() -> xr.Dataset:
    """Enough specimens for several gradings at several pressures."""
    return synthetic_records(16, steps=61)


@pytest.mark.parametrize("draw", FIGURES)
def test_every_axis_has_a_label_with_a_unit(draw, many: xr.Dataset) -> None:
    figure = draw(many)
    assert isinstance(figure, Figure)
    labels = [
        label for axis in figure.axes for label in (axis.get_xlabel(), axis.get_ylabel()) if label
    ]
    assert len(labels) >= 2
    assert all(label.endswith("]") for label in labels), labels


@pytest.mark.parametrize("draw", FIGURES)
def test_drawing_leaves_matplotlib_as_it_was(draw, many: xr.Dataset) -> None:
    before = {name: mpl.rcParams[name] for name in SETTINGS}
    draw(many)
    assert {name: mpl.rcParams[name] for name in SETTINGS} == before


def test_measured_curves_are_dots(many: xr.Dataset) -> None:
    group = comparable_compressions(many)
    stress_axis, void_axis = dataset_figure(many).axes[:2]
    for axis in (stress_axis, void_axis):
        assert len(axis.lines) == group.sizes["path"]
        assert all(line.get_linestyle() == "None" for line in axis.lines)
        assert all(line.get_marker() == "o" for line in axis.lines)
    drawn = void_axis.lines[0].get_ydata()
    assert drawn == pytest.approx(group["void_ratio"].isel(path=0).values)


def test_named_paths_are_drawn_and_others_are_not(many: xr.Dataset) -> None:
    wanted = [str(name) for name in many["path_id"].values[[3, 7]]]
    figure = dataset_figure(many, paths=wanted)
    chosen = select(many, path_id=tuple(wanted))
    drawn = [line.get_xdata() for line in figure.axes[0].lines]
    strain = 100.0 * chosen["strain"].isel(component=0).values
    assert np.allclose(np.stack(drawn), strain)


def test_an_unknown_path_is_named(many: xr.Dataset) -> None:
    with pytest.raises(DatasetError, match="no path 'nowhere'"):
        dataset_figure(many, paths=["nowhere"])


def test_records_without_void_ratio_still_show_stress(many: xr.Dataset) -> None:
    figure = dataset_figure(many.drop_vars("void_ratio"))
    assert len([axis for axis in figure.axes if axis.get_xlabel()]) == 1


@pytest.mark.parametrize(
    ("draw", "family", "missing"),
    [
        (critical_state_figure, "cyclic", "monotonic tests"),
        (pi_plane_figure, "random-strain", "monotonic tests"),
        (cyclic_figure, "constant-p", "cyclic tests"),
    ],
)
def test_a_figure_without_its_tests_names_them(
    draw, family: str, missing: str, many: xr.Dataset
) -> None:
    with pytest.raises(DatasetError, match=missing):
        draw(select(many, loading_family=family))


def test_quality_needs_quality_measures(many: xr.Dataset) -> None:
    bare = many.drop_vars(["servo_error_rms", "stress_ratio_error_rms", "peak_inertial_number"])
    with pytest.raises(DatasetError, match="no servo error"):
        quality_figure(bare)
