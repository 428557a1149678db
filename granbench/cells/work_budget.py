"""A bound on the work of a computation whose cost is not known in advance.

How many substeps a stress update takes depends on the model, the state and the increment. A caller
that must end in bounded time opens a budget; loops that may run for long spend from it. The count
is the same on every machine, unlike a limit on seconds.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from granbench.errors import GranbenchError


class WorkExceeded(GranbenchError):
    """The work budget is spent; the computation that was running stops here."""


class WorkBudget:
    """Units of work, each one attempt at a substep or one trial of an increment.

    Parameters
    ----------
    limit : units that may be spent
    """

    def __init__(self, limit: float) -> None:
        self.limit = limit
        self.spent = 0

    def spend(self) -> None:
        """Count one unit.

        Raises
        ------
        WorkExceeded
            If it is one too many.
        """
        self.spent += 1
        if self.spent > self.limit:
            raise WorkExceeded(f"the work exceeds its budget of {self.limit:g} units")


_current: ContextVar[WorkBudget | None] = ContextVar("work budget", default=None)


@contextmanager
def work_budget(limit: float) -> Iterator[WorkBudget]:
    """Limit the work within the block to so many units."""
    budget = WorkBudget(limit)
    token = _current.set(budget)
    try:
        yield budget
    finally:
        _current.reset(token)


def spend() -> None:
    """Count one unit of work, if a budget is open.

    Raises
    ------
    WorkExceeded
        If it is spent.
    """
    budget = _current.get()
    if budget is not None:
        budget.spend()
