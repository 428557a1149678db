"""`granbench task`, as a user types it."""

import json
from pathlib import Path

import pytest
from plug_in import granbench, install, noted

from granbench.benchmark.task_registry import TASK_FOLDER, registered_tasks
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


def test_what_cannot_be_read_hides_no_other_task(tmp_path: Path) -> None:
    """A package that cannot be imported, one with a damaged file, and a broken axis."""
    toy = (
        (TASK_FOLDER / "gp-j2-mini-1.0.0.yaml").read_text().replace("id: gp-j2-mini", "id: toy", 1)
    )
    files = {"damaged/__init__.py": "", "damaged/mine.yaml": "id: 1\n", "damaged/toy.yaml": toy}
    install(tmp_path, files, "granbench.tasks", "damaged = damaged", "gone = not_there")
    install(tmp_path, {}, "granbench.axes", "broken = no_axis:AXIS", package="other-package")
    own = {task.id for task in registered_tasks()}
    for words in (("list",), ("list", "--json")):
        output, notes = noted(tmp_path, "task", *words)
        assert len(notes) == 2
        assert "not_there" in "".join(notes) and "mine.yaml" in "".join(notes)
        if "--json" in words:
            assert {task["id"] for task in json.loads(output)} == {*own, "toy"}
        else:
            assert all(name in output for name in (*own, "toy"))
    assert json.loads(granbench(tmp_path, "task", "info", "fem-ime", "--json"))["notes"]
    assert json.loads(granbench(tmp_path, "task", "info", "toy", "--json"))["id"] == "toy"


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
