"""Submissions of small cells on the synthetic records."""

from collections.abc import Callable
from pathlib import Path

import pytest
import xarray as xr
from small_cells import Oracle, Persistence, secant
from small_submissions import submitted

from granbench.benchmark.predictions import evaluated
from granbench.cells.contract import MaterialCell
from granbench.leaderboard.board import slug
from granbench.records import open_records, write_records


@pytest.fixture(scope="session")
def sealed(tmp_path_factory, _records) -> xr.Dataset:
    """The synthetic records as they come from a file, with their hashes."""
    file = write_records(_records, tmp_path_factory.mktemp("records") / "synthetic.nc")
    return open_records(file).load()


@pytest.fixture(scope="session")
def _submissions(tmp_path_factory, sealed) -> Path:
    folder = tmp_path_factory.mktemp("submissions")
    submitted(secant(), sealed, folder / "secant.json", parameters=0)
    submitted(Persistence(), sealed, folder / "persistence.json", role="floor")
    submitted(Oracle(evaluated(sealed)), sealed, folder / "oracle.json")
    return folder


@pytest.fixture
def submission_file(_submissions, tmp_path) -> Callable[[str], Path]:
    """A fresh copy of one of the submissions, with its predictions."""

    def copy(name: str = "secant") -> Path:
        for suffix in (".json", ".nc"):
            file = _submissions / f"{name}{suffix}"
            (tmp_path / file.name).write_bytes(file.read_bytes())
        return tmp_path / f"{name}.json"

    return copy


@pytest.fixture
def submit(sealed, tmp_path) -> Callable[..., Path]:
    """Evaluates a cell and writes its submission into the test's folder."""

    def make(cell: MaterialCell, **changes) -> Path:
        name = changes.get("name", cell.name)
        return submitted(cell, sealed, tmp_path / f"{slug(name)}.json", **changes)

    return make
