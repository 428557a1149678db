"""Handling of SIGTERM, sent by batch systems and `timeout`, in the same way as Ctrl-C."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

import typer

INTERRUPTED = 128 + signal.SIGINT
TERMINATED = 128 + signal.SIGTERM
"""Exit codes of a command that Ctrl-C or SIGTERM ended, as in shells."""


class _Terminated(KeyboardInterrupt):
    """Exception for SIGTERM; code that handles Ctrl-C handles it as well."""


@contextmanager
def stopped_by_sigterm(again: str = "to continue") -> Iterator[None]:
    """Let SIGTERM end the block as Ctrl-C does, and print how to continue.

    Parameters
    ----------
    again : effect of running the same command again

    Raises
    ------
    typer.Exit
        With the code `TERMINATED`, when SIGTERM came.
    SystemExit
        With the code `INTERRUPTED`, after Ctrl-C.
    """
    before = signal.signal(signal.SIGTERM, _stop)
    try:
        yield
    except _Terminated:
        typer.echo(f"terminated; run the same command again {again}", err=True)
        raise typer.Exit(TERMINATED) from None
    except KeyboardInterrupt:
        # Not typer's exit, of which the application would say that the command continues.
        typer.echo(f"interrupted; run the same command again {again}", err=True)
        raise SystemExit(INTERRUPTED) from None
    finally:
        signal.signal(signal.SIGTERM, before or signal.SIG_DFL)


def _stop(number: int, frame: object) -> NoReturn:
    # `timeout` sends it to the process and to its group: the second must not interrupt the
    # stopping of the jobs.
    signal.signal(signal.SIGTERM, lambda number, frame: None)
    raise _Terminated
