"""A package from outside of GranBench, as if it were installed, and commands that see it."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def install(
    folder: Path, files: Mapping[str, str], group: str, *entries: str, package: str = "my-package"
) -> None:
    """Put a package in a folder as pip leaves it: its files, and what it registers.

    Parameters
    ----------
    folder : where Python is to find the package
    files : text by path in the folder
    group : of entry points
    entries : lines such as ``toy = toy_axis:TOY``
    package : name of the package
    """
    metadata = folder / f"{package.replace('-', '_')}-1.0.dist-info"
    written = {folder / name: text for name, text in files.items()}
    written[metadata / "METADATA"] = f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n"
    written[metadata / "entry_points.txt"] = "\n".join([f"[{group}]", *entries, ""])
    for path, text in written.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def granbench(folder: Path, *words: object) -> str:
    """Output of a command of GranBench that is run in the folder of the installed package."""
    done = _run(folder, "-m", "granbench", *words)
    assert done.returncode == 0, done.stderr
    return done.stdout


def noted(folder: Path, *words: object) -> tuple[str, list[str]]:
    """Output of a command of GranBench that succeeds, and its notes on standard error."""
    done = _run(folder, "-m", "granbench", *words)
    assert done.returncode == 0, done.stderr
    return done.stdout, [line for line in done.stderr.splitlines() if line.startswith("note: ")]


def refused(folder: Path, *words: object) -> str:
    """The error of a command that GranBench refuses, run as `granbench` runs one."""
    done = _run(folder, "-m", "granbench", *words)
    assert done.returncode == 2, done.stderr
    return done.stderr


def python(folder: Path, program: str) -> None:
    """Run a Python program that must succeed, as `granbench` runs a command."""
    done = _run(folder, "-c", program)
    assert done.returncode == 0, done.stderr


def scores(file: Path, **wanted: str) -> list[dict[str, Any]]:
    """The scores of a submission with some fields."""
    listed = json.loads(file.read_text())["scores"]
    return [score for score in listed if wanted.items() <= score.items()]


def _run(folder: Path, *words: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *map(str, words)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder), "COLUMNS": "100"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
