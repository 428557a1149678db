"""One evaluation of a model: what `Axis.predict` is given."""

import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar

import xarray as xr

from granbench.benchmark.scored_task import ScoredTask
from granbench.cells.contract import MaterialCell
from granbench.cells.user_code import user_code
from granbench.errors import GranbenchError

Result = TypeVar("Result")
SeedProgress = Callable[[int, str], None]
"""Called with the seed and what was done."""


def _say_nothing(seed: int, done: str) -> None:
    """No progress is reported."""


@dataclass(frozen=True)
class EvaluationRun:
    """The cells of a model, and what they are evaluated on.

    Parameters
    ----------
    cells : the model's cell for each seed; the seed also draws the noise
    task : the scored records and the analyses
    axes : names of the chosen axes
    training_seconds : how long each seed was trained, where that is known
    report : called after each part
    """

    cells: Mapping[int, MaterialCell]
    task: ScoredTask
    axes: tuple[str, ...]
    training_seconds: Mapping[int, float] = field(default_factory=dict)
    report: SeedProgress = _say_nothing

    @property
    def records(self) -> xr.Dataset:
        """The scored records."""
        return self.task.records

    @property
    def reads_records(self) -> bool:
        """Whether the model looks its answers up in the records."""
        return any(cell.reads_records for cell in self.cells.values())

    def guarded(self, cell: MaterialCell, part: str, run: Callable[[], Result]) -> Result:
        """Call a user's cell; an error in its code becomes a `ModelError` with its line.

        An exception that the code of an axis of another package raises outside of the cell passes.

        Parameters
        ----------
        cell : the user's
        part : what it is called for, for the message
        run : calls it
        """
        with user_code(f"cell {cell.name!r} failed in protocol {part}"):
            try:
                return run()
            except GranbenchError:
                raise
            except Exception as error:
                if not _is_raised_outside(cell, error):
                    raise
                failure = error
        raise failure

    def for_each_cell(self, part: str, measure: Callable[[MaterialCell], xr.Dataset]) -> xr.Dataset:
        """A measurement that does not depend on the seed itself: made once for each cell.

        Parameters
        ----------
        part : what is measured, for messages and progress
        measure : of one cell

        Returns
        -------
        The measurements over `seed`
        """
        known: dict[int, xr.Dataset] = {}
        found = []
        for seed, cell in self.cells.items():
            if id(cell) not in known:
                known[id(cell)] = self.guarded(cell, part, partial(measure, cell))
            found.append(known[id(cell)])
            self.report(seed, part)
        joined = xr.concat(found, dim="seed", combine_attrs="override", join="exact")
        return joined.assign_attrs(found[0].attrs)


def _is_raised_outside(cell: MaterialCell, error: Exception) -> bool:
    """Whether code of another package raised an error while it did not call the cell.

    Parameters
    ----------
    cell : the user's
    error : caught where that code was called
    """
    _, *frames = (frame for frame, _ in traceback.walk_tb(error.__traceback__))
    if not frames or str(frames[0].f_globals.get("__name__", "")).split(".")[0] == "granbench":
        return False
    return not any(frame.f_locals.get("self") is cell for frame in frames)
