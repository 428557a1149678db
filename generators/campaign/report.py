"""The report of a campaign: which jobs have a result, and why the others have none."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from granbench.errors import EngineError

JOBS_NAMED = 3
"""Jobs that an error message names; it counts the others."""


class MissingResults(EngineError):
    """Jobs of a campaign have no result.

    Parameters
    ----------
    message : one sentence that names the jobs and the remedy
    permanent : whether all of them failed permanently, so that running the same jobs again
        changes nothing
    """

    def __init__(self, message: str, *, permanent: bool) -> None:
        super().__init__(message)
        self.permanent = permanent


@dataclass(frozen=True)
class CampaignReport:
    """The state of every job at the end of a run.

    Parameters
    ----------
    done : result folder of every finished job, by key, in the order of the jobs
    failed : reason, by key, of every job without a result
    permanent : keys of `failed` whose job declared its failure as permanent, or which need such a
        job; trying again would not help
    skipped : finished jobs whose results were already there
    not_needed : jobs without a result that no job needs any more, as all jobs that use them are
        finished
    damaged : what was wrong, by key, with results that were found damaged and made again
    """

    done: dict[str, Path]
    failed: dict[str, str]
    permanent: frozenset[str]
    skipped: tuple[str, ...]
    not_needed: tuple[str, ...]
    damaged: dict[str, str]

    def require_every_result(self, name: str, *, except_permanent: bool = False) -> None:
        """Refuse to go on when a job has no result.

        Parameters
        ----------
        name : what is made from the results, for the error message
        except_permanent : whether jobs that failed permanently may be left out

        Raises
        ------
        MissingResults
            If a job has no result.
        """
        allowed: Iterable[str] = self.permanent if except_permanent else ()
        missing = {key: self.failed[key] for key in self.failed.keys() - set(allowed)}
        if not missing:
            return
        ordered = [key for key in self.failed if key in missing]
        first = [f"{key} ({missing[key]})" for key in ordered[:JOBS_NAMED]]
        more = len(missing) - len(first)
        names = "; ".join([*first, f"and {more} more"] if more else first)
        permanent = missing.keys() <= self.permanent
        remedy = "run the same campaign again: only the missing jobs run"
        if permanent:
            remedy = "change the settings of these jobs: they fail in the same way every time"
        raise MissingResults(
            f"{name} is incomplete and was not written: {len(missing)} of "
            f"{len(self.failed) + len(self.done)} jobs have no result: {names}; {remedy}",
            permanent=permanent,
        )
