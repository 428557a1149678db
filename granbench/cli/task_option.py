"""The option `--task` of the commands that train and score."""

from pathlib import Path
from typing import Annotated

import typer

import granbench

TASK_FOLDER = Path(granbench.__file__).parent / "data" / "registry" / "tasks"


def task_names() -> list[str]:
    """Names of GranBench's own tasks, from the names of their files: help needs no more."""
    return sorted({path.stem.rpartition("-")[0] for path in TASK_FOLDER.glob("*.yaml")})


TaskName = Annotated[
    str | None,
    typer.Option(
        "--task",
        metavar="NAME|FILE",
        help=f"Task ({', '.join(task_names())}, or a task of another package, see `granbench task "
        "list`), NAME@VERSION, a task's YAML file, or a netCDF file of records; by default "
        "dem-triaxial or, if it is not on this machine, dem-triaxial-mini.",
    ),
]
