"""Laws of netCDF files from outside: declared sizes are bounded, attributes change no value."""

from collections.abc import Callable
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

from granbench.benchmark.axes.along_paths.predict import labelled
from granbench.benchmark.predictions import (
    assembled_predictions,
    evaluated,
    open_predictions,
    write_predictions,
)
from granbench.errors import DatasetError, SubmissionError
from granbench.files.netcdf_reading import open_netcdf
from granbench.records import content_hashes, open_records

Change = Callable[[netCDF4.Dataset], object]


def changed(file: Path, change: Change) -> Path:
    with netCDF4.Dataset(file, "a") as handle:
        change(handle)
    return file


def add(*lengths: int, kind: object = "f4", **options: object) -> Change:
    """A variable of the given lengths, none of whose values is ever written."""

    def change(handle: netCDF4.Dataset) -> None:
        dims = [handle.createDimension(f"d{n}", length or None) for n, length in enumerate(lengths)]
        variable = handle.createVariable("extra", kind, [dim.name for dim in dims], **options)
        variable.units, variable.long_name = "1", "extra"

    return change


BOMBS: dict[str, tuple[Change, str]] = {
    "terabytes": (add(10**6, 10**6), "declares"),
    "gigabyte": (add(2**28), "declares"),
    "empty and endless": (add(10**12, 0), "declares"),
    "text": (add(10**8, kind=str), "declares"),
    "characters": (add(4 * 10**6, 2, kind="S1"), "declares"),
    "chunk": (add(0, 0, kind="f8", chunksizes=(10_000, 10_000)), "chunks"),
    "many variables": (
        lambda h: [h.createVariable(f"v{n}", "f4", ("path",)) for n in range(600)],
        "variables",
    ),
    "attributes": (lambda h: h.setncattr("history", "x" * 20_000_000), "attributes"),
    "group": (lambda h: h.createGroup("inner"), "group"),
    "type of its own": (
        lambda h: h.createVariable("extra", h.createVLType("f4", "ragged"), ("path",)),
        "type",
    ),
    "big-endian": (lambda h: h.createVariable("extra", ">f4", ("path",), endian="big"), "endian"),
}


@pytest.mark.parametrize("case", BOMBS)
def test_what_a_file_declares_is_bounded_before_a_value_is_read(case: str, records_file: Path):
    change, said = BOMBS[case]
    with pytest.raises(DatasetError, match=rf"synthetic\.nc: .*{said}"):
        open_records(changed(records_file, change))


ATTRIBUTES: dict[str, tuple[str, object]] = {
    "scaled": ("scale_factor", 2.0),
    "shifted": ("add_offset", np.array([1.0, 2.0])),
    "unsigned": ("_Unsigned", "true"),
    "missing": ("missing_value", 5.0),
    "boolean": ("dtype", "bool"),
    "units as numbers": ("units", np.array([1.0, 2.0])),
    "units as texts": ("units", ["Pa", "Pa"]),
    "coordinates as numbers": ("coordinates", np.array([1, 2])),
    "hash as number": ("content_sha256", 1),
}


@pytest.mark.parametrize("case", ATTRIBUTES)
def test_an_attribute_that_changes_values_is_refused(case: str, records_file: Path):
    name, value = ATTRIBUTES[case]
    with pytest.raises(DatasetError, match=f"'stress' has .*{name}"):
        open_records(changed(records_file, lambda h: h["stress"].setncattr(name, value)))


def test_a_mark_of_missing_values_is_refused_unless_it_is_nan(records_file: Path, tmp_path: Path):
    with netCDF4.Dataset(tmp_path / "marked.nc", "w") as handle:
        handle.createDimension("path", 2)
        handle.createVariable("a", "f4", ("path",), fill_value=-999.0)[:] = [1.0, 2.0]
    with pytest.raises(DatasetError, match="'a' marks missing values by"):
        open_netcdf(tmp_path / "marked.nc", DatasetError, "")
    with open_records(records_file) as ds:  # which xarray marks with NaN
        assert "_FillValue" not in ds["stress"].attrs


@pytest.mark.parametrize("units", ["days since 1900-01-01", "seconds", "s"])
def test_units_of_time_make_no_dates(units: str, tmp_path: Path):
    with netCDF4.Dataset(tmp_path / "a.nc", "w") as handle:
        handle.createDimension("path", 2)
        handle.createVariable("a", "f8", ("path",))[:] = [1.0, 2.0]
        handle["a"].units = units
        handle["a"].calendar = "no calendar"
    with open_netcdf(tmp_path / "a.nc", DatasetError, "") as ds:
        np.testing.assert_array_equal(ds["a"].values, [1.0, 2.0])
        assert ds["a"].dtype == np.float64


@pytest.mark.parametrize("name", ["licence", "ground_truth", "version", "embedded_analyses"])
def test_global_attributes_that_are_read_are_text(name: str, records_file: Path):
    with pytest.raises(DatasetError, match=f"'{name}' is not text"):
        open_records(changed(records_file, lambda h: h.setncattr(name, np.array([1, 2]))))


def test_reading_gives_what_was_written(records, records_file: Path):
    with open_records(records_file) as ds:
        assert content_hashes(ds) == content_hashes(records)


def test_long_labels_do_not_multiply(records_file: Path):
    def change(handle: netCDF4.Dataset) -> None:
        handle.renameVariable("loading_family", "old")
        handle["old"].units, handle["old"].long_name = "", "old"
        new = handle.createVariable("loading_family", str, ("path",))
        new.units = ""
        for row in range(len(handle.dimensions["path"])):
            new[row] = "y"
        new[0] = "x" * 2_000_000

    with pytest.raises(DatasetError, match="'loading_family' has .* labels"):
        open_records(changed(records_file, change))


PREDICTIONS: dict[str, tuple[Change, str]] = {
    "extra variable": (add(2**27), "declares"),
    "small extra variable": (add(3), "variable 'extra'"),
    "scaled": (lambda h: h["stress"].setncattr("scale_factor", 2.0), "scale_factor"),
    "array attribute": (lambda h: h.setncattr("reads_records", np.arange(3)), "reads_records"),
    "deep attribute": (
        lambda h: h.setncattr("physics_not_applicable", "[" * 5000 + "]" * 5000),
        "nested too deeply",
    ),
    "negative seed": (lambda h: h["seed"].__setitem__(0, -1), "seed"),
    "coordinates as numbers": (lambda h: h["stress"].setncattr("coordinates", 1), "coordinates"),
}


@pytest.mark.parametrize("case", PREDICTIONS)
def test_malicious_predictions_are_an_error_of_one_sentence(case: str, records, tmp_path: Path):
    file = tmp_path / "p.nc"
    predictions = small_predictions(records)
    write_predictions(predictions, file)
    assert open_predictions(file).identical(predictions)
    change, said = PREDICTIONS[case]
    with pytest.raises(SubmissionError, match=said) as caught:
        open_predictions(changed(file, change))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["seed", "first_predicted_step", "path_id", "split"])
def test_a_coordinate_of_another_type_is_named(name: str, records, tmp_path: Path):
    predictions = small_predictions(records)
    dims, length = predictions[name].dims, predictions[name].size
    changed = predictions.assign_coords({name: (dims, np.linspace(0.5, 1.5, length))})
    write_predictions(changed, tmp_path / "p.nc")
    with pytest.raises(SubmissionError, match=f"{name!r} does not hold"):
        open_predictions(tmp_path / "p.nc")


def small_predictions(records: xr.Dataset) -> xr.Dataset:
    scored = evaluated(records)
    shape = (2, 1, scored.sizes["path"], scored.sizes["step"], 3)
    return assembled_predictions(
        [labelled({"stress": np.ones(shape)}, ["rollout"])],
        dataset=scored,
        seeds=(0, 1),
        attrs={"physics_not_applicable": "{}"},
    )
