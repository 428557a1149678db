"""Figures of strain paths in the plane: labelled, and of what the records hold."""

import numpy as np
import pytest
import xarray as xr
from plane_records import plane_records

from granbench.errors import DatasetError
from granbench.plotting import increment_figure, strain_path_figure, stress_space_figure
from granbench.tensors import deviatoric_stress, mean_stress

FIGURES = (increment_figure, strain_path_figure, stress_space_figure)


@pytest.fixture
def plane() -> xr.Dataset:
    return plane_records("gp-j2")


@pytest.mark.parametrize("draw", FIGURES)
def test_every_axis_has_a_label_with_a_unit(draw, plane: xr.Dataset) -> None:
    labels = [
        label
        for axis in draw(plane).axes
        for label in (axis.get_xlabel(), axis.get_ylabel())
        if label
    ]
    assert len(labels) >= 2
    assert all(label.endswith("]") for label in labels), labels


@pytest.mark.parametrize("draw", FIGURES)
def test_records_of_triaxial_tests_are_refused(draw, records: xr.Dataset) -> None:
    with pytest.raises(DatasetError, match="principal components"):
        draw(records)


def test_first_path_of_every_family_is_drawn_as_dots(plane: xr.Dataset) -> None:
    figure = strain_path_figure(plane)
    titles = [axis.get_title() for axis in figure.axes if axis.get_title()]
    shown = ("train", "ood-rougher", "ood-amplitude", "ood-proportional", "ood-cyclic")
    assert titles == [f"{split}/0000" for split in shown]
    test = plane.isel(path=plane["split"].values == "test")
    assert strain_path_figure(test).axes[0].get_title() == "test/0000"
    first = figure.axes[0].lines
    assert [line.get_linestyle() for line in first] == ["None"] * 3
    strain = 100.0 * plane["strain"].values[0].astype(float)
    np.testing.assert_allclose(np.stack([line.get_ydata() for line in first], -1), strain)


def test_named_paths_are_drawn_and_unknown_ones_are_named(plane: xr.Dataset) -> None:
    figure = strain_path_figure(plane, paths=["test/0003"])
    assert [axis.get_title() for axis in figure.axes if axis.get_title()] == ["test/0003"]
    with pytest.raises(DatasetError, match="no path 'nowhere'"):
        strain_path_figure(plane, paths=["nowhere"])


def test_increments_of_every_split_end_at_all_of_them(plane: xr.Dataset) -> None:
    lines = increment_figure(plane).axes[0].lines
    assert len(lines) == len(set(plane["split"].values.tolist()))
    for line in lines:
        assert np.all(np.diff(line.get_xdata()) >= 0.0)
        assert line.get_ydata()[-1] == pytest.approx(100.0)


def test_stress_space_shows_the_yield_limit(plane: xr.Dataset) -> None:
    q = stress_space_figure(plane).axes[0].lines[0].get_ydata()
    # sigma_Y = 100 kPa; components of some 200 kPa are off by 2^-17 of that.
    assert q.max() == pytest.approx(100.0, rel=5e-5)


def test_a_stress_out_of_the_plane_counts(plane: xr.Dataset) -> None:
    zz = np.full(plane["stress"].shape[:2], 5e4)
    solid = plane.assign(out_of_plane_stress=(("path", "step"), zz))
    chosen = solid.isel(path=slice(0, 24))
    drawn = stress_space_figure(chosen).axes[0].lines[0]
    stress = chosen["stress"].values.astype(float)
    full = np.stack(
        [stress[..., 0], stress[..., 1], zz[:24], 0 * zz[:24], 0 * zz[:24], stress[..., 2]], -1
    )
    p, q = (1e-3 * f(full, "full").ravel() for f in (mean_stress, deviatoric_stress))
    np.testing.assert_allclose(np.sort(drawn.get_xdata()), np.sort(p), rtol=1e-12)
    np.testing.assert_allclose(np.sort(drawn.get_ydata()), np.sort(q), rtol=1e-12)
