"""A model driven along a prescribed path, and what it predicts there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr
from torch import Tensor

from granbench import __version__
from granbench.cells.check import checked_cell, spread_rows
from granbench.cells.contract import MaterialCell
from granbench.cells.user_code import user_code
from granbench.cells.work_budget import WorkExceeded, work_budget
from granbench.element_test.prescribed_path import PrescribedPath
from granbench.element_test.response_files import response_records
from granbench.element_test.run import ElementTest, Failure, run_test
from granbench.errors import ConfigurationError
from granbench.paths.path_columns import STRAIN
from granbench.paths.programme import Floats
from granbench.tensors import COMPONENT_ORDERS, least_principal, mean_stress

NO_TENSION = 1e-6
"""Share of the largest stress below which a tension is rounding."""

WORK_OF_A_RUN = 15_000
WORK_OF_A_STEP = 75
"""Attempts at substeps, and trials of increments, that a run may take: a sum of these. Usual runs
take 1 to 25 a step; the sum of a test of 200 steps takes about a minute of one core."""

COPIED = ("path_id", "specimen", "split", "loading_family", "seed")
"""What the result along records copies from them beside the strain."""


class WorkLimitError(ConfigurationError):
    """A run needs more substeps than it is allowed."""


@dataclass(frozen=True)
class DriveResult:
    """What a model predicts along a prescribed path.

    Parameters
    ----------
    order : component order
    test : the run
    records : as stress-strain records, the reference step included; float64
    added : steps before the first row of the file that was driven along
    notes : on what was corrected for the run, see `granbench.cells.check`
    """

    order: str
    test: ElementTest
    records: xr.Dataset
    added: int
    notes: tuple[str, ...] = ()

    def rows(self) -> tuple[Floats, Floats, dict[str, Floats]]:
        """Strain, stress (row, component) and internals (row,) of the first path."""
        rows = slice(self.added, None)
        internals = {name: series[0, rows] for name, series in self.test.internals.items()}
        return self.test.strain[0, rows], self.test.stress[0, rows], internals

    def tension(self) -> str | None:
        """Where a principal stress becomes tensile, as a sentence; None where none does.

        A model with a friction cone in p and q keeps the mean stress compressive, not each
        principal stress: in extension q reaches 1.5 p where the least of them vanishes.
        """
        least = least_principal(self.test.stress, self.order)
        scale = np.abs(self.test.stress).max(initial=0.0)
        tensile = least < -NO_TENSION * scale
        if not tensile.any():
            return None
        point, step = (int(place[0]) for place in np.nonzero(tensile))
        path = "" if len(least) == 1 else f" of path {point + 1}"
        return (
            f"a principal stress is tensile from row {step + 1 - self.added}{path} on, at most "
            f"{-np.nanmin(least) / 1e3:.3g} kPa; the model keeps the mean stress compressive only"
        )


def drive(
    cell: MaterialCell,
    path: PrescribedPath,
    state: Tensor,
    *,
    configuration: Mapping[str, object],
    tolerance: float | None = None,
    on_step: Callable[[int], None] | None = None,
    work_factor: float = 1.0,
) -> DriveResult:
    """Take a cell along a prescribed path.

    Parameters
    ----------
    cell : the model
    path : what is prescribed
    state : (point, n_state) at its start
    configuration : what was asked for, kept with the records
    tolerance : of held stresses, see `run_test`
    on_step : called with the number of each step that is done
    work_factor : how many times the usual amount of work is allowed, see `WORK_OF_A_RUN`

    Raises
    ------
    ConfigurationError
        Naming the row, or path and step, where the model cannot follow, or where a soil would have
        no voids left.
    WorkLimitError
        Naming them where the work exceeds its bound.
    ModelError
        If the cell does not pass its check, or raises an error.
    """
    if not 0.0 < work_factor < np.inf:
        raise ConfigurationError(f"work_factor is {work_factor:g}; it must be finite and positive")
    done = 0

    def advance(step: int) -> None:
        nonlocal done
        done = step
        if on_step is not None:
            on_step(step)

    try:
        with (
            checked_cell(cell, state[spread_rows(len(state))]) as check,
            user_code(f"{cell.name} failed"),
            work_budget(work_factor * (WORK_OF_A_RUN + WORK_OF_A_STEP * path.control.steps)),
        ):
            test = run_test(cell, path.control, state, tolerance=tolerance, on_step=advance)
    except WorkExceeded:
        stress = state[:, cell.layout["stress"]].double().numpy()
        start = np.abs(mean_stress(stress, cell.order)).min() / 1e3
        raise WorkLimitError(
            f"{path.place(0, done + 1)}: {cell.name} needs too many substeps to go on; that "
            "happens where the stress changes by many times its own size within a step, as at very "
            f"low stress or where strength is lost (the path starts at p = {start:.3g} kPa); start "
            "from a higher pressure, end the path before, or allow more work (work_factor is "
            f"{work_factor:g} now)"
        ) from None
    if test.failures:
        raise ConfigurationError(_failure_message(test.failures, test, path, cell.name))
    if cell.pressure_dependent and "void_ratio" in test.internals:
        _refuse_lost_voids(test.internals["void_ratio"], path, cell.name)
    records = response_records(
        cell.order,
        test.strain,
        test.stress,
        test.internals,
        family=path.family,
        configuration=configuration,
        version=__version__,
    )
    if path.records is not None:
        kept = {name: path.records[name].variable for name in COPIED}
        records = records.assign_coords(kept)
    return DriveResult(cell.order, test, records, path.added, check.notes)


def _refuse_lost_voids(void_ratio: Floats, path: PrescribedPath, model: str) -> None:
    """Refuse a path (point, step) on which a void ratio becomes negative."""
    if (lost := void_ratio < 0.0).any():
        step = int(lost.any(axis=0).argmax())
        point = int(lost[:, step].argmax())
        raise ConfigurationError(
            f"{path.place(point, step)}: the path leaves {model} a void ratio of "
            f"{void_ratio[point, step]:.3g}, which no soil has: it is compressed by more than its "
            "voids; end the path before, or start looser"
        )


def _failure_message(
    failures: tuple[Failure, ...], test: ElementTest, path: PrescribedPath, model: str
) -> str:
    first = min(failures, key=lambda failure: (failure.step, failure.point))
    driven = path.control.driven[first.point]
    change = driven[first.step] - driven[first.step - 1]
    largest = int(np.abs(change).argmax())
    label = COMPONENT_ORDERS[path.control.order][largest]
    others = f"; {len(failures) - 1} other paths fail as well" if len(failures) > 1 else ""
    return (
        f"{path.place(first.point, first.step)}: {model} cannot follow the step, in which "
        f"{STRAIN}{label} changes by {change[largest]:g}: {first.reason}{others}; take smaller "
        "steps, or end the path before"
    )
