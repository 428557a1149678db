"""The demonstration, from particles to a leaderboard row, with a few seconds of training."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_demo_runs_from_particles_to_a_board(tmp_path: Path) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", ROOT / "docs/examples/demo.sh", tmp_path],
        env={**os.environ, "PATH": path, "TRAINING_MINUTES": "0.1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert {file.name for file in (tmp_path / "pictures").iterdir()} == {
        "packing.png",
        "measured-against-predicted.png",
        "error-against-horizon.png",
    }
    assert "mlstm-demo" in (tmp_path / "leaderboard" / "leaderboard.json").read_text()
