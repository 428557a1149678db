"""A package from outside of GranBench, as if it were installed, and commands that see it."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any


def install(folder: Path, module: str, source: str, group: str) -> None:
    """Put a module with one entry point, `toy = module:TOY`, where Python finds packages."""
    (folder / f"{module}.py").write_text(source)
    info = folder / f"{module}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{group}]\ntoy = {module}:TOY\n")


def granbench(folder: Path, *words: str) -> str:
    """Output of a command of GranBench that is run in the folder of the installed package."""
    done = subprocess.run(
        [sys.executable, "-m", "granbench", *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder), "COLUMNS": "100"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def scores(file: Path, **wanted: str) -> list[dict[str, Any]]:
    """The scores of a submission with some fields."""
    listed = json.loads(file.read_text())["scores"]
    return [score for score in listed if wanted.items() <= score.items()]
