"""One run of a campaign: every job that has no result yet is run.

A job is a pure function of its configuration and seed and of the results of the jobs that it
needs. It runs in its own process and leaves a folder of files, which appears whole or not at all.
After an interruption, or after files were damaged, running the campaign again continues it and
gives the same files.
"""

import queue
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from granbench.errors import ConfigurationError
from granbench.generators.campaign.attempt import Outcome, Request
from granbench.generators.campaign.folder import CampaignFolder
from granbench.generators.campaign.progress import ProgressMode, shown_progress
from granbench.generators.campaign.report import CampaignReport
from granbench.generators.campaign.schedule import Job, Schedule, digests
from granbench.generators.campaign.workers import DaskWorkers, LocalWorkers, find_scheduler

ATTEMPTS = 3
"""How many times one run starts a job whose process ends without giving a reason."""


def run_campaign(
    jobs: Sequence[Job],
    folder: Path,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    progress: ProgressMode = "bar",
    retry_failed: bool = False,
) -> CampaignReport:
    """Run every job that has no result in the folder yet.

    Parameters
    ----------
    jobs : in order of priority; a job starts when all jobs that it needs are done
    folder : of the campaign; on a cluster, one that all workers share
    workers : number of jobs that run at the same time on this machine
    scheduler : address of a dask scheduler whose workers run the jobs instead
    progress : `bar` shows a progress bar, `quiet` shows nothing
    retry_failed : also run jobs again that failed permanently in an earlier run

    Returns
    -------
    CampaignReport over all jobs; a job that failed is in `failed` and does not stop the others

    Raises
    ------
    ConfigurationError
        If the jobs contradict each other or the folder's earlier results, the folder is in use or
        cannot be written, or no scheduler answers.
    EngineError
        If the connection to the scheduler was lost.
    KeyboardInterrupt
        After Ctrl-C; the running jobs are stopped, and running the campaign again continues it.
    """
    if workers < 1:
        raise ConfigurationError(f"workers must be at least 1, not {workers}")
    schedule = Schedule(jobs)
    if scheduler and not folder.exists():
        # A new campaign leaves no folder behind when its workers cannot be reached; one that
        # exists may be finished and need no workers.
        find_scheduler(scheduler)
    place = CampaignFolder(folder)
    with place.locked(), place.explained_errors():
        campaign = _Campaign(schedule, place)
        campaign.read_earlier_runs(retry_failed=retry_failed)
        if campaign.open_count():
            with place.open_run() as run:
                team = DaskWorkers(scheduler, run) if scheduler else LocalWorkers(workers, run)
                with closing(team), shown_progress(progress, campaign) as redraw:
                    campaign.run(team, run, redraw)
        return campaign.report()


class _Campaign:
    """The state of one run: the schedule, the folder, and what is known of each job."""

    def __init__(self, schedule: Schedule, place: CampaignFolder) -> None:
        self.schedule = schedule
        self.place = place
        self.digests = digests(schedule)
        self.done: set[str] = set()
        self.failed: dict[str, str] = {}
        self.permanent: set[str] = set()
        self.damaged: dict[str, str] = {}
        self.not_needed: set[str] = set()
        self.skipped: tuple[str, ...] = ()
        self.running: dict[str, None] = {}
        self._tries = dict.fromkeys(schedule.jobs, 0)

    def read_earlier_runs(self, *, retry_failed: bool) -> None:
        """Take over the results and failures that earlier runs left in the folder."""
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
            elif failure is not None and failure.get("permanent") is True and not retry_failed:
                failures[key] = failure["reason"]
        self.skipped = tuple(key for key in self.schedule.jobs if key in self.done)
        for key, reason in failures.items():
            if key not in self.failed:
                self.failed[key] = reason
                self.permanent.add(key)
                self._stop_users(key)
        self._drop_unneeded()

    def _drop_unneeded(self) -> None:
        """Drop jobs whose results are only used by jobs that are settled already.

        A campaign can therefore be continued on another machine from its last results alone,
        without the bulky ones in between.
        """
        for key in reversed(self.schedule.order):
            settled = self.done | self.failed.keys() | self.not_needed
            users = self.schedule.users(key)
            absent = key not in settled and key not in self.damaged
            if users and absent and settled.issuperset(users):
                self.not_needed.add(key)
                self.schedule.drop(key)

    def job_count(self) -> int:
        """Number of all jobs."""
        return len(self.schedule.jobs)

    def open_count(self) -> int:
        """Number of jobs that are still to be run."""
        return self.job_count() - len(self.done) - len(self.failed) - len(self.not_needed)

    def run(self, team: LocalWorkers | DaskWorkers, run: Path, redraw: Callable[[], None]) -> None:
        """Submit every job that can run to the workers, and record how it ended."""
        ended: queue.SimpleQueue[tuple[str, Any]] = queue.SimpleQueue()
        while True:
            while len(self.running) < team.capacity and (job := self.schedule.take()):
                self.running[job.key] = None
                self._tries[job.key] += 1
                future = team.submit(self._request(job, run), self.schedule.rank[job.key])
                future.add_done_callback(lambda finished, key=job.key: ended.put((key, finished)))
            redraw()
            if not self.running:
                return
            key, future = ended.get()
            outcome = team.outcome(future)
            del self.running[key]
            self._settle(self.schedule.jobs[key], outcome)

    def report(self) -> CampaignReport:
        """Return what is known now."""
        jobs = self.schedule.jobs
        return CampaignReport(
            done={k: self.place.results / job.slug for k, job in jobs.items() if k in self.done},
            failed={key: self.failed[key] for key in jobs if key in self.failed},
            permanent=frozenset(self.permanent),
            skipped=self.skipped,
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
            raise ConfigurationError(f"{outcome.reason}; choose a folder that all workers share")
        else:
            raise ConfigurationError(
                f"job {job.key} cannot be run: {outcome.reason}; correct that and run the same "
                "campaign again to continue"
            )

    def _record_failure(self, job: Job, reason: str, outcome: Outcome) -> None:
        self.failed[job.key] = reason
        if outcome.permanent:
            self.permanent.add(job.key)
        self.place.record_failure(
            job.slug,
            {
                "key": job.key,
                "digest": self.digests[job.key],
                "reason": reason,
                "permanent": outcome.permanent,
                "seconds": round(outcome.seconds, 3),
                "messages": outcome.messages,
                "needs": sorted(job.needs),
                **job.plain(),
            },
        )
        self.place.log(f"failed {job.key} {outcome.seconds:.1f} s: {reason}")

    def _stop_users(self, key: str) -> None:
        # Not recorded as permanent: they run in a later run, once the job that they need succeeds.
        for user, need in self.schedule.fail(key):
            job, reason = self.schedule.jobs[user], f"needs {need}, which failed"
            if need in self.permanent:
                self.permanent.add(user)
            known = self.place.failure(job.slug)
            if known is not None and known["reason"] == reason:
                self.failed[user] = reason
            else:
                self._record_failure(job, reason, Outcome("failed"))


def _difference(job: Job, earlier: dict[str, Any], folder: Path) -> str:
    """Error message that names the setting of a job which has changed since an earlier run."""
    now = job.plain()
    settings = {name: earlier.get(name) for name in now}
    detail = f"a job that it needs ({', '.join(job.needs)}) was different"
    for name in ("function", "seed"):
        if settings[name] != now[name]:
            detail = f"{name} was {settings[name]} and is {now[name]} now"
    before, after = settings["configuration"] or {}, now["configuration"]
    for name in sorted({*before, *after}):
        if before.get(name) != after.get(name):
            detail = f"{name} was {before.get(name)} and is {after.get(name)} now"
            break
    return (
        f"the campaign folder {folder} holds job {job.key} with other settings: {detail}; choose "
        "another folder, or give the earlier settings and seed"
    )
