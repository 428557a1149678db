"""A model driven along a path from a file, or through a standard test."""

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
from granbench.element_test.run import ElementTest, Failure, run_test
from granbench.element_test.start import ModelChoice
from granbench.errors import ConfigurationError
from granbench.paths.answer_files import answer_records
from granbench.paths.mixed_control import MixedControl
from granbench.paths.path_columns import STRAIN, STRESS
from granbench.paths.programme import Floats, LoadingProgramme
from granbench.paths.strain_files import PathTable
from granbench.tensors import (
    COMPONENT_ORDERS,
    PRINCIPAL_DIRECTIONS,
    component_order,
    least_principal,
    mean_stress,
    normal_mask,
)
from granbench.units.plausible import LARGEST_STRAIN

NO_TENSION = 1e-6
"""Share of the largest stress below which a tension is rounding."""

WORK_OF_A_RUN = 15_000
WORK_OF_A_STEP = 75
"""Attempts at substeps, and trials of increments, that a run may take: a sum of these. Usual runs
take 1 to 25 a step; the sum of a test of 200 steps takes about a minute of one core."""

CARRIED = ("path_id", "specimen", "split", "loading_family", "seed")
"""What the answer to records keeps of them beside the strain."""


@dataclass(frozen=True)
class Course:
    """What is prescribed, and how its steps are named.

    Parameters
    ----------
    control : of one point or many
    family : loading family of the answer
    place : names a point and a step for an error
    added : steps that were put before the first row of a file
    component : label of the strain to draw against; None for the one that goes furthest
    records : those that are driven along, if any
    """

    control: MixedControl
    family: str
    place: Callable[[int, int], str]
    added: int = 0
    component: str | None = None
    records: xr.Dataset | None = None

    @classmethod
    def of_records(cls, records: xr.Dataset, source: str, cell: MaterialCell) -> Course:
        """The strain paths of records.

        Raises
        ------
        ConfigurationError
            If records and cell have different components, or a strain is as large as only a
            wrong unit makes it.
        """
        order = component_order(tuple(str(label) for label in records["component"].values))
        _same_order(source, order, cell)
        strain = records["strain"].values.astype(np.float64)
        names = records["path_id"].values.astype(str)

        def place(point: int, step: int) -> str:
            return f"{source}: path {names[point]!r}, step {step}"

        if (beyond := np.abs(strain) > LARGEST_STRAIN).any():
            point, step, at = (int(index[0]) for index in beyond.nonzero())
            raise ConfigurationError(
                f"{place(point, step)}: strain {COMPONENT_ORDERS[order][at]} is "
                f"{strain[point, step, at]:g}, beyond {100.0 * LARGEST_STRAIN:g} %; strain has no "
                "unit: divide it by 100 if it is in %"
            )
        return cls(MixedControl.of_strain(order, strain), "recorded", place, records=records)

    @classmethod
    def of_table(cls, table: PathTable, start: Floats, cell: MaterialCell) -> Course:
        """The rows of a path file.

        Parameters
        ----------
        table : strains and stresses by components
        start : (component,), stress of the cell at the start, Pa
        cell : that is to follow them

        Raises
        ------
        ConfigurationError
            If file and cell have different components, or tension is prescribed to a model that
            is not defined for it.
        """
        _same_order(table.source, table.order, cell)
        if cell.pressure_dependent:
            _refuse_tension(table, cell.name)
        control, added = table.control(start)
        return cls(control, "prescribed", _rows_of(table, added), added)

    @classmethod
    def of_test(
        cls,
        name: str,
        programme: LoadingProgramme,
        history: Floats,
        order: str,
        table: PathTable | None = None,
    ) -> Course:
        """A standard test.

        Parameters
        ----------
        name : of the test, for errors
        programme : what it prescribes
        history : (step,), its driving strain from zero on
        order : component order of the cell
        table : the rows that the history was read from, if it was

        Raises
        ------
        ConfigurationError
            If the test needs components that the order lacks.
        """
        control = MixedControl.of_programme(programme, history, order)
        driving = programme.driving_component or ""
        component = PRINCIPAL_DIRECTIONS[order].get(driving, driving) or None
        family = programme.loading_family
        if table is not None:
            added = len(history) - len(table.values)
            return cls(control, family, _rows_of(table, added), added, component)
        last = len(history) - 1

        def step_of(point: int, step: int) -> str:
            return f"{name}, step {step} of {last}, driving strain {history[step]:g}"

        return cls(control, family, step_of, component=component)


def _rows_of(table: PathTable, added: int) -> Callable[[int, int], str]:
    return lambda point, step: table.place(step - added)


def _same_order(source: str, order: str, cell: MaterialCell) -> None:
    if order != cell.order:
        columns = ",".join(STRAIN + label for label in COMPONENT_ORDERS[cell.order])
        raise ConfigurationError(
            f"{source}: its components are {order}, but those of {cell.name} are {cell.order}; "
            f"give {columns}"
        )


def _refuse_tension(table: PathTable, model: str) -> None:
    labels = COMPONENT_ORDERS[table.order]
    stress = table.components(STRESS)
    for label, normal in zip(labels, normal_mask(table.order), strict=True):
        series = stress[:, labels.index(label)]
        if label in table.held and normal and (series <= 0.0).any():
            row = int(np.argmax(series <= 0.0))
            raise ConfigurationError(
                f"{table.place(row)}, column {STRESS}{label}: prescribes {series[row]:g} Pa, but "
                f"{model} is defined under compression only; prescribe a stress above 0"
            )


def cell_for_test(
    choice: ModelChoice, programme: LoadingProgramme, order: str | None
) -> MaterialCell:
    """The model's cell for a standard test.

    A classical model is made in the given order or, by default, in the first that has all the
    components that the test needs: a plane model is tried in the plane, then both kinds in
    principal components, then in all six.

    Raises
    ------
    ConfigurationError
        If a component order is asked of a model that has its own, or is unknown.
    """
    model = choice.classical()
    if model is None:
        if order is not None:
            raise ConfigurationError(
                f"--order is for classical models; {choice.name} has its own components, leave "
                "it out"
            )
        return choice.cell("principal")
    if order is not None:
        return choice.cell(order)
    plane_first = ("plane", "principal", "full")
    orders = plane_first if model.dimension == 2 else plane_first[1:]
    return choice.cell(next(own for own in orders if _serves(own, programme)))


def _serves(order: str, programme: LoadingProgramme) -> bool:
    try:
        MixedControl.of_programme(programme, [0.0, programme.path_length], order)
    except ConfigurationError:
        return False
    return True


@dataclass(frozen=True)
class Answer:
    """What a model said along a course.

    Parameters
    ----------
    order : component order
    test : the run
    records : as stress-strain records, the reference step included; float64
    added : steps before the first row of the file that was driven along
    notes : on what was put right of the cell, see `granbench.cells.check`
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
    course: Course,
    state: Tensor,
    *,
    configuration: Mapping[str, object],
    tolerance: float | None = None,
    on_step: Callable[[int], None] | None = None,
    patience: float = 1.0,
) -> Answer:
    """Take a cell along a course.

    Parameters
    ----------
    cell : the model
    course : what is prescribed
    state : (point, n_state) at its start
    configuration : what was asked for, kept with the records
    tolerance : of held stresses, see `run_test`
    on_step : called with the number of each step that is done
    patience : how many times the usual amount of work is allowed, see `WORK_OF_A_RUN`

    Raises
    ------
    ConfigurationError
        Naming the row, or path and step, where the model cannot follow, where a soil would have
        no voids left, or where the work exceeds its bound.
    ModelError
        If the cell does not pass its check, or raises an error.
    """
    if not 0.0 < patience < np.inf:
        raise ConfigurationError(f"patience is {patience:g}; give a finite number above 0")
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
            work_budget(patience * (WORK_OF_A_RUN + WORK_OF_A_STEP * course.control.steps)),
        ):
            test = run_test(cell, course.control, state, tolerance=tolerance, on_step=advance)
    except WorkExceeded:
        stress = state[:, cell.layout["stress"]].double().numpy()
        start = np.abs(mean_stress(stress, cell.order)).min() / 1e3
        raise ConfigurationError(
            f"{course.place(0, done + 1)}: {cell.name} needs too many substeps to go on; that "
            "happens where the stress changes by many times its own size within a step, as at very "
            f"low stress or where strength is lost (the path starts at p = {start:.3g} kPa); start "
            "from a higher pressure, end the path before, or allow more work (patience is "
            f"{patience:g} now; --patience {10.0 * patience:g})"
        ) from None
    if test.failures:
        raise ConfigurationError(_failed(test.failures, test, course, cell.name))
    if cell.pressure_dependent and "void_ratio" in test.internals:
        _refuse_lost_voids(test.internals["void_ratio"], course, cell.name)
    records = answer_records(
        cell.order,
        test.strain,
        test.stress,
        test.internals,
        family=course.family,
        configuration=configuration,
        version=__version__,
    )
    if course.records is not None:
        kept = {name: course.records[name].variable for name in CARRIED}
        records = records.assign_coords(kept)
    return Answer(cell.order, test, records, course.added, check.notes)


def _refuse_lost_voids(void_ratio: Floats, course: Course, model: str) -> None:
    """Refuse a path (point, step) on which the grains would have to be compressed themselves."""
    if (lost := void_ratio < 0.0).any():
        step = int(lost.any(axis=0).argmax())
        point = int(lost[:, step].argmax())
        raise ConfigurationError(
            f"{course.place(point, step)}: the path leaves {model} a void ratio of "
            f"{void_ratio[point, step]:.3g}, which no soil has: it is compressed by more than its "
            "voids; end the path before, or start looser"
        )


def _failed(failures: tuple[Failure, ...], test: ElementTest, course: Course, model: str) -> str:
    first = min(failures, key=lambda failure: (failure.step, failure.point))
    driven = course.control.driven[first.point]
    change = driven[first.step] - driven[first.step - 1]
    largest = int(np.abs(change).argmax())
    label = COMPONENT_ORDERS[course.control.order][largest]
    others = f"; {len(failures) - 1} other paths fail as well" if len(failures) > 1 else ""
    return (
        f"{course.place(first.point, first.step)}: {model} cannot follow the step, in which "
        f"{STRAIN}{label} changes by {change[largest]:g}: {first.reason}{others}; take smaller "
        "steps, or end the path before"
    )
