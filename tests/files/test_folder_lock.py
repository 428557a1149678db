"""A folder is written by one command at a time, and a killed one leaves no lock."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest
import xarray as xr

from granbench.cells.baseline import TrainingRequest, find_baseline
from granbench.errors import ConfigurationError, ModelError
from granbench.files.folder_lock import LOCK_FILE, locked_folder

HOLD = (
    "import sys, time, pathlib\n"
    "from granbench.errors import ModelError\n"
    "from granbench.files.folder_lock import locked_folder\n"
    "with locked_folder(pathlib.Path(sys.argv[1]), ModelError):\n"
    "    print('held', flush=True)\n"
    "    time.sleep(60)\n"
)


@pytest.fixture
def holder(tmp_path: Path):
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path / "run")], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.wait()


def test_a_second_command_is_refused_with_the_process_that_holds_the_folder(
    holder, tmp_path: Path
) -> None:
    with (
        pytest.raises(ConfigurationError, match=f"process {holder.pid} "),
        locked_folder(tmp_path / "run", ConfigurationError),
    ):
        pass


@pytest.mark.parametrize("baseline", ["lstm", "j2-fitted"])
def test_two_trainings_do_not_share_a_folder(
    baseline: str, holder, records: xr.Dataset, tmp_path: Path
) -> None:
    with pytest.raises(ModelError, match="another command is writing to"):
        find_baseline(baseline).train(TrainingRequest(records, tmp_path / "run", epochs=1))


def test_the_lock_of_a_killed_process_does_not_count(holder, tmp_path: Path) -> None:
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    assert (tmp_path / "run" / LOCK_FILE).exists()
    with locked_folder(tmp_path / "run", ModelError):
        pass
    assert not (tmp_path / "run" / LOCK_FILE).exists()
