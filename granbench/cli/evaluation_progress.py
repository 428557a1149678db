"""The progress bar of an evaluation."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn


@contextmanager
def evaluation_bar(runs: int, name: str, hidden: bool) -> Iterator[Callable[[int, str], None]]:
    """A bar on the terminal's stderr that moves with every part of an evaluation."""
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    )  # fmt: skip
    hidden = hidden or not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=hidden) as progress:
        job = progress.add_task(f"evaluating {name}", total=runs)

        def advance(seed: int, done: str) -> None:
            progress.update(job, advance=1, description=f"{name}, seed {seed}: {done}")

        yield advance
