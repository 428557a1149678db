"""`granbench task`, as a user types it."""

import json

import pytest

from granbench.benchmark.task_registry import registered_tasks
from granbench.cli import main
from granbench.cli.task_option import task_names


def run(*words: str) -> int:
    with pytest.raises(SystemExit) as leaving:
        main(list(words))
    return int(leaving.value.code or 0)


def test_list_names_every_registered_task(capsys: pytest.CaptureFixture) -> None:
    assert run("task", "list", "--json") == 0
    listed = json.loads(capsys.readouterr().out)
    assert [task["id"] for task in listed] == [task.id for task in registered_tasks()]
    assert run("task", "list") == 0
    shown = capsys.readouterr().out
    assert all(task["id"] in shown and task["summary"] in shown for task in listed)


def test_info_describes_splits_analyses_and_small_splits(capsys: pytest.CaptureFixture) -> None:
    assert run("task", "info", "fem-ime") == 0
    shown = capsys.readouterr().out
    for part in ("retaining-wall", "ood-wall has fewer than 3 specimens", "single-step", "ime"):
        assert part in shown
    assert run("task", "info", "fem-ime", "--json") == 0
    content = json.loads(capsys.readouterr().out)
    assert content["sizes"]["ood-wall"] == {"paths": 192, "specimens": 2}
    assert len(content["notes"]) == 2


def test_an_unknown_task_is_one_sentence(capsys: pytest.CaptureFixture) -> None:
    assert run("task", "info", "gp-j3") == 2
    error = capsys.readouterr().err
    assert "gp-j3" in error and "gp-j2" in error and error.count("\n") == 1


def test_help_names_the_tasks_of_granbench(capsys: pytest.CaptureFixture) -> None:
    assert task_names() == [task.id for task in registered_tasks()]
    for command in ("evaluate", "train"):
        assert run(command, "--help") == 0
        words = "".join(capsys.readouterr().out.split())
        assert all(name in words for name in task_names())
