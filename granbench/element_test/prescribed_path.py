"""What an element test prescribes, step by step: from records, a file, or a standard test."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr

from granbench.cells.contract import MaterialCell
from granbench.cells.found_model import FoundModel
from granbench.errors import ConfigurationError
from granbench.paths.mixed_control import MixedControl
from granbench.paths.path_columns import STRAIN, STRESS
from granbench.paths.programme import Floats, LoadingProgramme
from granbench.paths.strain_files import PathTable
from granbench.tensors import COMPONENT_ORDERS, PRINCIPAL_DIRECTIONS, component_order, normal_mask
from granbench.units.plausible import LARGEST_STRAIN


@dataclass(frozen=True)
class PrescribedPath:
    """The strains and stresses that an element test prescribes, and how its steps are named.

    Parameters
    ----------
    control : of one point or many
    family : loading family that is written into the results
    place : names a point and a step for an error
    added : steps that were put before the first row of a file
    component : label of the strain to draw against; None for the one with the largest range
    records : the records whose strain is prescribed, if any
    """

    control: MixedControl
    family: str
    place: Callable[[int, int], str]
    added: int = 0
    component: str | None = None
    records: xr.Dataset | None = None

    @classmethod
    def of_records(cls, records: xr.Dataset, source: str, cell: MaterialCell) -> PrescribedPath:
        """The strain paths of records.

        Raises
        ------
        ConfigurationError
            If records and cell have different components, or a strain is so large that its unit
            must be wrong.
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
    def of_table(cls, table: PathTable, start: Floats, cell: MaterialCell) -> PrescribedPath:
        """The rows of a path file.

        Parameters
        ----------
        table : strains and stresses by components
        start : (component,), stress of the cell at the start, Pa
        cell : the model that is driven along them

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
    ) -> PrescribedPath:
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
    found: FoundModel, programme: LoadingProgramme, order: str | None
) -> MaterialCell:
    """The model's cell for a standard test.

    Parameters
    ----------
    found : the model
    programme : what the test prescribes
    order : component order of the cell, where the model leaves it open. By default the first that
        has all the components that the test needs: a plane model is tried in the plane, then both
        kinds in principal components, then in all six.

    Raises
    ------
    ConfigurationError
        If an order is given for a model that has its own.
    ModelError
        If the order is unknown.
    """
    if not found.order_is_open:
        if order is not None:
            raise ConfigurationError(
                f"order={order!r} is given, but {found.name} has {found.cell.order} components of "
                "its own; leave it out"
            )
        return found.cell
    if order is None:
        plane_first = ("plane", "principal", "full")
        orders = plane_first if found.dimension == 2 else plane_first[1:]
        order = next(own for own in orders if _has_components(own, programme))
    return found.in_order(order).cell


def _has_components(order: str, programme: LoadingProgramme) -> bool:
    """Whether a component order has all the components that a test needs."""
    try:
        MixedControl.of_programme(programme, [0.0, programme.path_length], order)
    except ConfigurationError:
        return False
    return True
