"""Jobs that depend on each other, and the order in which they run."""

import hashlib
import heapq
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from granbench.errors import ConfigurationError

KEY_PATTERN = re.compile(r"[A-Za-z0-9][A-Za-z0-9.+=-]*(?:[_/][A-Za-z0-9.+=-]+)*")
KEY_LENGTH = 200


@dataclass(frozen=True)
class Job:
    """One unit of work of a campaign.

    Parameters
    ----------
    key : unique name: letters, digits and ``. + = -``, in words joined by ``_`` or ``/``
    function : ``module:function``, called as ``function(configuration, seed, inputs, out)``
        with `inputs` the result folder (Path) of each needed job by key and `out` the folder
        (Path) to write to. The same module may declare which failures are permanent, so that
        another attempt is useless: the exceptions in its tuple ``PERMANENT_FAILURES`` and, where
        a library ends the process without an exception, the sentence that its function
        ``failure_reason(out) -> str | None`` returns.
    configuration : JSON values; everything that the result depends on, except the seed
    seed : of all random numbers of the job
    needs : keys of the jobs whose results this one reads

    Raises
    ------
    ConfigurationError
        If the key cannot name a folder or the configuration is not JSON.
    """

    key: str
    function: str
    configuration: Mapping[str, Any]
    seed: int
    needs: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not KEY_PATTERN.fullmatch(self.key) or len(self.key) > KEY_LENGTH:
            raise ConfigurationError(
                f"job key {self.key!r}: use letters, digits and . + = -, in words joined by single "
                f"_ or /, at most {KEY_LENGTH} characters"
            )
        try:
            plain = json.loads(json.dumps(dict(self.configuration), allow_nan=False))
        except (TypeError, ValueError) as error:
            raise ConfigurationError(
                f"job {self.key}: its configuration must be plain JSON values: {error}"
            ) from error
        object.__setattr__(self, "configuration", MappingProxyType(plain))

    @property
    def slug(self) -> str:
        """The key as the name of a folder; different for different keys."""
        return self.key.replace("/", "__")

    def plain(self) -> dict[str, Any]:
        """Everything that the result depends on, except the needed results, as JSON values."""
        return {
            "function": self.function,
            "configuration": dict(self.configuration),
            "seed": self.seed,
        }


class Schedule:
    """The order of the jobs: next is always the first in the list that has all it needs.

    Parameters
    ----------
    jobs : in order of priority

    Raises
    ------
    ConfigurationError
        If two jobs have one key, a needed job is missing, or jobs need each other in a circle.
    """

    def __init__(self, jobs: Sequence[Job]) -> None:
        self.jobs = {job.key: job for job in jobs}
        if len(self.jobs) < len(jobs):
            keys = [job.key for job in jobs]
            twice = next(key for key in keys if keys.count(key) > 1)
            raise ConfigurationError(f"two jobs of the campaign have the key {twice}")
        self.rank = {key: i for i, key in enumerate(self.jobs)}
        self._keys = tuple(self.jobs)
        self._missing = {job.key: set(job.needs) for job in jobs}
        self._users: dict[str, list[str]] = {key: [] for key in self.jobs}
        for job in jobs:
            for need in self._missing[job.key]:
                if need not in self.jobs:
                    raise ConfigurationError(
                        f"job {job.key} needs {need}, which is not in the campaign"
                    )
                self._users[need].append(job.key)
        self._open = set(self.jobs)
        self._ready = [self.rank[key] for key, missing in self._missing.items() if not missing]
        self.order = tuple(self._topological())

    def _topological(self) -> Iterator[str]:
        left = {key: len(missing) for key, missing in self._missing.items()}
        ready = [self.rank[key] for key, count in left.items() if not count]
        while ready:
            key = self._keys[heapq.heappop(ready)]
            yield key
            del left[key]
            for user in self._users[key]:
                left[user] -= 1
                if not left[user]:
                    heapq.heappush(ready, self.rank[user])
        if left:
            raise ConfigurationError(f"jobs need each other in a circle: {', '.join(sorted(left))}")

    def users(self, key: str) -> tuple[str, ...]:
        """Return the jobs that need this one."""
        return tuple(self._users[key])

    def drop(self, key: str) -> None:
        """Remove a job that no other job needs."""
        self._open.discard(key)

    def take(self) -> Job | None:
        """Return the next job and remove it from the list; None if no job is ready."""
        while self._ready:
            key = self._keys[heapq.heappop(self._ready)]
            if key in self._open:
                self._open.remove(key)
                return self.jobs[key]
        return None

    def put_back(self, key: str) -> None:
        """Put a job that was taken back on the list."""
        self._open.add(key)
        heapq.heappush(self._ready, self.rank[key])

    def finish(self, key: str) -> None:
        """Record that a job is done, which may make other jobs ready."""
        self._open.discard(key)
        for user in self._users[key]:
            self._missing[user].discard(key)
            if not self._missing[user] and user in self._open:
                heapq.heappush(self._ready, self.rank[user])

    def fail(self, key: str) -> list[tuple[str, str]]:
        """Record a failure; return each job that cannot run now, with the missing job it needs."""
        self._open.discard(key)
        stopped = []
        failed = [key]
        for need in failed:
            for user in self._users[need]:
                if user in self._open:
                    self._open.remove(user)
                    stopped.append((user, need))
                    failed.append(user)
        return stopped


def digests(schedule: Schedule) -> dict[str, str]:
    """Return the SHA-256, by key, of everything that a job's result depends on."""
    found: dict[str, str] = {}
    for key in schedule.order:
        job = schedule.jobs[key]
        identity = {**job.plain(), "needs": {need: found[need] for need in job.needs}}
        found[key] = hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()
    return found
