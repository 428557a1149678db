"""Files of records: sealed, whole or absent, and every fault is named."""

import errno
import os

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from granbench.errors import DatasetError
from granbench.records import (
    content_hashes,
    dataset_hash,
    open_records,
    seal,
    verify,
    write_records,
)


def test_a_file_gives_back_what_was_written(records, records_file):
    with open_records(records_file) as ds:
        verify(ds, str(records_file))
        assert content_hashes(ds) == content_hashes(records)
        for name, variable in records.variables.items():
            np.testing.assert_array_equal(ds[name].values, variable.values)
        assert {ds[name].attrs["units"] for name in ("stress", "shear_stress")} == {"Pa"}
        assert all(ds[name].attrs["long_name"] for name in ds.variables)


def test_two_writings_are_the_same_bytes(records, tmp_path):
    one = write_records(records, tmp_path / "one.nc").read_bytes()
    assert one == write_records(records, tmp_path / "two.nc").read_bytes()


def test_hash_covers_values_and_not_storage(records, tmp_path):
    sealed = seal(records)
    sealed.to_netcdf(tmp_path / "plain.nc", engine="netcdf4")  # no compression at all
    with open_records(tmp_path / "plain.nc") as ds:
        verify(ds)


def test_hash_does_not_depend_on_how_values_are_read(records, monkeypatch):
    whole = content_hashes(records.drop_vars(["path_id", "programme"]))
    monkeypatch.setattr("granbench.records.schema.VALUES_PER_BLOCK", 100)
    in_pieces = content_hashes(records.drop_vars(["path_id", "programme"]))
    numeric = [n for n in whole if records[n].dtype.kind in "fi"]
    assert {n: whole[n] for n in numeric} == {n: in_pieces[n] for n in numeric}


@settings(max_examples=25, deadline=None)
@given(
    name=st.sampled_from(["strain", "stress", "void_ratio", "seed", "initial_mean_stress"]),
    position=st.integers(0, 10**6),
)
def test_any_changed_value_is_named(name, position):
    ds = seal(_tiny())
    values = ds[name].values.copy()
    flat = values.reshape(-1)
    flat[position % flat.size] += 1
    ds[name] = (ds[name].dims, values, ds[name].attrs)
    with pytest.raises(DatasetError, match=rf"\b{name}\b"):
        verify(ds)


def _tiny() -> xr.Dataset:
    from synthetic_records import synthetic_records

    if not hasattr(_tiny, "made"):
        _tiny.made = synthetic_records(n_specimens=5, steps=5)
    return _tiny.made.copy(deep=True)


def test_a_changed_label_a_lost_and_an_added_variable_are_named(records):
    sealed = seal(records)
    split = sealed["split"].values.copy()
    split[split == "validation"] = "train"
    with pytest.raises(DatasetError, match=r"\bsplit\b"):
        verify(sealed.assign_coords(split=("path", split, sealed["split"].attrs)))
    with pytest.raises(DatasetError, match="void_ratio"):
        verify(sealed.drop_vars("void_ratio"))
    with pytest.raises(DatasetError, match="extra"):
        verify(sealed.assign(extra=("path", np.zeros(sealed.sizes["path"]))))
    with pytest.raises(DatasetError, match="'configuration'"):
        verify(sealed.assign_attrs(configuration="{}"))
    with pytest.raises(DatasetError, match="'content_sha256'"):
        verify(records)


def test_dataset_hash_does_not_depend_on_order():
    assert dataset_hash({"a": "1", "b": "2"}) == dataset_hash({"b": "2", "a": "1"})
    assert dataset_hash({"a": "1", "b": "2"}) != dataset_hash({"a": "2", "b": "1"})


def test_missing_units_are_added(records, tmp_path):
    for variable in records.variables.values():
        variable.attrs.clear()
    with open_records(write_records(records, tmp_path / "a.nc")) as ds:
        assert ds["stress"].attrs["units"] == "Pa"


def test_a_file_that_is_not_netcdf_is_refused(tmp_path):
    page = tmp_path / "page.nc"
    page.write_text("<!DOCTYPE html><title>404</title>")
    with pytest.raises(DatasetError, match=r"page\.nc"):
        open_records(page)
    with pytest.raises(DatasetError, match=r"none\.nc"):
        open_records(tmp_path / "none.nc")


@pytest.mark.parametrize("kept", [9, 2000, 0.5, 0.99])
def test_a_truncated_file_is_refused(records_file, kept):
    content = records_file.read_bytes()
    records_file.write_bytes(content[: int(kept if kept > 1 else kept * len(content))])
    with pytest.raises(DatasetError, match=r"synthetic\.nc"):
        open_records(records_file)


def test_damaged_bytes_are_found_unless_no_value_is_there(records, tmp_path):
    """A changed byte in a compressed block is found when the variable is read."""
    file = write_records(records, tmp_path / "a.nc")
    content = bytearray(file.read_bytes())
    before = content_hashes(records)
    named = 0
    for position in range(20_000, len(content) - 20_000, 15_000):
        damaged = bytearray(content)
        damaged[position] ^= 0xFF
        (tmp_path / f"{position}.nc").write_bytes(damaged)
        try:
            with open_records(tmp_path / f"{position}.nc") as ds:
                verify(ds)
                assert content_hashes(ds) == before
        except DatasetError as error:
            named += "variable" in str(error)
    assert named > 5


def test_a_full_disk_leaves_nothing_behind(records, tmp_path, monkeypatch):
    def full(self, target, **_):
        target.write_bytes(b"half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(xr.Dataset, "to_netcdf", full)
    with pytest.raises(DatasetError, match="No space left on device"):
        write_records(records, tmp_path / "a.nc")
    assert not os.listdir(tmp_path)


def test_a_file_system_that_is_full_is_an_error(records, tiny_disk):
    with pytest.raises(DatasetError, match="full"):
        write_records(records, tiny_disk / "a.nc")
    assert not os.listdir(tiny_disk)


def test_a_file_that_cannot_be_written_is_named(records, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(DatasetError, match=r"a\.nc"):
        write_records(records, tmp_path / "file" / "a.nc")


def test_a_failed_writing_keeps_the_older_file(records, records_file, monkeypatch):
    before = records_file.read_bytes()
    monkeypatch.setattr(os, "replace", _refuse)
    with pytest.raises(DatasetError):
        write_records(records.isel(path=slice(0, 9)), records_file)
    assert records_file.read_bytes() == before
    assert os.listdir(records_file.parent) == [records_file.name]


def _refuse(*_):
    raise PermissionError(errno.EACCES, "Permission denied")
