"""Every breach of the schema is named, with its file, its variable and its path."""

import os
import re

import numpy as np
import pytest
import xarray as xr
from netCDF4 import Dataset

from granbench.errors import DatasetError
from granbench.records import SCHEMA, describe, open_records, validate_records, write_records

BREAKAGES = {
    "variable 'stress' .* is missing": lambda ds: ds.drop_vars("stress"),
    "variable 'split' .* is missing": lambda ds: ds.drop_vars("split"),
    "variable 'stress' has units 'kPa' instead of 'Pa'": lambda ds: _with_units(ds),
    "variable 'void_ratio' has dimensions": lambda ds: ds.assign(
        void_ratio=ds["void_ratio"].transpose("step", "path")
    ),
    "variable 'stress' has values that are NaN": lambda ds: _with_nan(ds, "stress"),
    "variable 'void_ratio' has values that are NaN": lambda ds: _with_nan(ds, "void_ratio"),
    "variable 'strain' is not zero at step 0": lambda ds: ds.assign(strain=ds["strain"] + 1e-3),
    "variable 'path_id' holds .* more than once": lambda ds: xr.concat(
        [ds, ds.isel(path=[0])], "path", data_vars="minimal"
    ),
    "puts specimen .* in both 'test' and 'train'": lambda ds: _with_label(ds, "split", "test"),
    "variable 'split' holds 'testing'": lambda ds: _with_label(ds, "split", "testing"),
    "variable 'component': components a, b, c": lambda ds: ds.assign_coords(
        component=ds["component"].copy(data=["a", "b", "c"])
    ),
    "variable 'seed' holds floating values": lambda ds: ds.assign_coords(
        seed=ds["seed"].astype(float).assign_attrs(ds["seed"].attrs)
    ),
    "global attribute 'licence' is missing": lambda ds: _without_attribute(ds, "licence"),
    "variable 'mystery' is not part of the schema": lambda ds: ds.assign(
        mystery=("path", np.zeros(ds.sizes["path"]))
    ),
    "0 and 41 entries": lambda ds: ds.isel(path=[]),
}


def _with_units(ds):
    ds["stress"].attrs["units"] = "kPa"
    return ds


def _with_nan(ds, name):
    ds[name].values[7, 3] = np.nan
    return ds


def _with_label(ds, name, label):
    values = ds[name].values.astype(object)
    values[0] = label
    return ds.assign_coords({name: ("path", values.astype(str), ds[name].attrs)})


def _without_attribute(ds, name):
    del ds.attrs[name]
    return ds


@pytest.mark.parametrize("sentence", BREAKAGES)
def test_a_breach_of_the_schema_is_named_with_its_file(records, tmp_path, sentence):
    broken = BREAKAGES[sentence](records)
    with pytest.raises(DatasetError, match=f"here.nc: .*{sentence}"):
        validate_records(broken, "here.nc")
    with pytest.raises(DatasetError):
        write_records(broken, tmp_path / "here.nc")
    assert not os.listdir(tmp_path)


SENSELESS = [  # variable, value, the value as it is shown, what it must be
    ("initial_mean_stress", -1e5, "-100000.0 Pa", "above 0 in a dataset with 'void_ratio'"),
    ("initial_mean_stress", 0.0, "0.0 Pa", "above 0 in a dataset with 'void_ratio'"),
    ("intermediate_stress_ratio", -0.01, "-0.01", "from 0 to 1"),
    ("intermediate_stress_ratio", 1.01, "1.01", "from 0 to 1"),
    ("intermediate_stress_ratio", np.inf, "inf", "from 0 to 1"),
    ("initial_void_ratio", 0.0, "0.0", "above 0"),
    ("void_ratio", -0.25, "-0.25", "above 0"),
    ("preparation_friction", -0.1, "-0.1", "at least 0"),
    ("d_min", -1e-3, "-0.001 m", "at least 0"),
    ("d_max", 0.0, "0.0 m", "above 0"),
    ("d50", 0.0, "0.0 m", "above 0"),
    ("particle_count", 0, "0", "at least 1"),
    ("coefficient_of_uniformity", 0.99, "0.99", "at least 1"),
    ("time_step", 0.0, "0.0 s", "above 0"),
]


@pytest.fixture
def spoilt_file(records, tmp_path, monkeypatch):
    """A file that someone else wrote, wrong in one path, which is read in a later block."""
    described = describe(records.assign_coords(time_step=("path", np.full(50, 1e-5))))
    file = write_records(described, tmp_path / "here.nc")
    monkeypatch.setattr("granbench.records.schema.VALUES_PER_BLOCK", 100)

    def spoil(name, value):
        with Dataset(file, "a") as handle:
            handle[name][41] = value
        return file, re.escape(f"in path '{records['path_id'].values[41]}'")

    return spoil


@pytest.mark.parametrize(("name", "value", "shown", "allowed"), SENSELESS)
def test_a_value_that_makes_no_sense_is_named(spoilt_file, name, value, shown, allowed):
    file, path = spoilt_file(name, value)
    sentence = (
        rf"here\.nc: variable '{name}' \({re.escape(SCHEMA[name].long_name)}\) is "
        f"{re.escape(shown)} {path}, but must be {allowed}; remove the path or mend its source"
    )
    with pytest.raises(DatasetError, match=f"{sentence}$"):
        open_records(file)


def test_a_largest_grain_below_the_smallest_is_named(spoilt_file):
    file, path = spoilt_file("d_max", 1e-6)
    sentence = rf"'d_max' \(.*\) is 1e-06 m {path}, less than its 'd_min', 0\.\d+ m; remove"
    with pytest.raises(DatasetError, match=sentence):
        open_records(file)


def test_only_what_has_no_grains_may_begin_without_stress(records):
    at_rest = records.assign_coords(initial_mean_stress=records["initial_mean_stress"] * 0.0)
    at_rest["initial_mean_stress"].attrs = records["initial_mean_stress"].attrs
    for beside in ("void_ratio", "particle_count"):
        with pytest.raises(DatasetError, match=f"above 0 in a dataset with '{beside}'"):
            validate_records(at_rest)
        at_rest = at_rest.drop_vars(beside)
    validate_records(at_rest)


def test_the_ends_of_a_range_are_values(records):
    records["intermediate_stress_ratio"].values[:2] = [0.0, 1.0]
    records["preparation_friction"].values[:] = 0.0
    records["coefficient_of_uniformity"].values[:] = 1.0
    records["particle_count"].values[:] = 1
    records["d_min"].values[:] = records["d_max"].values
    validate_records(records)


def test_nan_is_a_value_where_nothing_applies(records):
    assert SCHEMA["fractal_dimension"].nullable
    records["fractal_dimension"].values[:] = np.nan
    validate_records(records)
