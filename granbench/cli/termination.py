"""SIGTERM, which batch systems and `timeout` send, ends a command as Ctrl-C does."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

import typer

TERMINATED = 128 + signal.SIGTERM
"""Exit code of a command that SIGTERM ended, as shells have it."""


class _Terminated(KeyboardInterrupt):
    """What Ctrl-C raises, so that all that stops for it stops for SIGTERM as well."""


@contextmanager
def stopped_by_sigterm(again: str = "to continue") -> Iterator[None]:
    """Let SIGTERM unwind the block as Ctrl-C would, and say how to continue.

    Parameters
    ----------
    again : what running the same command again does

    Raises
    ------
    typer.Exit
        With the code `TERMINATED`, when SIGTERM came.
    """
    before = signal.signal(signal.SIGTERM, _stop)
    try:
        yield
    except _Terminated:
        typer.echo(f"terminated; run the same command again {again}", err=True)
        raise typer.Exit(TERMINATED) from None
    finally:
        signal.signal(signal.SIGTERM, before or signal.SIG_DFL)


def _stop(number: int, frame: object) -> NoReturn:
    # `timeout` sends it to the process and to its group: the second must not interrupt the
    # stopping of the jobs.
    signal.signal(signal.SIGTERM, lambda number, frame: None)
    raise _Terminated
