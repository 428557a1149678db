"""The progress bar of an evaluation."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from granbench.cli.progress import progress_bar


@contextmanager
def evaluation_bar(runs: int, name: str, hidden: bool) -> Iterator[Callable[[int, str], None]]:
    """A bar that moves with every part of an evaluation."""
    with progress_bar(f"evaluating {name}", runs, hidden=hidden) as bar:
        yield lambda seed, done: bar.advance(f"{name}, seed {seed}: {done}")
