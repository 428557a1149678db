"""Progress of a command: a bar on a terminal, notes in a log, a pipe or a notebook."""

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Literal

from rich.console import Console
from rich.progress import (
    BarColumn,
    DownloadColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TransferSpeedColumn,
)

from granbench.cli.printing import note

SECONDS_BETWEEN_NOTES = 20.0

Shown = Literal["count", "share", "bytes"]
COLUMNS: Mapping[Shown, Sequence[type[ProgressColumn]]] = {
    "count": (MofNCompleteColumn, TimeElapsedColumn),
    "share": (TimeElapsedColumn,),
    "bytes": (DownloadColumn, TransferSpeedColumn),
}
"""Columns behind a bar, by the kind of its numbers."""


class Bar:
    """A progress bar; if its total is not known before, it appears with its first number.

    Parameters
    ----------
    progress : of rich
    text : before the bar
    total : the number at which the bar is full; None if `move` gives it
    """

    def __init__(self, progress: Progress, text: str, total: float | None) -> None:
        self._progress = progress
        self._text = text
        self._task: TaskID | None = None
        if total is not None:
            self._task = progress.add_task(text, total=total)

    def move(self, done: float, total: float | None = None, text: str | None = None) -> None:
        """Move the bar to a number.

        Parameters
        ----------
        done : number that is done
        total : the number at which the bar is full, if it has changed
        text : before the bar, if it has changed
        """
        if self._task is None:
            self._task = self._progress.add_task(self._text, total=total)
        self._progress.update(self._task, completed=done, total=total, description=text)

    def advance(self, text: str | None = None) -> None:
        """Move the bar by one.

        Parameters
        ----------
        text : before the bar, if it has changed
        """
        if self._task is not None:
            self._progress.update(self._task, advance=1, description=text)


def shows_bar(hidden: bool = False) -> bool:
    """Whether `progress_bar` shows anything: on a terminal, unless the user asked for silence."""
    return not hidden and Console(stderr=True).is_terminal


@contextmanager
def progress_bar(
    text: str, total: float | None = None, *, shown: Shown = "count", hidden: bool = False
) -> Iterator[Bar]:
    """A bar on the terminal's standard error while the block runs.

    Parameters
    ----------
    text : before the bar
    total : the number at which the bar is full; None if `Bar.move` gives it
    shown : kind of numbers behind the bar, a key of `COLUMNS`
    hidden : whether nothing is shown, as under --quiet
    """
    columns = (TextColumn("{task.description}"), BarColumn(), *(make() for make in COLUMNS[shown]))
    with Progress(
        *columns, console=Console(stderr=True), transient=True, disable=not shows_bar(hidden)
    ) as progress:
        yield Bar(progress, text, total)


@contextmanager
def progress_notes(state: Callable[[], str], hidden: bool) -> Iterator[None]:
    """Report on standard error, every `SECONDS_BETWEEN_NOTES`, how far the block is.

    Parameters
    ----------
    state : returns the progress in words
    hidden : whether nothing is reported, because a bar shows it or the user asked for silence
    """
    if hidden:
        yield
        return
    ended = threading.Event()

    def write_notes() -> None:
        seconds = SECONDS_BETWEEN_NOTES
        while not ended.wait(SECONDS_BETWEEN_NOTES):
            note(f"{state()} after {seconds:g} s")
            seconds += SECONDS_BETWEEN_NOTES

    writer = threading.Thread(target=write_notes, daemon=True)
    writer.start()
    try:
        yield
    finally:
        ended.set()
        writer.join()
