"""Every fault of a dataset is named, with its file, its variable and its path."""

import os
import re

import numpy as np
import pytest
import xarray as xr
from netCDF4 import Dataset

from granbench.errors import DatasetError
from granbench.records import SCHEMA, describe, open_records, validate_records, write_records

FAULTS = {
    "missing 'stress'": lambda ds: ds.drop_vars("stress"),
    "missing 'split'": lambda ds: ds.drop_vars("split"),
    "units of 'stress' 'kPa'": lambda ds: _with_units(ds),
    "dimensions of 'void_ratio'": lambda ds: ds.assign(
        void_ratio=ds["void_ratio"].transpose("step", "path")
    ),
    "NaN in 'stress'": lambda ds: _with_nan(ds, "stress"),
    "NaN in 'void_ratio'": lambda ds: _with_nan(ds, "void_ratio"),
    "start of 'strain'": lambda ds: ds.assign(strain=ds["strain"] + 1e-3),
    "repeated 'path_id'": lambda ds: xr.concat(
        [ds, ds.isel(path=[0])], "path", data_vars="minimal"
    ),
    "one specimen in 'test' and 'train'": lambda ds: _with_label(ds, "split", "test"),
    "unknown 'split' 'testing'": lambda ds: _with_label(ds, "split", "testing"),
    "unknown 'component'": lambda ds: ds.assign_coords(
        component=ds["component"].copy(data=["a", "b", "c"])
    ),
    "type of 'seed'": lambda ds: ds.assign_coords(
        seed=ds["seed"].astype(float).assign_attrs(ds["seed"].attrs)
    ),
    "missing 'licence'": lambda ds: _without_attribute(ds, "licence"),
    "unknown 'mystery'": lambda ds: ds.assign(mystery=("path", np.zeros(ds.sizes["path"]))),
    "no path": lambda ds: ds.isel(path=[]),
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


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_named_with_its_file(records, tmp_path, fault):
    """The names in quotation marks are in the error message."""
    broken = FAULTS[fault](records)
    with pytest.raises(DatasetError, match=r"here\.nc") as caught:
        validate_records(broken, "here.nc")
    assert all(name in str(caught.value) for name in re.findall("'[^']*'", fault))
    with pytest.raises(DatasetError):
        write_records(broken, tmp_path / "here.nc")
    assert not os.listdir(tmp_path)


OUT_OF_RANGE = [  # variable, value, the value as it is shown, its range
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
def faulty_file(records, tmp_path, monkeypatch):
    """A file with a wrong value in one path, which is not read in the first block."""
    described = describe(records.assign_coords(time_step=("path", np.full(50, 1e-5))))
    file = write_records(described, tmp_path / "here.nc")
    monkeypatch.setattr("granbench.records.schema.VALUES_PER_BLOCK", 100)

    def with_value(name, value):
        with Dataset(file, "a") as handle:
            handle[name][41] = value
        return file, repr(str(records["path_id"].values[41]))

    return with_value


@pytest.mark.parametrize(("name", "value", "shown", "allowed"), OUT_OF_RANGE)
def test_a_value_out_of_range_is_named(faulty_file, name, value, shown, allowed):
    file, path = faulty_file(name, value)
    with pytest.raises(DatasetError, match=r"here\.nc") as caught:
        open_records(file)
    for part in (repr(name), SCHEMA[name].long_name, shown, path, allowed):
        assert part in str(caught.value)


def test_a_largest_grain_below_the_smallest_is_named(faulty_file):
    file, path = faulty_file("d_max", 1e-6)
    with pytest.raises(DatasetError, match="1e-06 m") as caught:
        open_records(file)
    assert all(part in str(caught.value) for part in ("'d_max'", "'d_min'", path))


def test_records_of_grains_may_not_start_without_stress(records):
    at_rest = records.assign_coords(initial_mean_stress=records["initial_mean_stress"] * 0.0)
    at_rest["initial_mean_stress"].attrs = records["initial_mean_stress"].attrs
    for beside in ("void_ratio", "particle_count"):
        with pytest.raises(DatasetError, match=f"'initial_mean_stress'.*above 0.*'{beside}'"):
            validate_records(at_rest)
        at_rest = at_rest.drop_vars(beside)
    validate_records(at_rest)


def test_the_ends_of_a_range_are_allowed(records):
    records["intermediate_stress_ratio"].values[:2] = [0.0, 1.0]
    records["preparation_friction"].values[:] = 0.0
    records["coefficient_of_uniformity"].values[:] = 1.0
    records["particle_count"].values[:] = 1
    records["d_min"].values[:] = records["d_max"].values
    validate_records(records)


def test_nan_is_allowed_where_a_quantity_does_not_apply(records):
    assert SCHEMA["fractal_dimension"].nullable
    records["fractal_dimension"].values[:] = np.nan
    validate_records(records)
