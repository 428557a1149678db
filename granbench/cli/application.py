"""The `granbench` application: command groups, and errors as one sentence.

The modules of the commands import what is heavy (torch, xarray, matplotlib) inside their
functions, so that ``granbench --help`` is fast.
"""

import logging
import sys
import warnings
from collections.abc import Sequence
from typing import Annotated, NoReturn

import typer

from granbench import __version__
from granbench.cli import (
    data,
    drive,
    evaluate,
    fem,
    fit,
    generate,
    leaderboard,
    submission,
    task,
    train,
)
from granbench.cli.generated_help import CommandWithNames
from granbench.cli.printing import note
from granbench.cli.setting_options import option_text
from granbench.cli.streams import flush_streams, prepare_streams
from granbench.cli.termination import INTERRUPTED
from granbench.errors import GranbenchError
from granbench.files.printable import printable

USER_ERROR = 2

app = typer.Typer(
    name="granbench",
    help="Open benchmark for data-driven geomechanics: generate data, train models, score them.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(__version__)
        raise typer.Exit


@app.callback()
def granbench(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    """Open benchmark for data-driven geomechanics: generate data, train models, score them."""


app.add_typer(data.app, name="data")
app.add_typer(task.app, name="task")
app.command(cls=CommandWithNames)(generate.generate)
app.command(cls=CommandWithNames)(train.train)
app.command(cls=CommandWithNames)(evaluate.evaluate)
app.command(cls=CommandWithNames)(drive.drive)
app.command(cls=CommandWithNames)(fit.fit)
app.command(cls=CommandWithNames)(fem.fem)
app.add_typer(submission.app, name="submission")
app.add_typer(leaderboard.app, name="leaderboard")


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the application and leave with its exit code.

    Parameters
    ----------
    arguments : words after `granbench`; by default those of the process

    Raises
    ------
    SystemExit
        Always: 0 when done, 2 after an error that the user can fix (one line on stderr),
        130 after Ctrl-C.
    """
    prepare_streams()
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # warnings of third parties are for developers
    words = sys.argv[1:] if arguments is None else list(arguments)
    notes = _notes(silent=not {"--quiet", "-q"}.isdisjoint(words))
    try:
        code = app(words, prog_name="granbench", standalone_mode=False)
    except GranbenchError as error:
        _fail(error.spelled(option_text))
    except typer.Abort:
        code = INTERRUPTED
    except Exception as error:
        _fail(_usage_error(error))
    finally:
        logging.getLogger("granbench").removeHandler(notes)
    if code == INTERRUPTED:
        typer.echo(
            "interrupted; run the same command again, which continues where possible", err=True
        )
    _leave(code if isinstance(code, int) else 0)


class _Notes(logging.Handler):
    """Log messages of the library, such as that it makes a dataset, as notes on stderr."""

    def emit(self, record: logging.LogRecord) -> None:
        note(record.getMessage())


def _notes(silent: bool) -> logging.Handler:
    handler = logging.NullHandler() if silent else _Notes()
    logger = logging.getLogger("granbench")
    logger.setLevel(logging.WARNING if silent else logging.INFO)
    logger.addHandler(handler)
    return handler


def _fail(sentence: str) -> NoReturn:
    text = sentence if sentence.startswith("Usage:") else f"error: {sentence}"
    typer.echo(printable(text), err=True)
    _leave(USER_ERROR)


def _leave(code: int) -> NoReturn:
    """Exit, with an error if standard output could not be written."""
    failure = flush_streams()
    if failure is not None and code == 0:
        typer.echo(
            f"error: standard output cannot be written ({failure.strerror}); files that the "
            "command writes are complete; send its output somewhere else",
            err=True,
        )
        flush_streams()
        code = USER_ERROR
    sys.exit(code)


def _usage_error(error: Exception) -> str:
    """Text of a usage error of typer; any other exception is raised again.

    typer's usage errors are click's own or copies of them, by version; only the method is
    the same in all.
    """
    format_message = getattr(error, "format_message", None)
    if format_message is None:
        raise error
    message = str(format_message()).rstrip()
    context = getattr(error, "ctx", None)
    if message.startswith("Usage:") or context is None:
        return message
    link = " See" if message.endswith("?") else "; see"
    return f"{message.rstrip('.')}{link} `{context.command_path} --help`"
