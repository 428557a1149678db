"""Datasets that no mirror has: made by their command, or an error explains how to get them."""

import logging
import os
import shutil
from pathlib import Path

import pytest
import yaml

from granbench.data import making, registry
from granbench.data.fetch import checkout_datasets
from granbench.data.registry import entries
from granbench.data.store import bring, dataset_file, default_dataset, load, making_folder
from granbench.errors import DatasetError, DownloadError
from granbench.generators.find import dataset_names
from granbench.records import open_records, verify, write_records

REGISTERED = {entry.id: entry for entry in entries()}
GP_J2 = REGISTERED["gp-j2"]
FILE = checkout_datasets() / GP_J2.file


def registered(shelf, **changes):
    """Register gp-j2, with some fields changed, in a registry of the test's own."""
    entry = GP_J2.model_copy(update=changes)
    path = registry.entry_path(entry.id, entry.version)
    path.parent.mkdir(exist_ok=True)
    path.write_text(yaml.safe_dump(entry.model_dump(mode="json")))
    return entry


def in_other_bytes(file: Path) -> Path:
    """The same values in a file whose bytes differ, as another netCDF library writes it."""
    with open(file, "ab") as copy:
        copy.write(b"\0" * 8)
    return file


def test_a_dataset_that_takes_seconds_is_made_checked_and_reported(shelf, caplog):
    caplog.set_level(logging.INFO, "granbench")
    entry = registered(shelf)
    file = dataset_file("gp-j2")
    assert file.parent == making_folder()
    with open_records(file) as ds:
        verify(ds, str(file))
        assert ds.attrs["content_sha256"] == entry.content_sha256
    assert os.listdir(making_folder()) == [entry.file]  # the campaign's folder is gone
    assert "granbench generate gp-j2 --preset core" in caplog.text
    assert "content hash as registered" in caplog.text
    before = file.stat().st_mtime_ns
    with load("gp-j2") as again:
        assert again.sizes["path"] > 0
    assert dataset_file("gp-j2").stat().st_mtime_ns == before
    brought = bring("gp-j2", shelf.cache.parent / "mine")
    assert brought.read_bytes() == file.read_bytes()


def test_a_made_file_counts_by_its_values_and_not_by_its_bytes(shelf):
    entry = registered(shelf)
    making_folder().mkdir(parents=True)
    made = Path(shutil.copy(FILE, making_folder() / entry.file))
    in_other_bytes(made)
    assert dataset_file("gp-j2") == made


def test_a_made_file_with_other_values_does_not_count(shelf):
    entry = registered(shelf, generator_seconds=None)
    making_folder().mkdir(parents=True)
    damaged = Path(shutil.copy(FILE, making_folder() / entry.file))
    content = bytearray(damaged.read_bytes())
    content[len(content) // 2] ^= 0xFF
    damaged.write_bytes(content)
    with pytest.raises(DownloadError):
        dataset_file("gp-j2")


def test_a_command_that_gives_other_values_is_refused_and_nothing_is_left(shelf, monkeypatch):
    registered(shelf)

    def run(entry, workshop):
        with open_records(FILE) as ds:
            other = ds.load()
        other["stress"].values[0, 1, 0] += 1.0
        write_records(other, workshop / entry.file)

    monkeypatch.setattr(making, "_run", run)
    with pytest.raises(DatasetError, match="not the registered dataset.*install granbench-data"):
        dataset_file("gp-j2")
    assert os.listdir(making_folder()) == []


def test_a_command_that_fails_says_why_in_one_sentence(shelf):
    registered(shelf, generator=GP_J2.generator.replace("core", "gigantic"))
    with pytest.raises(DownloadError, match="exit code 2 .*'gigantic'") as caught:
        dataset_file("gp-j2")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("seconds", "remedy"),
    [
        (180.0, "about 3 minutes, with minutes=True"),
        (7200.0, r"`granbench generate gp-j2 .*--out DIR`, about 2 hours"),
        (None, r"GRANBENCH_MIRROR"),
    ],
)
def test_a_dataset_that_takes_longer_is_not_made_and_the_error_lists_remedies(
    shelf, monkeypatch, seconds, remedy
):
    registered(shelf, generator_seconds=seconds)
    asked = []
    monkeypatch.setattr(making, "_run", lambda *words: asked.append(words))
    for minutes in (False, True):
        if minutes and seconds == 180.0:
            continue
        with pytest.raises(DownloadError, match=remedy) as caught:
            dataset_file("gp-j2", minutes=minutes)
        for way in ("granbench-data", "checkout", "GRANBENCH_MIRROR", "On this machine: "):
            assert way in str(caught.value)
    assert asked == []


def test_what_takes_minutes_is_made_on_request(shelf, monkeypatch):
    entry = registered(shelf, generator_seconds=180.0)

    def run(entry, workshop):
        workshop.mkdir()
        shutil.copy(FILE, workshop / entry.file)

    monkeypatch.setattr(making, "_run", run)
    assert dataset_file("gp-j2", minutes=True) == making_folder() / entry.file


def test_a_command_of_another_program_is_never_run(shelf):
    registered(shelf, generator="curl http://example.org --out DIR")
    with pytest.raises(DownloadError, match="install the package granbench-data"):
        dataset_file("gp-j2", minutes=True)


def test_a_mirror_is_tried_before_making(shelf):
    entry = registered(shelf)
    shelf.mirror.mkdir()
    shutil.copy(FILE, shelf.mirror / entry.file)
    shelf.use_mirror(shelf.mirror)
    assert dataset_file("gp-j2") == shelf.cache / entry.file


def test_every_registered_dataset_can_be_had_by_someone_who_has_the_wheel_alone():
    for entry in entries():
        if entry.tier == "core":
            assert entry.id in dataset_names()
            assert making.how_to_make(entry) is not None
    at_once = {entry.id for entry in entries() if making.is_made_at_once(entry)}
    assert at_once == {name for name in dataset_names() if name.startswith("gp-")}
    asked = {entry.id for entry in entries() if making.is_made_on_request(entry)} - at_once
    assert asked == {"fem-ime", "fem-csuh"}


def test_the_dataset_of_a_command_that_names_none_is_one_that_is_here(shelf, records, monkeypatch):
    assert default_dataset() == "dem-triaxial"  # nothing is here: the error says what can be done
    monkeypatch.setattr("granbench.data.store.DEFAULTS", ("absent", "synthetic"))
    entry = shelf.publish(records)
    assert default_dataset() == "absent"
    (shelf.mirror / entry.file).rename(shelf.checkout / entry.file)
    assert default_dataset() == "synthetic"
