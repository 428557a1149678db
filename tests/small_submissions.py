"""Submissions of small cells, written in no time."""

from pathlib import Path

import pytest
import xarray as xr

from granbench.benchmark.evaluation import predict
from granbench.benchmark.predictions import evaluated
from granbench.benchmark.task import Task
from granbench.cells.contract import MaterialCell
from granbench.leaderboard.composition import compose
from granbench.leaderboard.submission import About


def about(name: str, **changes) -> About:
    defaults = {
        "name": name,
        "authors": ("A. Tester",),
        "training_data": "synthetic 1.0.0, split train",
        "licence": "BSD-3-Clause",
        "command": f"granbench evaluate {name}",
        "code": "https://example.org/code",
    }
    return About(**defaults | changes)


def submitted(
    cell: MaterialCell,
    sealed: xr.Dataset,
    out: Path,
    *,
    task: Task | None = None,
    axes=None,
    seeds=(0, 1, 2),
    **changes,
) -> Path:
    predictions = predict(dict.fromkeys(seeds, cell), evaluated(sealed), axes, task=task)
    compose(predictions, sealed, about(**{"name": cell.name} | changes), out, task=task)
    return out


def register_task(records: xr.Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the board find the task of some records alone under its name."""
    place = "granbench.leaderboard.submitted_task"
    task = Task.of_records(records)
    monkeypatch.setattr(f"{place}.registered_task", lambda name, version: task)
    monkeypatch.setattr(f"{place}.task_records", lambda task: records.copy())
