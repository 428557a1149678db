"""The resumable executor of all generators: runs jobs that depend on each other, once each.

A job is a pure function of its configuration and seed and of the results of the jobs that it
needs. It runs in a process of its own and leaves a folder of files, which appears whole or not at
all. Whatever is killed or damaged, running the campaign again continues it and gives the same
files.
"""

import queue
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as RichProgress

from granbench.errors import ConfigurationError, EngineError
from granbench.generators.attempt import Outcome, Request
from granbench.generators.campaign_folder import CampaignFolder
from granbench.generators.schedule import Job, Schedule, digests
from granbench.generators.workers import DaskWorkers, LocalWorkers, find_scheduler

__all__ = ["CampaignReport", "Job", "run_campaign"]

ATTEMPTS = 3
"""How often a job is started in one run whose process ends without an explanation."""
JOBS_NAMED = 3
BAR_WIDTH = 24
COLUMNS_WIDTH = 32

Progress = Literal["bar", "quiet"]


@dataclass(frozen=True)
class CampaignReport:
    """What a campaign has come to.

    Attributes
    ----------
    done : result folder of every finished job, in the order of the jobs
    failed : reason, by key, of every job without a result
    physical : those of `failed` that ended by their own physics, or that need one which did;
        trying again would not help
    skipped : the finished jobs whose results were there before
    not_needed : jobs without a result that nobody needed, as all their users were finished before
    damaged : what was wrong, by key, with results that were found damaged and made again
    """

    done: dict[str, Path]
    failed: dict[str, str]
    physical: frozenset[str]
    skipped: tuple[str, ...]
    not_needed: tuple[str, ...]
    damaged: dict[str, str]

    def require_every_result(self, dataset: str, *, physical_failures: bool = False) -> None:
        """Make sure that a dataset is not written without the jobs that it consists of.

        Parameters
        ----------
        dataset : name for the error
        physical_failures : whether the design of the dataset leaves out jobs that ended by their
            own physics

        Raises
        ------
        EngineError : a job has no result; the text names the jobs and the remedy
        """
        excused = self.physical if physical_failures else frozenset()
        missing = {key: reason for key, reason in self.failed.items() if key not in excused}
        if not missing:
            return
        first = [f"{key} ({reason})" for key, reason in list(missing.items())[:JOBS_NAMED]]
        more = len(missing) - len(first)
        names = "; ".join([*first, f"and {more} more"] if more else first)
        again = "run the same command again, which runs only what is missing"
        if missing.keys() <= self.physical:
            again = "change what the jobs are asked for, or add --retry-failed to try them again"
        raise EngineError(
            f"{dataset} is incomplete and was not written: {len(missing)} of "
            f"{len(self.failed) + len(self.done)} jobs have no result: {names}; {again}"
        )


def run_campaign(
    jobs: Sequence[Job],
    folder: Path,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    progress: Progress = "bar",
    retry_failed: bool = False,
) -> CampaignReport:
    """Run every job that has no result in the folder yet.

    Parameters
    ----------
    jobs : in the order of their priority; a job starts when all that it needs is done
    folder : of the campaign; on a cluster, one that all workers share
    workers : jobs at a time on this machine
    scheduler : address of a dask scheduler whose workers take the jobs instead
    progress : a bar on the screen, or nothing
    retry_failed : also try jobs again that ended by their own physics in an earlier run

    Returns
    -------
    CampaignReport over all jobs; a job that failed is in `failed` and does not stop the others

    Raises
    ------
    ConfigurationError : the jobs contradict each other or the folder's earlier results; the folder
        is in use or cannot be written; nobody answers at `scheduler`
    EngineError : the scheduler was lost
    KeyboardInterrupt : Ctrl-C; the jobs under way are stopped, run again to continue
    """
    if workers < 1:
        raise ConfigurationError(f"workers must be at least 1, not {workers}")
    schedule = Schedule(jobs)
    if scheduler and not folder.exists():
        # A campaign that has not begun leaves no folder behind when its workers cannot be
        # reached; one that has may be finished, and need none.
        find_scheduler(scheduler)
    place = CampaignFolder(folder)
    with place.locked(), place.explained_errors():
        campaign = _Campaign(schedule, place)
        campaign.take_up(retry_failed=retry_failed)
        if campaign.open_count():
            with place.open_run() as run:
                team = DaskWorkers(scheduler, run) if scheduler else LocalWorkers(workers, run)
                with closing(team), _shown(progress, campaign) as show:
                    campaign.run(team, run, show)
        return campaign.report()


class _Campaign:
    """One command's work on a campaign: the schedule, the folder, and what is known of each job."""

    def __init__(self, schedule: Schedule, place: CampaignFolder) -> None:
        self.schedule = schedule
        self.place = place
        self.digests = digests(schedule)
        self.done: set[str] = set()
        self.failed: dict[str, str] = {}
        self.physical: set[str] = set()
        self.damaged: dict[str, str] = {}
        self.not_needed: set[str] = set()
        self.skipped: tuple[str, ...] = ()
        self.running: dict[str, None] = {}
        self._tries = dict.fromkeys(schedule.jobs, 0)

    def take_up(self, *, retry_failed: bool) -> None:
        """Count what earlier commands have left in the folder."""
        failures: dict[str, str] = {}
        for key, job in self.schedule.jobs.items():
            result = self.place.result(job.slug)
            failure = self.place.failure(job.slug)
            for earlier in (result, failure):
                if earlier is not None and earlier["digest"] != self.digests[key]:
                    raise ConfigurationError(_difference(job, earlier, self.place.root))
            if damage := self.place.damage(job.slug, result):
                self.damaged[key] = damage
                self.place.log(f"damaged {key}: {damage}; it is run again")
                self.place.discard(job.slug)
            elif result is not None:
                self.done.add(key)
                self.schedule.finish(key)
            elif failure is not None and failure.get("physical") is True and not retry_failed:
                failures[key] = failure["reason"]
        self.skipped = tuple(key for key in self.schedule.jobs if key in self.done)
        for key, reason in failures.items():
            if key not in self.failed:
                self.failed[key] = reason
                self.physical.add(key)
                self._stop_users(key)
        self._leave_out()

    def _leave_out(self) -> None:
        """Leave out jobs whose results only served others that need nothing any more.

        So a campaign can be continued on another machine from its final results alone, without
        the bulky ones (the restart files of a specimen) in between.
        """
        for key in reversed(self.schedule.order):
            settled = self.done | self.failed.keys() | self.not_needed
            users = self.schedule.users(key)
            absent = key not in settled and key not in self.damaged
            if users and absent and settled.issuperset(users):
                self.not_needed.add(key)
                self.schedule.drop(key)

    def open_count(self) -> int:
        """Return how many jobs are still to be run."""
        return len(self.schedule.jobs) - len(self.done) - len(self.failed) - len(self.not_needed)

    def run(self, team: LocalWorkers | DaskWorkers, run: Path, show: Callable[[], None]) -> None:
        """Hand every job that can run to the workers, and take in how it ended."""
        ended: queue.SimpleQueue[tuple[str, Any]] = queue.SimpleQueue()
        while True:
            while len(self.running) < team.capacity and (job := self.schedule.take()):
                self.running[job.key] = None
                self._tries[job.key] += 1
                handed = team.submit(self._request(job, run), self.schedule.rank[job.key])
                handed.add_done_callback(lambda ended_one, key=job.key: ended.put((key, ended_one)))
            show()
            if not self.running:
                return
            key, handed = ended.get()
            outcome = team.outcome(handed)
            del self.running[key]
            self._settle(self.schedule.jobs[key], outcome)

    def report(self) -> CampaignReport:
        """Return what is known now."""
        jobs = self.schedule.jobs
        return CampaignReport(
            done={k: self.place.results / job.slug for k, job in jobs.items() if k in self.done},
            failed={key: self.failed[key] for key in jobs if key in self.failed},
            skipped=self.skipped,
            physical=frozenset(self.physical),
            not_needed=tuple(key for key in jobs if key in self.not_needed),
            damaged={key: self.damaged[key] for key in jobs if key in self.damaged},
        )

    def _request(self, job: Job, run: Path) -> Request:
        needed = {key: self.schedule.jobs[key].slug for key in job.needs}
        return Request(
            key=job.key,
            slug=job.slug,
            digest=self.digests[job.key],
            job=job.plain(),
            inputs={key: str(self.place.results / slug) for key, slug in needed.items()},
            run=run,
            results=self.place.results,
        )

    def _settle(self, job: Job, outcome: Outcome) -> None:
        seconds = f"{outcome.seconds:.1f} s"
        if outcome.kind == "done":
            self.done.add(job.key)
            self.place.forget_failure(job.slug)
            self.place.log(f"done {job.key} {seconds}")
            self.schedule.finish(job.key)
        elif outcome.kind == "killed" and self._tries[job.key] < ATTEMPTS:
            self.place.log(f"again {job.key} {seconds}: {outcome.reason}")
            self.schedule.put_back(job.key)
        elif outcome.kind in ("killed", "failed"):
            times = f", {ATTEMPTS} times" if outcome.kind == "killed" else ""
            self._record_failure(job, outcome.reason + times, outcome)
            self._stop_users(job.key)
        elif outcome.kind == "closed":
            raise ConfigurationError(
                f"{outcome.reason}; name a folder with --out that all workers share"
            )
        else:
            raise ConfigurationError(
                f"job {job.key} cannot be run: {outcome.reason}; correct that and run the same "
                "command again to continue"
            )

    def _record_failure(self, job: Job, reason: str, outcome: Outcome) -> None:
        self.failed[job.key] = reason
        if outcome.physical:
            self.physical.add(job.key)
        self.place.record_failure(
            job.slug,
            {
                "key": job.key,
                "digest": self.digests[job.key],
                "reason": reason,
                "physical": outcome.physical,
                "seconds": round(outcome.seconds, 3),
                "messages": outcome.messages,
                "needs": sorted(job.needs),
                **job.plain(),
            },
        )
        self.place.log(f"failed {job.key} {outcome.seconds:.1f} s: {reason}")

    def _stop_users(self, key: str) -> None:
        # Recorded as not physical: when the need succeeds in a later run, they run as well.
        for user, need in self.schedule.fail(key):
            job, reason = self.schedule.jobs[user], f"needs {need}, which failed"
            if need in self.physical:
                self.physical.add(user)
            known = self.place.failure(job.slug)
            if known is not None and known["reason"] == reason:
                self.failed[user] = reason
            else:
                self._record_failure(job, reason, Outcome("failed"))


def _difference(job: Job, earlier: dict[str, Any], folder: Path) -> str:
    """Say which setting of a job is not what it was when the folder's record was made."""
    now = job.plain()
    settings = {name: earlier.get(name) for name in now}
    detail = f"a job that it needs ({', '.join(job.needs)}) was different"
    for name in ("function", "seed"):
        if settings[name] != now[name]:
            detail = f"{name} was {settings[name]} and is {now[name]} now"
    was, new = settings["configuration"] or {}, now["configuration"]
    for name in sorted({*was, *new}):
        if was.get(name) != new.get(name):
            detail = f"{name} was {was.get(name)} and is {new.get(name)} now"
            break
    return (
        f"the campaign folder {folder} holds job {job.key} with other settings: {detail}; name "
        "another folder with --out, or give the earlier settings and --seed"
    )


@contextmanager
def _shown(progress: Progress, campaign: _Campaign) -> Iterator[Callable[[], None]]:
    """Show a bar while the campaign runs; the function that it gives brings it up to date."""
    bar = RichProgress(
        BarColumn(BAR_WIDTH),
        MofNCompleteColumn(),
        TextColumn("jobs, left"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[current]}", style="dim", markup=False),
        console=Console(stderr=True),
        # Jobs take minutes: the time that is left follows from the speed of the last hour.
        speed_estimate_period=3600.0,
        disable=progress == "quiet",
    )
    room = max(bar.console.width - BAR_WIDTH - COLUMNS_WIDTH, 0)
    task = bar.add_task("", total=len(campaign.schedule.jobs), current="")

    def show() -> None:
        failed = [f"{len(campaign.failed)} failed"] if campaign.failed else []
        current = "; ".join([*failed, *campaign.running])
        ended = len(campaign.schedule.jobs) - campaign.open_count()
        bar.update(task, completed=ended, current=current[:room])

    with bar:
        yield show
