"""The progress bar of a campaign."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Literal, Protocol

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

BAR_WIDTH = 24
COLUMNS_WIDTH = 32

ProgressMode = Literal["bar", "quiet"]


class Countable(Protocol):
    """A campaign whose progress can be shown.

    Parameters
    ----------
    running : keys of the jobs that are running
    failed : reason, by key, of every failed job
    """

    running: dict[str, None]
    failed: dict[str, str]

    def job_count(self) -> int:
        """Number of all jobs."""

    def open_count(self) -> int:
        """Number of jobs that have neither a result nor a failure yet."""


@contextmanager
def shown_progress(mode: ProgressMode, campaign: Countable) -> Iterator[Callable[[], None]]:
    """Show a progress bar on standard error while the block runs.

    Parameters
    ----------
    mode : `bar`, or `quiet` to show nothing
    campaign : whose jobs are counted

    Yields
    ------
    Function without arguments that redraws the bar
    """
    bar = Progress(
        BarColumn(BAR_WIDTH),
        MofNCompleteColumn(),
        TextColumn("jobs, left"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[current]}", style="dim", markup=False),
        console=Console(stderr=True),
        # Jobs take minutes, so the remaining time is estimated from the last hour.
        speed_estimate_period=3600.0,
        disable=mode == "quiet",
    )
    room = max(bar.console.width - BAR_WIDTH - COLUMNS_WIDTH, 0)
    total = campaign.job_count()
    task = bar.add_task("", total=total, current="")

    def redraw() -> None:
        failed: Iterable[str] = [f"{len(campaign.failed)} failed"] if campaign.failed else []
        current = "; ".join([*failed, *campaign.running])
        bar.update(task, completed=total - campaign.open_count(), current=current[:room])

    with bar:
        yield redraw
