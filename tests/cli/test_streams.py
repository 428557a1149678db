"""No state of the standard streams ends a command or costs a result."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from rich.table import Table

from granbench.cli import main
from granbench.cli.printing import show
from granbench.data.registry import entries

GRANBENCH = f"{sys.executable} -m granbench"
DRIVE = f"{GRANBENCH} drive j2 --control triaxial-drained --strain 0.02 --steps 20 --out o.csv"


def shell(command: str, folder: Path, **environment: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        ["bash", "-o", "pipefail", "-c", command],
        cwd=folder,
        env=os.environ | environment,
        capture_output=True,
        check=False,
    )


PRINTING = (
    "import os, sys\n"
    "from granbench.cli.streams import flush_streams, prepare_streams\n"
    "prepare_streams()\n"
    "for _ in range(10_000):\n    print('ε \\udcff', flush=True)\n    print('ε', file=sys.stderr)\n"
    "failure = flush_streams()\n"
    "file = os.open('o.txt', os.O_CREAT | os.O_WRONLY)\n"
    "os.write(file, f'{file > 2} {failure and failure.strerror}'.encode())\n"
)


@pytest.mark.parametrize(
    ("streams", "failure"),
    [
        (">&-", "None"),
        ("2>&- >/dev/null", "None"),
        ("<&- >&- 2>&-", "None"),
        ("2>/dev/full >/dev/null", "None"),
        ("| true", "None"),
        ("2>&1 | head -c 1", "None"),
        (">/dev/full", "No space left on device"),
        ("1</dev/null", "Bad file descriptor"),
    ],
)
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_printing_never_fails_and_no_file_takes_the_place_of_a_stream(
    streams: str, failure: str, unbuffered: str, tmp_path: Path
) -> None:
    (tmp_path / "p.py").write_text(PRINTING, encoding="utf-8")
    done = shell(f"{sys.executable} p.py {streams}", tmp_path, PYTHONUNBUFFERED=unbuffered)
    assert done.returncode == 0
    assert (tmp_path / "o.txt").read_text() == f"True {failure}"


@pytest.mark.parametrize("streams", ["<&- >&- 2>&-", "2>&1 | true"])
def test_results_are_written_with_any_failure_of_the_streams(streams: str, tmp_path: Path) -> None:
    done = shell(f"{DRIVE} {streams}", tmp_path)
    assert done.returncode == 0
    assert b"Traceback" not in done.stderr
    assert len((tmp_path / "o.csv").read_text().splitlines()) == 22


def test_a_full_standard_output_is_one_sentence_and_costs_no_file(tmp_path: Path) -> None:
    done = shell(f"{DRIVE} >/dev/full", tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(b"error: standard output cannot be written (No space left")
    assert done.stderr.count(b"\n") == 1
    assert len((tmp_path / "o.csv").read_text().splitlines()) == 22


@pytest.mark.parametrize("streams", ["2>&-", ">/dev/full 2>/dev/full"])
def test_an_error_keeps_its_exit_code_without_streams(streams: str, tmp_path: Path) -> None:
    done = shell(f"{GRANBENCH} data info no-such-dataset {streams}", tmp_path)
    assert done.returncode == 2
    assert b"Traceback" not in done.stdout + done.stderr


@pytest.mark.parametrize(
    "environment",
    [
        {"PYTHONIOENCODING": "cp1252"},
        {"PYTHONIOENCODING": "latin-1:strict"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    ],
)
def test_characters_that_a_console_lacks_are_replaced(
    environment: dict[str, str], tmp_path: Path
) -> None:
    done = shell(f"{GRANBENCH} data info gp-j2-mini", tmp_path, **environment)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"median |?" in done.stdout


def test_json_keeps_every_character_on_any_console(tmp_path: Path) -> None:
    command = f"{GRANBENCH} data list --json"
    plain, narrow = (
        shell(command, tmp_path, PYTHONIOENCODING=encoding).stdout
        for encoding in ("utf-8", "ascii")
    )
    assert json.loads(plain) == json.loads(narrow)


@pytest.mark.parametrize(
    "environment",
    [{}, {"COLUMNS": "20"}, {"TERM": "dumb"}, {"NO_COLOR": "1"}, {"FORCE_COLOR": "1"}],
)
def test_a_pipe_gets_whole_names(
    environment: dict[str, str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    for name, text in environment.items():
        monkeypatch.setenv(name, text)
    with pytest.raises(SystemExit):
        main(["data", "list"])
    lines = capsys.readouterr().out.splitlines()
    for entry in entries():
        assert any(entry.id in line and entry.title in line for line in lines)


@pytest.mark.parametrize("columns", [20, 40, 80, 200])
def test_a_terminal_cuts_nothing(
    columns: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    table = Table("dataset", "content")
    table.add_row(
        "dem-triaxial-mini-with-a-long-name", "some words about it, a dozen or more of them"
    )
    show(table)
    shown = capsys.readouterr().out
    assert "…" not in shown
    assert "dem-triaxial-mini-with-a-long-name" in shown
    assert all(word in shown for word in ("some", "words", "about", "dozen", "them"))
