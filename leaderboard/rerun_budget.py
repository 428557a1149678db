"""The budget of a model that is run again, checked from its files before the model is built."""

import json
import math
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

from granbench.errors import SubmissionError
from granbench.leaderboard.submission import ModelFile, ModelReference

MOST_SEEDS = 10
FILES_PER_SEED = 3
MOST_BYTES = 64_000_000
"""Size of all files of a model together."""

MOST_PARAMETERS = 2_000_000
"""Parameters of one seed. The networks of GranBench have up to 15,000."""

MOST_TENSORS = 1_000
LARGEST_HEADER = 1_000_000
LARGEST_DESCRIPTION = 1_000_000
"""Bytes of a safetensors header, and of a JSON file."""

SECONDS_PER_SEED = 3600.0
LARGEST_SEED = 2**63 - 1


def check_budget(seeds: Sequence[int], model: ModelReference, path: Path) -> None:
    """Refuse a model that exceeds the budget of a rerun.

    Parameters
    ----------
    seeds : of the submission
    model : the reference in the submission
    path : the submission's JSON file, the model's files beside it

    Raises
    ------
    SubmissionError
        If it is too large; the text names the size and the limit.
    """
    if len(seeds) > MOST_SEEDS:
        raise SubmissionError(
            f"{path}: has {len(seeds)} seeds; a model is run again for at most {MOST_SEEDS}, "
            "submit fewer"
        )
    if wrong := [seed for seed in seeds if not 0 <= seed <= LARGEST_SEED]:
        raise SubmissionError(
            f"{path}: seed {_short(wrong[0])} must be from 0 to {LARGEST_SEED}; evaluate with "
            "another seed"
        )
    if len(model.files) > FILES_PER_SEED * len(seeds):
        raise SubmissionError(
            f"{path}: its model has {len(model.files)} files for {len(seeds)} seeds; submit at "
            f"most {FILES_PER_SEED} for each"
        )
    total = sum(file.bytes for file in model.files)
    if total > MOST_BYTES:
        raise SubmissionError(
            f"{path}: its model has {total / 1e6:,.0f} MB; at most {MOST_BYTES / 1e6:.0f} MB are "
            "run again, submit its predictions"
        )
    for file in model.files:
        _check_file(file, path)


def _check_file(file: ModelFile, path: Path) -> None:
    place = path.parent / file.path
    if not place.is_file():
        return  # reported where its digest is checked
    try:
        size = place.stat().st_size
        if place.suffix == ".json" and size > LARGEST_DESCRIPTION:
            raise SubmissionError(
                f"{path}: {file.path} has {size:,} bytes; a model's JSON file may have "
                f"{LARGEST_DESCRIPTION:,}"
            )
        if place.suffix == ".safetensors":
            _check_tensors(_header(place, size), file, path)
    except OSError:
        return  # likewise


def _header(place: Path, size: int) -> Any:
    """The header of a safetensors file; None if it is damaged."""
    with place.open("rb") as handle:
        length = int.from_bytes(handle.read(8), "little")
        if length > size:
            return None
        if length > LARGEST_HEADER:
            return {"": {"shape": [math.inf]}}
        try:
            return json.loads(handle.read(length))
        except (ValueError, RecursionError):
            return None


def _check_tensors(header: Any, file: ModelFile, path: Path) -> None:
    if not isinstance(header, dict):
        raise SubmissionError(
            f"{path}: {file.path} is damaged or not a safetensors file; copy it again"
        )
    tensors = {name: about for name, about in header.items() if name != "__metadata__"}
    count = sum(_elements(about) for about in tensors.values())
    if len(tensors) > MOST_TENSORS or count > MOST_PARAMETERS:
        raise SubmissionError(
            f"{path}: {file.path} has {len(tensors):,} tensors with {count:,.0f} numbers; at most "
            f"{MOST_TENSORS:,} with {MOST_PARAMETERS:,} are run again, submit its predictions"
        )


def _elements(about: Any) -> float:
    shape = about.get("shape") if isinstance(about, dict) else None
    if not isinstance(shape, list) or not all(isinstance(size, int | float) for size in shape):
        return math.inf
    return math.prod(float(min(size, 1e300)) for size in shape)


def _short(number: int) -> str:
    return str(number) if abs(number) < 10**30 else "with over 30 digits"


@contextmanager
def time_limit(seconds: float, path: Path) -> Iterator[None]:
    """Stop a run that takes too long; outside of the main thread there is no limit.

    Parameters
    ----------
    seconds : wall-clock time
    path : the submission, for the message

    Raises
    ------
    SubmissionError
        When the time is over.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def over(number: int, frame: FrameType | None) -> None:
        raise SubmissionError(
            f"{path}: running its model again takes more than {seconds / 60.0:.0f} minutes; submit "
            "its predictions"
        )

    before = signal.signal(signal.SIGALRM, over)
    # Repeatedly, because an exception inside an analysis can be taken for a failure of the model.
    signal.setitimer(signal.ITIMER_REAL, seconds, 5.0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
