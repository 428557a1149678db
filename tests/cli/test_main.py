"""The application: quick help, one sentence and exit code 2 for every error of the user."""

import subprocess
import sys
from collections.abc import Sequence

import pytest
import typer

import granbench
from granbench.cli import main
from granbench.cli.application import app
from granbench.errors import DatasetError

HEAVY = ("torch", "numpy", "scipy", "xarray", "netCDF4", "matplotlib", "dask", "pydantic")
COMMANDS = ("data", "task", "generate", "train", "evaluate", "submission", "leaderboard")


def left_with(words: Sequence[str]) -> int:
    with pytest.raises(SystemExit) as leaving:
        main(words)
    return int(leaving.value.code or 0)


@pytest.fixture
def extra_command():
    """Adds a command to the application for one test."""
    known = list(app.registered_commands)

    def add(function) -> None:
        app.command("extra", hidden=True)(function)

    yield add
    app.registered_commands[:] = known


def test_help_lists_every_command(capsys: pytest.CaptureFixture) -> None:
    assert left_with(["--help"]) == 0
    shown = capsys.readouterr().out
    assert all(f"\n  {command} " in shown for command in COMMANDS)


def test_nothing_heavy_is_imported_for_help() -> None:
    code = (
        "import sys\nfrom granbench.cli import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n"
        f"    print([name for name in {HEAVY} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_version_is_the_package_version(capsys: pytest.CaptureFixture) -> None:
    assert left_with(["--version"]) == 0
    assert capsys.readouterr().out.strip() == granbench.__version__


def test_the_module_is_the_command() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "granbench", "--version"], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == granbench.__version__


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["nonsense"], "nonsense"),
        (["--nonsense"], "--nonsense"),
        (["data", "nonsense"], "nonsense"),
        (["data", "fetch"], "granbench data fetch --help"),
        (["evaluate", "lstm", "--nonsense"], "--nonsense"),
        (["train", "lstm", "--out", "run", "--seed", "many"], "--seed"),
    ],
)
def test_a_wrong_word_is_one_sentence_with_a_remedy(
    words: list[str], named: str, capsys: pytest.CaptureFixture
) -> None:
    assert left_with(words) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ")
    assert said.count("\n") == 1
    assert named in said
    assert "--help`" in said


@pytest.mark.parametrize("words", [[], ["data"], ["leaderboard"]])
def test_without_words_the_help_is_shown(words: list[str], capsys: pytest.CaptureFixture) -> None:
    assert left_with(words) == 2
    assert capsys.readouterr().err.startswith("Usage: granbench")


def test_an_error_of_the_user_is_its_text_and_no_traceback(
    extra_command, capsys: pytest.CaptureFixture
) -> None:
    def fails() -> None:
        raise DatasetError("a.nc: variable 'stress' is missing; add it")

    extra_command(fails)
    assert left_with(["extra"]) == 2
    captured = capsys.readouterr()
    assert captured.err == "error: a.nc: variable 'stress' is missing; add it\n"
    assert captured.out == ""


def test_an_error_of_the_program_is_not_hidden(extra_command) -> None:
    def fails() -> None:
        raise ZeroDivisionError

    extra_command(fails)
    with pytest.raises(ZeroDivisionError):
        main(["extra"])


@pytest.mark.parametrize("stop", [KeyboardInterrupt, typer.Abort])
def test_ctrl_c_says_how_to_continue(
    stop: type[BaseException], extra_command, capsys: pytest.CaptureFixture
) -> None:
    def stopped() -> None:
        raise stop

    extra_command(stopped)
    assert left_with(["extra"]) == 130
    assert "continues" in capsys.readouterr().err


def test_the_exit_code_of_a_command_is_kept(extra_command) -> None:
    def leaves() -> None:
        raise typer.Exit(3)

    extra_command(leaves)
    assert left_with(["extra"]) == 3


def test_a_reader_that_leaves_early_is_no_error() -> None:
    command = f"{sys.executable} -m granbench data list --json | head -c 1"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=True)
    assert done.stderr == ""
