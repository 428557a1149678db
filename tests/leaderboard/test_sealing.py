"""Rows keep what was accepted, and nothing is half replaced."""

import json
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from small_submissions import register_task

from granbench.errors import SubmissionError
from granbench.leaderboard.board import accept, accepted
from granbench.leaderboard.build import build
from granbench.leaderboard.rescoring import SAME_VALUES
from granbench.leaderboard.revalidation import revalidate, touched
from granbench.leaderboard.sealing import require_seal, seal_older_rows
from granbench.leaderboard.submission import read_submission


@pytest.fixture(scope="module")
def _board(_submissions, sealed, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("sealed")
    for name in ("secant", "persistence"):
        accept(_submissions / f"{name}.json", folder, sealed)
    return folder


@pytest.fixture
def board(_board, tmp_path) -> Path:
    return Path(shutil.copytree(_board, tmp_path / "board"))


def changed(file: Path, change: Callable[[dict], object]) -> None:
    content = json.loads(file.read_text())
    change(content)
    file.write_text(json.dumps(content))


FORGED: dict[str, Callable[[Path], object]] = {
    "number": lambda f: changed(f, lambda c: c["scores"][0].update(value=1e-9)),
    "badge": lambda f: changed(f, lambda c: c.update(badge="rerun")),
    "authors": lambda f: changed(f, lambda c: c.update(authors=["Somebody Else"])),
    "no seal": lambda f: changed(f, lambda c: c.pop("acceptance")),
    "a word": lambda f: changed(f, lambda c: c["acceptance"].update(word="trust me")),
    "predictions": lambda f: f.with_suffix(".nc").write_bytes(b"other"),
    "predictions gone": lambda f: f.with_suffix(".nc").unlink(),
}


@pytest.mark.parametrize("case", FORGED)
def test_a_row_that_was_changed_is_not_shown(board, tmp_path, case):
    build(accepted(board), tmp_path / "site")
    FORGED[case](board / "synthetic" / "secant.json")
    with pytest.raises(SubmissionError, match="secant"):
        build(accepted(board), tmp_path / "site")


def test_rows_without_a_seal_are_sealed_once(board):
    file = board / "synthetic" / "secant.json"
    before = read_submission(file)
    changed(file, lambda c: c.pop("acceptance"))
    assert list(seal_older_rows(board)) == [file]
    assert read_submission(file) == before
    assert list(seal_older_rows(board)) == []


def test_the_board_stores_what_was_recomputed(submission_file, sealed, tmp_path):
    """A number that agrees to 1e-6 is stored as it was recomputed, not as it was claimed."""
    file = submission_file()
    honest = read_submission(file)
    index = next(i for i, score in enumerate(honest.scores) if score.value)

    def nudged(content: dict) -> None:
        content["scores"][index]["value"] *= 1.0 + 5e-7

    changed(file, nudged)
    stored = read_submission(accept(file, tmp_path / "board", sealed))
    assert stored.scores[index].value == honest.scores[index].value


def test_a_full_disk_leaves_the_older_row_whole(
    submission_file, sealed, tmp_path, tiny_disk, monkeypatch
):
    """The row is larger than the disk; so a smaller one, put there by hand, has to survive."""
    folder = tiny_disk / "synthetic"
    folder.mkdir()
    older = {folder / "secant.json": b"{}", folder / "secant.nc": b"predictions"}
    for file, content in older.items():
        file.write_bytes(content)
    monkeypatch.setattr("granbench.leaderboard.admission.accepted", lambda folder: [])
    with pytest.raises(SubmissionError, match="disk is full|No space left"):
        accept(submission_file(), tiny_disk, sealed, replace=True)
    assert {file: file.read_bytes() for file in folder.iterdir()} == older


@pytest.mark.parametrize("failing", ["secant.json", "secant.nc"])
def test_a_failure_at_any_moment_leaves_the_older_row_whole(
    board, submission_file, sealed, monkeypatch, failing
):
    before = {file: file.read_bytes() for file in board.rglob("*") if file.is_file()}
    real = os.replace

    def failing_replace(source, target):
        into_place = Path(target).parent.name == "synthetic"
        if into_place and Path(target).name == failing and ".part" in Path(source).parent.name:
            raise OSError(28, "No space left on device")
        real(source, target)

    monkeypatch.setattr("granbench.leaderboard.board.os.replace", failing_replace)
    with pytest.raises(SubmissionError, match="No space left"):
        accept(submission_file(), board, sealed, replace=True)
    assert {file: file.read_bytes() for file in board.rglob("*") if file.is_file()} == before


def git(folder: Path, *arguments: str) -> None:
    who = ["-c", "user.name=a", "-c", "user.email=a@example.org"]
    subprocess.run(["git", "-C", str(folder), *who, *arguments], check=True, capture_output=True)


def test_a_version_that_changes_no_value_touches_no_row(board, sealed, monkeypatch):
    register_task(sealed, monkeypatch)
    file = board / "synthetic" / "secant.json"
    current = file.read_text()
    git(board, "init", "-b", "work")
    changed(file, lambda c: c.update(metric_version=SAME_VALUES[0]))
    git(board, "add", ".")
    git(board, "commit", "-m", "rows of an earlier version")
    git(board, "commit", "--allow-empty", "-m", "nothing of the board")
    file.write_text(current)
    assert touched(board) == []
    changed(file, lambda c: c["scores"][0].update(value=0.5))
    assert [row.file for row in touched(board)] == [file]


def test_only_rows_that_a_change_touches_are_validated_again(board, submit, sealed, monkeypatch):
    git(board, "init", "-b", "work")
    git(board, "add", ".")
    git(board, "commit", "-m", "rows")
    git(board, "commit", "--allow-empty", "-m", "nothing of the board")
    assert touched(board) == []
    file = board / "synthetic" / "secant.json"
    changed(file, lambda c: c["acceptance"].update(digest="1" * 64))
    assert touched(board) == []  # a seal is no number
    changed(file, lambda c: c["scores"][0].update(n=1))
    assert [row.file for row in touched(board)] == [file]
    git(board, "checkout", ".")
    predictions = board / "synthetic" / "persistence.nc"
    predictions.write_bytes(predictions.read_bytes() + b"\0")
    assert [row.submission.name for row in touched(board)] == ["persistence"]


def test_an_interrupted_validation_of_all_rows_continues(board, sealed, tmp_path, monkeypatch):
    register_task(sealed, monkeypatch)
    state = tmp_path / "state.json"
    first = next(revalidate(accepted(board), board, state))
    assert first.complaint is None and not first.known
    rest = list(revalidate(accepted(board), board, state))
    assert [one.known for one in rest] == [True, False]
    assert all(one.complaint is None for one in rest)
    changed(board / "synthetic" / "secant.json", lambda c: c["scores"][0].update(value=1e-9))
    again = {one.file.stem: one for one in revalidate(accepted(board), board, state)}
    assert again["persistence"].known and again["secant"].complaint is not None


def test_a_sealed_row_is_as_it_was_accepted(board):
    for row in accepted(board):
        require_seal(row.submission, row.file)
