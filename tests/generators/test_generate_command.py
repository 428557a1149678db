"""`granbench generate` around a campaign of real processes: what SIGTERM leaves behind."""

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from campaign_support import (
    PATIENCE,
    files_of,
    is_alive,
    processes_named_in,
    wait_until,
)

from granbench.cli import main

pytestmark = pytest.mark.usefixtures("toy_jobs")

PROGRAM = """
import sys
from pathlib import Path
from campaign_support import waiting_jobs
from granbench.cli import main
from granbench.generators import catalogue
from granbench.generators.campaign import run_campaign

def generate(preset, out, *, seed, **options):
    return out, run_campaign(waiting_jobs(Path(sys.argv[1])), out, **options)

catalogue.GENERATORS["waiting"] = "__main__:generate"
main(["generate", "waiting", "--out", sys.argv[2], "--workers", "2", "--quiet"])
"""


@contextlib.contextmanager
def generating(shared: Path, folder: Path) -> Iterator[subprocess.Popen]:
    """The command, in a process of its own, on a dataset of waiting jobs."""
    command = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(shared), str(folder)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    try:
        yield command
    finally:
        command.kill()
        command.communicate()


def test_sigterm_stops_the_jobs_says_how_to_continue_and_loses_nothing(
    tmp_path, shared, undisturbed
):
    folder = tmp_path / "campaign"
    with generating(shared, folder) as command:
        wait_until(lambda: len(processes_named_in(shared)) == 2)
        jobs = processes_named_in(shared)
        command.send_signal(signal.SIGTERM)
        said = command.communicate(timeout=PATIENCE)
    assert said == (b"", b"terminated; run the same command again to continue\n")
    assert command.returncode == 143
    assert not any(map(is_alive, jobs))
    assert list((folder / "attempts").iterdir()) == []
    assert list((folder / "failed").iterdir()) == []
    (shared / "go").touch()
    with generating(shared, folder) as command:
        assert command.communicate(timeout=PATIENCE) == (b"", b"")
    assert command.returncode == 0
    assert files_of(folder) == undisturbed


@pytest.mark.parametrize("name", ["back\\slash", os.fsdecode(b"not-utf8-\xff")])
def test_a_folder_that_netcdf_cannot_write_to_is_refused_before_any_work(tmp_path, name, capsys):
    with pytest.raises(SystemExit) as left:
        main(["generate", "gp-j2", "--out", str(tmp_path / name)])
    assert left.value.code == 2
    assert "name another folder with --out" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
