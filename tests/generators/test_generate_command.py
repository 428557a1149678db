"""`granbench generate` around a campaign of real processes."""

import contextlib
import json
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
from campaign_support import waiting_generator
from granbench.cli import main
from granbench.generators import find

find.find_generator = lambda dataset: waiting_generator(Path(sys.argv[1]))
main(["generate", "waiting", "--out", sys.argv[2], "--workers", "2", "--quiet"])
"""


@contextlib.contextmanager
def generating(shared: Path, folder: Path) -> Iterator[subprocess.Popen]:
    """The command, in another process, on a dataset of waiting jobs."""
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
    folder = tmp_path / "out"
    campaign = folder / "campaign"
    with generating(shared, folder) as command:
        wait_until(lambda: len(processes_named_in(shared)) == 2)
        jobs = processes_named_in(shared)
        command.send_signal(signal.SIGTERM)
        printed = command.communicate(timeout=PATIENCE)
    assert printed == (b"", b"terminated; run the same command again to continue\n")
    assert command.returncode == 143
    assert not any(map(is_alive, jobs))
    assert list((campaign / "attempts").iterdir()) == []
    assert list((campaign / "failed").iterdir()) == []
    (shared / "go").touch()
    with generating(shared, folder) as command:
        assert command.communicate(timeout=PATIENCE) == (b"", b"")
    assert command.returncode == 0
    assert files_of(campaign) == undisturbed
    assert (folder / "waiting-1.0.0.nc").is_file()


@pytest.mark.parametrize("name", ["back\\slash", os.fsdecode(b"not-utf8-\xff")])
def test_a_folder_that_netcdf_cannot_write_to_is_refused_before_any_work(tmp_path, name, capsys):
    with pytest.raises(SystemExit) as left:
        main(["generate", "gp-j2", "--out", str(tmp_path / name)])
    assert left.value.code == 2
    assert "netCDF" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("words", [["gp-j9"], ["gp-j2", "--preset", "huge"]])
def test_an_unknown_dataset_or_preset_is_named_with_the_known_ones(tmp_path, words, capsys):
    with pytest.raises(SystemExit) as left:
        main(["generate", *words, "--out", str(tmp_path / "new")])
    assert left.value.code == 2
    error = capsys.readouterr().err
    assert repr(words[-1]) in error
    assert ("smoke" if "huge" in words else "fem-csuh") in error
    assert list(tmp_path.iterdir()) == []


def test_json_names_the_file_and_counts_the_jobs(tmp_path, capsys):
    for continued in (0, 1):
        with pytest.raises(SystemExit) as left:
            main(["generate", "gp-j2", "--out", str(tmp_path), "--json"])
        assert left.value.code == 0
        outcome = json.loads(capsys.readouterr().out)
        assert Path(outcome["dataset"]) == tmp_path / "gp-j2-0.0.0+smoke.nc"
        assert (outcome["done"], outcome["continued"]) == (1, continued)
