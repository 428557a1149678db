"""Fixtures of the tests of the campaign executor."""

from pathlib import Path

import pytest
from campaign_support import files_of, quiet, waiting_jobs


@pytest.fixture
def toy_jobs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the processes of jobs and the workers of dask import the toy jobs."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))


@pytest.fixture
def shared(tmp_path: Path) -> Path:
    folder = tmp_path / "shared"
    folder.mkdir()
    return folder


@pytest.fixture
def undisturbed(toy_jobs: None, tmp_path: Path) -> dict[str, bytes]:
    """The results of the waiting jobs without any interruption."""
    ready = tmp_path / "ready"
    ready.mkdir()
    (ready / "go").touch()
    report = quiet(waiting_jobs(ready), tmp_path / "undisturbed", workers=2)
    assert len(report.done) == 3
    return files_of(tmp_path / "undisturbed")
