"""Fixtures that every test may use."""

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import xarray as xr
from dataset_shelf import Shelf, make_shelf
from hypothesis import settings
from synthetic_records import synthetic_records

from granbench.records import write_records

settings.register_profile("fixed", derandomize=True, deadline=None)
settings.register_profile("fresh", max_examples=500, deadline=None, print_blob=True)


def pytest_configure(config: pytest.Config) -> None:
    """Draw the same examples in every run, and react to Ctrl-C, which tests send.

    `make fuzz` draws fresh examples with ``--hypothesis-profile fresh``. A shell that runs the
    suite in the background ignores Ctrl-C.
    """
    if config.getoption("--hypothesis-profile") is None:
        settings.load_profile("fixed")
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def _records() -> xr.Dataset:
    return synthetic_records()


@pytest.fixture
def records(_records: xr.Dataset) -> xr.Dataset:
    """Synthetic records; each test gets a copy of its own."""
    return _records.copy(deep=True)


@pytest.fixture
def records_file(records: xr.Dataset, tmp_path: Path) -> Path:
    """The synthetic records in a sealed file."""
    return write_records(records, tmp_path / "synthetic.nc")


@pytest.fixture
def shelf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Shelf:
    """A registry, mirror and cache of the test's own."""
    return make_shelf(tmp_path, monkeypatch)


@pytest.fixture
def tiny_disk(tmp_path: Path) -> Iterator[Path]:
    """A real file system of 64 kB; skipped where mounting is not allowed."""
    folder = tmp_path / "disk"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)]
    try:
        subprocess.run(command, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        missing = pytest.fail if os.environ.get("CI") else pytest.skip
        missing("mounting a tiny disk needs root")
    yield folder
    # Lazily: after a failed write HDF5 keeps its file open until the process ends.
    subprocess.run(["umount", "--lazy", str(folder)], check=True)
