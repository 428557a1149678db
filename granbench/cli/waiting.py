"""What is said of long work where no bar shows it: in a log, a pipe or a notebook."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from granbench.cli.printing import note

SECONDS_BETWEEN_NOTES = 20.0


@contextmanager
def spoken_progress(state: Callable[[], str], hidden: bool) -> Iterator[None]:
    """Note on standard error, every `SECONDS_BETWEEN_NOTES`, how far the block is.

    Parameters
    ----------
    state : says it, in words
    hidden : whether nothing is said, as where a bar shows it or the user asked for silence
    """
    if hidden:
        yield
        return
    ended = threading.Event()

    def speak() -> None:
        seconds = SECONDS_BETWEEN_NOTES
        while not ended.wait(SECONDS_BETWEEN_NOTES):
            note(f"{state()} after {seconds:g} s")
            seconds += SECONDS_BETWEEN_NOTES

    speaker = threading.Thread(target=speak, daemon=True)
    speaker.start()
    try:
        yield
    finally:
        ended.set()
        speaker.join()
