"""Laws of the registry: entries and files agree, faults are named, versions never change."""

import pytest
import yaml

from granbench.data.fetch import folders_of, why_not
from granbench.data.publish import make_mini, publish_mini, register
from granbench.data.registry import REGISTRY_FOLDER, entries, entry
from granbench.data.splits import leak_report, split_hash, split_names
from granbench.data.store import load
from granbench.data.verification import verify_file
from granbench.errors import DatasetError, RegistryError
from granbench.records import attributes_hash, describe, open_records, write_records


@pytest.mark.parametrize("entry", entries(), ids=lambda e: f"{e.id}-{e.version}")
def test_shipped_files_agree_with_the_registry(entry):
    held = [folder / entry.file for folder in folders_of(entry) if (folder / entry.file).exists()]
    assert held or entry.mirrors, "it cannot be fetched from anywhere"
    for file in held:
        assert why_not(file, entry) is None
        assert verify_file(file) == entry
        with open_records(file) as ds:
            assert leak_report(ds).clean
            assert split_hash(ds) == entry.split_sha256
    assert (REGISTRY_FOLDER / f"{entry.id}-{entry.version}.yaml").is_file()
    assert entry.tier != "mini" or entry.bytes < 1_000_000


def test_the_newest_version_is_the_default_and_old_ones_stay(shelf, records):
    for version in ("1.2.0", "1.10.0"):
        shelf.publish(records, version)
    assert entry("synthetic").version == "1.10.0"
    assert entry("synthetic@1.2.0").version == "1.2.0"
    with pytest.raises(RegistryError, match="no version '3.0.0'; use one of 1.10.0, 1.2.0"):
        entry("synthetic@3.0.0")


def test_an_unknown_dataset_gets_near_names(shelf, records):
    shelf.publish(records)
    with pytest.raises(RegistryError, match="'syntetic'.*'synthetic'"):
        entry("syntetic")
    with pytest.raises(RegistryError, match="'xyz'.*synthetic"):
        entry("xyz")


@pytest.mark.parametrize(
    ("field", "wrong"), [("sha256", "abc"), ("bytes", -1), ("file", "../a.nc"), ("extra", 1)]
)
def test_a_wrong_entry_names_file_and_field(shelf, records, tmp_path, field, wrong):
    shelf.publish(records)
    file = tmp_path / "registry" / "synthetic-1.0.0.yaml"
    file.write_text(yaml.safe_dump(yaml.safe_load(file.read_text()) | {field: wrong}))
    with pytest.raises(RegistryError, match=f"synthetic-1.0.0.yaml: '{field}' "):
        entries()


def test_a_published_version_never_changes(shelf, records):
    shelf.publish(records)
    records["stress"] = records["stress"] * 1.01
    with pytest.raises(RegistryError, match="published files never change"):
        shelf.publish(records)


def test_a_dataset_that_leaks_is_not_registered(shelf, records):
    records["stress"].values[-1] = records["stress"].values[0]  # a test path copies a training one
    records["strain"].values[-1] = records["strain"].values[0]
    with pytest.raises(DatasetError, match="splits leak"):
        shelf.publish(records)


def test_a_file_is_registered_under_its_own_name(shelf, records_file):
    with pytest.raises(RegistryError, match="'dataset' is 'synthetic', not 'other'"):
        register(records_file, identifier="other", title="", command="")


def test_load_uses_the_checkout_in_place(shelf, records):
    published = shelf.publish(records)
    (shelf.mirror / published.file).rename(shelf.checkout / published.file)
    with load("synthetic") as ds:
        assert ds.sizes["path"] == records.sizes["path"]
        assert ds.encoding["source"] == str(shelf.checkout / published.file)
    assert not shelf.cache.exists()


def test_load_fetches_once_into_the_cache(shelf, records):
    published = shelf.publish(records)
    shelf.use_mirror(shelf.mirror)
    load("synthetic").close()
    shelf.use_mirror(shelf.checkout)  # nothing there
    with load("synthetic", "validation") as ds:
        assert set(ds["split"].values) == {"validation"}
    assert (shelf.cache / published.file).is_file()


def test_a_file_that_was_damaged_since_is_fetched_again(shelf, records):
    published = shelf.publish(records)
    shelf.use_mirror(shelf.mirror)
    load("synthetic").close()
    cached = shelf.cache / published.file
    content = cached.read_bytes()
    cached.write_bytes(content[:-1] + bytes([content[-1] ^ 0xFF]))
    load("synthetic").close()
    assert cached.read_bytes() == content


def test_an_unknown_split_lists_those_there_are(shelf, records):
    shelf.publish(records)
    shelf.use_mirror(shelf.mirror)
    with pytest.raises(RegistryError, match="'testing'; use one of train, validation, test, ood"):
        load("synthetic", "testing")


def test_a_file_sealed_again_under_a_registered_version_is_found(shelf, records, tmp_path):
    shelf.publish(records)
    assert verify_file(shelf.mirror / "synthetic-1.0.0.nc").id == "synthetic"
    records["void_ratio"] = records["void_ratio"] + 0.01
    with pytest.raises(DatasetError, match="its content_sha256 .* is not the registered"):
        verify_file(write_records(records, tmp_path / "forged.nc"))
    split = records["split"].values
    split[split == "validation"] = "train"
    with pytest.raises(DatasetError, match="its split_sha256 .* is not the registered"):
        verify_file(write_records(records, tmp_path / "forged.nc"))


def test_mini_has_every_family_and_split_and_two_replicates(records, records_file, shelf):
    mini = make_mini(records)
    assert set(mini["loading_family"].values) == set(records["loading_family"].values)
    assert split_names(mini) == split_names(records)
    replicated = mini["specimen"].values[mini["replicate"].values > 0]
    assert len(set(replicated)) == 2
    for specimen in set(replicated):
        assert specimen.replace("-r1", "-r0") in mini["specimen"].values
    entry = publish_mini(records_file)
    assert (entry.id, entry.tier) == ("synthetic-mini", "mini")
    with load("synthetic-mini") as ds:
        assert ds.sizes["path"] == mini.sizes["path"]
        assert ds.sizes["step"] == records.sizes["step"]


@pytest.mark.parametrize(
    "change",
    [
        {"ground_truth": '{"model": "j2", "parameters": {"yield_stress": 3e5}}'},
        {"licence": "proprietary"},
        {"embedded_analyses": "[]"},
        {"generator": "by hand"},
        {"thesis_section": "9.9"},
        {"note": "added"},
    ],
)
def test_a_file_with_changed_attributes_is_detected(shelf, records, tmp_path, change):
    """Its values, configuration and their hashes are those of the registered file."""
    shelf.publish(records)
    forged = write_records(records.assign_attrs(version="1.0.0", **change), tmp_path / "forged.nc")
    with pytest.raises(DatasetError, match="attributes_sha256 .* is not the registered"):
        verify_file(forged)


def test_units_and_names_of_variables_are_covered(records):
    before = attributes_hash(records)
    records["void_ratio"].attrs["long_name"] = "porosity"
    assert attributes_hash(records) != before


def test_the_hash_of_the_attributes_outlives_file_and_release(records, records_file):
    again = records.assign_attrs(dict(reversed(records.attrs.items())))
    again.attrs |= {"title": "other words", "generator_version": "9.0.0", "engine_version": "9"}
    with open_records(records_file) as ds:
        assert attributes_hash(ds) == attributes_hash(describe(records))
        assert attributes_hash(ds) == attributes_hash(describe(again))
