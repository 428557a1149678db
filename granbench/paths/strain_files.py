"""Paths from tables of strains and stresses.

A file has one row for each step and one column for each component of one order: ``eps_xx`` is the
cumulative strain xx, and ``sig_xx`` in its place the stress. A file whose only column is
``eps_axial`` (``eps_shear``) is the driving strain of a standard test. Compression is positive,
strain has no unit (0.01 is one per cent) and stress is in Pa, unless a header states
another unit as in ``sig_xx [kPa]``. `granbench.tables.table_files` describes the tables.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granbench.errors import ConfigurationError
from granbench.paths.mixed_control import MixedControl
from granbench.paths.path_columns import (
    DRIVING_COLUMNS,
    KNOWN_COLUMNS,
    STRAIN,
    STRESS,
    checked_columns,
    columns_of_orders,
    component_label,
)
from granbench.paths.programme import Floats
from granbench.tables.table_files import read_table
from granbench.tables.tables import Column, Table
from granbench.tensors import COMPONENT_ORDERS, normal_mask
from granbench.units.known_units import (
    is_stress_unit,
    known_units,
    split_unknown_unit,
    text_behind_unit,
    unit_factor,
)
from granbench.units.plausible import LARGEST_STRAIN, LARGEST_STRESS, SMALLEST_STRESS

SAME_STRESS = 1e-9
"""Relative difference within which a prescribed stress equals the one that a path starts from."""
SUDDEN_RELEASE = 0.02
"""Share of the stress at the start below which a held stress must not fall in the first step."""

KINDS_OF_FILES = "a CSV file of strains, or records in netCDF (.nc)"


@dataclass(frozen=True)
class PathTable:
    """The rows of a path file.

    Parameters
    ----------
    source : the file, as errors name it
    columns : names of the columns, in the file's order
    values : (row, column), strain as a ratio and stress in Pa
    lines : (row,), line of the file that each row stands on, from 1
    units : of the columns as the file states them, None where it does not
    """

    source: str
    columns: tuple[str, ...]
    values: Floats
    lines: NDArray[np.int64]
    units: tuple[str | None, ...]

    @property
    def driving_column(self) -> str | None:
        """The column of a standard test's driving strain, where the file holds that."""
        return self.columns[0] if self.columns[0] in DRIVING_COLUMNS else None

    @property
    def order(self) -> str:
        """Component order of the columns; the file must not hold a driving strain."""
        labels = {component_label(name) for name in self.columns}
        return next(order for order, own in COMPONENT_ORDERS.items() if labels == set(own))

    @property
    def held(self) -> tuple[str, ...]:
        """Labels of the components whose stress is prescribed, in their order."""
        return tuple(
            label for label in COMPONENT_ORDERS[self.order] if STRESS + label in self.columns
        )

    def components(self, kind: str) -> Floats:
        """Strain or stress (`kind` is `STRAIN` or `STRESS`), (row, component); zero if absent."""
        zero = np.zeros(len(self.values))
        return np.stack(
            [
                self.values[:, self.columns.index(kind + label)]
                if kind + label in self.columns
                else zero
                for label in COMPONENT_ORDERS[self.order]
            ],
            axis=1,
        )

    def place(self, row: int) -> str:
        """A row, counted from 0, as an error names it."""
        return f"{self.source}: row {row + 1} (line {self.lines[row]})"

    def history(self) -> Floats:
        """The driving strain (step,) from zero; a zero is put first if the rows lack it."""
        strain = self.values[:, 0]
        return strain if strain[0] == 0.0 else np.concatenate([[0.0], strain])

    def control(self, start: Floats) -> tuple[MixedControl, int]:
        """The path as control of one point, and how many steps were put before the rows.

        The first row is the reference where its strain is zero and its stress the one of the
        start; otherwise a reference is put before it.

        Parameters
        ----------
        start : (component,), stress that the path starts from, Pa

        Raises
        ------
        ConfigurationError
            If a held stress without a unit falls to a small share of the stress at the start in the
            first row, as it does if kPa are read as Pa.
        """
        self._refuse_release(start)
        strain, stress = self.components(STRAIN), self.components(STRESS)
        places = [COMPONENT_ORDERS[self.order].index(label) for label in self.held]
        off = np.abs(stress[0] - start)[places].max(initial=0.0)
        added = int(strain[0].any() or off > SAME_STRESS * np.abs(start).max())
        strain = np.concatenate([np.zeros((added, len(start))), strain])
        stress = np.concatenate([np.tile(start, (added, 1)), stress])
        return MixedControl.of_components(self.order, self.held, strain, stress), added

    def _refuse_release(self, start: Floats) -> None:
        labels = COMPONENT_ORDERS[self.order]
        for label, normal, before in zip(labels, normal_mask(self.order), start, strict=True):
            if not normal or label not in self.held:
                continue
            at = self.columns.index(STRESS + label)
            held = self.values[0, at]
            if self.units[at] is None and 0.0 < held < SUDDEN_RELEASE * before:
                raise ConfigurationError(
                    f"{self.place(0)}, column {STRESS}{label} holds {held:g} Pa, but the path "
                    f"starts from {before:g} Pa: is the column in kPa? Write its unit into the "
                    f"header, as {STRESS}{label} [kPa], or {STRESS}{label} [Pa] if it is in Pa"
                )


def read_path(path: Path | str) -> PathTable:
    """Read a path file.

    Parameters
    ----------
    path : of a table, see the module

    Raises
    ------
    ConfigurationError
        Naming the file, and where there is one the row and column: see `read_table`; a column is
        unknown, missing or double, a unit is unknown, a cell is blank or not a finite number, a
        strain or a stress is so large or so small that the unit must be wrong, or there is no
        step.
    """
    table = read_table(
        Path(path),
        ConfigurationError,
        lambda name: name.lower() in KNOWN_COLUMNS,
        f"columns such as {columns_of_orders()}",
        KINDS_OF_FILES,
    )
    columns = [
        column
        for column in table.columns
        if not table.places or column.has_numbers or _plain_name(column) in KNOWN_COLUMNS
    ]
    names = checked_columns([_plain_name(column) for column in columns], table.source)
    numbers = [_in_si(table, column, name) for column, name in zip(columns, names, strict=True)]
    found = PathTable(
        table.source,
        names,
        np.stack(numbers, axis=-1),
        np.array([int(place.split()[-1]) for place in table.places], dtype=np.int64),
        tuple(column.unit for column in columns),
    )
    if not len(found.values) or (len(found.values) == 1 and not np.any(found.values)):
        raise ConfigurationError(
            f"{found.source}: has no step; give at least one row of strains that are not zero"
        )
    _check_sizes(found)
    return found


def _plain_name(column: Column) -> str:
    """The name of a column, without a unit that is unknown; headers ignore case.

    Text after the unit, as in ``eps_xx [%] x10``, makes it a different column.
    """
    if text_behind_unit(column.header):
        return column.header
    name, _ = split_unknown_unit(column.name) or (column.name, None)
    return name.lower() if name.lower() in KNOWN_COLUMNS else column.name


def _in_si(table: Table, column: Column, name: str) -> Floats:
    """The numbers of a column, (row,), strain as a ratio and stress in Pa."""
    stress = name.startswith(STRESS)
    _, strange = split_unknown_unit(column.name) or ("", None)
    unit = column.unit or strange
    factor = 1.0 if unit is None else unit_factor(unit)
    if unit is not None and (factor is None or is_stress_unit(unit) != stress):
        raise ConfigurationError(
            f"{table.source}: column {name} is in {unit!r}, which is not a known unit of a "
            f"{'stress' if stress else 'strain'}; use {known_units(stress)}"
        )
    column = replace(column, unit=unit or ("Pa" if stress else None))
    if fault := table.fault(column):
        row, what = fault
        raise ConfigurationError(
            f"{table.source}: row {row + 1} ({table.places[row]}), column {name} {what}"
        )
    return (factor or 1.0) * table.values(column)


def _check_sizes(table: PathTable) -> None:
    """Refuse values that are only possible in another unit."""
    stress = np.array([name.startswith(STRESS) for name in table.columns])
    beyond = np.abs(table.values) > np.where(stress, LARGEST_STRESS, LARGEST_STRAIN)
    if beyond.any():
        row, at = (int(place[0]) for place in beyond.nonzero())
        found = f"{table.place(row)}, column {table.columns[at]} holds {table.values[row, at]:g}"
        if stress[at]:
            raise ConfigurationError(
                f"{found}, a stress beyond {LARGEST_STRESS / 1e9:g} GPa; give it in Pa (1e5 is 100 "
                "kPa), or state the unit in the header"
            )
        raise ConfigurationError(
            f"{found}, a strain beyond {100.0 * LARGEST_STRAIN:g} %; strain has no unit: if the "
            f"column is in %, divide it by 100, or write {table.columns[at]} [%]"
        )
    bare = stress & np.array([unit is None for unit in table.units])
    largest = np.abs(table.values[:, bare]).max(initial=0.0)
    if 0.0 < largest < SMALLEST_STRESS:
        name = table.columns[int(bare.argmax())]
        raise ConfigurationError(
            f"{table.source}: column {name} and the other stresses hold at most {largest:g} Pa, "
            f"less than {SMALLEST_STRESS / 1e3:g} kPa: are they in kPa? Write the unit into the "
            f"header, as {name} [kPa], or {name} [Pa] if they are in Pa"
        )
