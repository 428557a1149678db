"""`granbench train`, as a user types it."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
import torch

from granbench.cli import main


@pytest.fixture(autouse=True)
def same_threads() -> Iterator[None]:
    """The command sets the number of threads of the process."""
    before = torch.get_num_threads()
    yield
    torch.set_num_threads(before)


def run(*words: object) -> int:
    with pytest.raises(SystemExit) as exit_:
        main([str(word) for word in words])
    return exit_.value.code or 0


def test_train_writes_a_model_and_continues_when_run_again(
    records_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    out = tmp_path / "model"
    command = ("train", "mlstm", "--task", records_file, "--out", out, "--seed", 3)
    assert run(*command, "--epochs", 2) == 0
    assert "epoch" in capsys.readouterr().out
    assert {file.name for file in out.iterdir()} == {
        "history.csv",
        "learning_curve.png",
        "model.json",
        "model.safetensors",
        "training.safetensors",
    }
    assert run(*command, "--epochs", 3, "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["baseline"] == "mlstm"
    assert summary["training"]["seed"] == 3
    assert summary["training"]["epochs"] == 3


def test_quiet_prints_nothing(
    records_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    words = ("train", "lstm", "--task", records_file, "--out", tmp_path / "m", "--epochs", 1)
    assert run(*words, "--quiet") == 0
    captured = capsys.readouterr()
    assert captured.out == captured.err == ""


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("mlsmt",), "unknown baseline"),
        (("oracle",), "nothing to train"),
        (("mlstm", "--preset", "fast"), "preset"),
        (("mlstm", "--device", "abacus"), "abacus"),
        (("mlstm", "--epochs", "0"), "epochs"),
        (("mlstm", "--budget", "-1"), "--budget"),
        (("mlstm", "--budget", "0"), "--budget"),
        (("mlstm", "--budget", "nan"), "--budget"),
        (("mlstm", "--seed", "-1"), "--seed"),
        (("mlstm", "--speed", "9"), "--speed"),
        (("mlstm", "--task", "no-such-dataset"), "no-such-dataset"),
    ],
)
def test_bad_input_is_one_sentence(
    records_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture,
    words: tuple[str, ...],
    named: str,
) -> None:
    out = tmp_path / "model"
    task = () if "--task" in words else ("--task", records_file)
    assert run("train", *words, *task, "--out", out) == 2
    captured = capsys.readouterr()
    assert named in captured.err
    assert captured.err.count("\n") == 1
    assert "Traceback" not in captured.err
    assert not out.exists()


@pytest.mark.parametrize(
    ("below", "said"),
    [("", "is a file; give a folder"), ("below", "cannot be written (Not a directory); choose")],
)
def test_a_file_in_the_place_of_the_folder_is_one_sentence(
    records_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture, below: str, said: str
) -> None:
    taken = tmp_path / "notes.txt"
    taken.write_text("mine")
    words = ("--task", records_file, "--epochs", 1, "--out", taken / below)
    assert run("train", "lstm", *words) == 2
    error = capsys.readouterr().err
    assert "notes.txt" in error and said in error
    assert "Errno" not in error and error.count("\n") == 1
    assert taken.read_text() == "mine"


def test_a_model_that_cannot_start_leaves_no_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    # The paths of gp-j2 start without stress, and CSUH under compression only.
    assert run("train", "csuh-fitted", "--task", "gp-j2-mini", "--out", tmp_path / "m") == 2
    assert "starts at a mean stress of 0 Pa" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_folder_of_another_run_is_refused(
    records_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    words = ("--task", records_file, "--out", tmp_path / "model", "--epochs", 1, "--quiet")
    assert run("train", "lstm", *words) == 0
    assert run("train", "mlstm", *words) == 2
    assert "--out" in capsys.readouterr().err
