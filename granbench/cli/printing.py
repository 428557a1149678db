"""Output of commands: JSON, notes, and tables without truncated cells."""

import json
from typing import Any

import typer
from rich.console import Console, RenderableType
from rich.measure import Measurement
from rich.table import Table

from granbench.cli.streams import shows_unicode
from granbench.files.printable import printable

UNLIMITED = 1_000_000
"""Columns of a pipe or file, in which no line is broken: `grep` finds whole names."""


def say(text: object, *, err: bool = False) -> None:
    """Print a text; control characters from a file are shown as escapes."""
    typer.echo(printable(text), err=err)


def print_json(value: Any) -> None:
    """Print a value as JSON; characters that the console cannot show are escaped."""
    say(json.dumps(value, indent=2, ensure_ascii=not shows_unicode()))


def note(text: str) -> None:
    """Print a note on standard error; the command goes on."""
    say(f"note: {text}", err=True)


def show(*parts: RenderableType, style: str | None = None) -> None:
    """Print tables and texts on standard output without truncating them.

    In a pipe or file a line is as long as it needs to be. On a terminal columns are folded at
    spaces; where it is narrower than the longest words of a table, the table is as wide as these.
    """
    console = Console(markup=False, highlight=False)
    terminal = console.width if console.file.isatty() else UNLIMITED
    options = console.options.update(max_width=UNLIMITED)
    for part in parts:
        if isinstance(part, Table):
            for column in part.columns:
                column.overflow = "fold"
                # rich would break names to leave room for sentences.
                column.no_wrap = not any(" " in str(cell) for cell in column.cells)
        console.width = max(terminal, Measurement.get(console, options, part).minimum)
        console.print(part, style=style)
