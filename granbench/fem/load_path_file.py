"""Load paths from tables: the driving displacement of a problem against time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from granbench.errors import ConfigurationError
from granbench.fem.loading import LoadingHistory
from granbench.tables.table_files import read_table
from granbench.tables.tables import Column, Table
from granbench.units.known_units import (
    length_factor,
    split_unknown_unit,
    text_behind_unit,
    time_factor,
)

COLUMNS = {"time": "s", "displacement": "m"}
"""Names of the columns, and their units where the file states none."""
FACTORS: Mapping[str, Callable[[str], float | None]] = {
    "time": time_factor,
    "displacement": length_factor,
}
LARGEST_DISPLACEMENT = 1.0
"""m; a larger displacement without a unit is probably in millimetres."""

_WANTED = " and ".join(f"{name} (in {unit})" for name, unit in COLUMNS.items())


def read_load_path(file: Path | str) -> LoadingHistory:
    """The driving displacement from a table with the columns `time` (s) and `displacement` (m).

    It is linear between the rows, which begin at time 0. A header may state another unit, as
    ``displacement [mm]``.

    Raises
    ------
    ConfigurationError
        Naming the file, and the row where there is one: see `read_table`; it lacks a column or has
        another one, a unit is unknown, a cell is no number, the times do not rise from 0, nothing
        moves, or a displacement without a unit is as large as only millimetres are.
    """
    try:
        table = read_table(
            Path(file),
            ConfigurationError,
            lambda name: name.lower() in COLUMNS,
            _WANTED,
            "a CSV file",
        )
    except ConfigurationError as error:
        raise ConfigurationError(f"load path {error}") from error
    asked = [column for column in table.columns if _is_asked(table, column)]
    columns = {_name(column): column for column in asked}
    if len(columns) < len(asked):
        raise ConfigurationError(
            f"load path {table.source}: has a column twice: "
            f"{', '.join(column.header for column in asked)}; keep one of each"
        )
    if sorted(columns) != sorted(COLUMNS):
        raise ConfigurationError(
            f"load path {table.source}: has the columns {', '.join(columns) or 'none'}; give "
            f"{_WANTED}"
        )
    times, values = (_numbers(table, columns[name], name) for name in COLUMNS)
    if _unit(columns["displacement"]) is None and max(map(abs, values), default=0.0) > (
        LARGEST_DISPLACEMENT
    ):
        row = int(np.abs(values).argmax())
        raise ConfigurationError(
            f"load path {table.source}, {table.places[row]}: the displacement is {values[row]:g} "
            "m: is it in millimetres? Write the unit into the header, displacement [mm] or "
            "displacement [m]"
        )
    try:
        history = LoadingHistory(times, values)
    except ConfigurationError as error:
        raise ConfigurationError(f"load path {table.source}: {error}") from error
    if values[0] != 0.0 or not any(values):
        raise ConfigurationError(
            f"load path {table.source}: begins at a displacement of {values[0]:g} m and ends at "
            f"{values[-1]:g} m; it must begin at 0 and move"
        )
    return history


def _is_asked(table: Table, column: Column) -> bool:
    """Whether a column holds numbers; columns of dates and remarks are ignored."""
    return not table.places or column.has_numbers or _name(column) in COLUMNS


def _name(column: Column) -> str:
    """The name of a column in small letters; text behind the unit makes it another column."""
    if text_behind_unit(column.header):
        return column.header
    name, _ = split_unknown_unit(column.name) or (column.name, None)
    return name.lower() if name.lower() in COLUMNS else column.name


def _unit(column: Column) -> str | None:
    return column.unit or (split_unknown_unit(column.name) or ("", None))[1]


def _numbers(table: Table, column: Column, name: str) -> tuple[float, ...]:
    unit = _unit(column)
    factor = 1.0 if unit is None else FACTORS[name](unit)
    if factor is None:
        raise ConfigurationError(
            f"load path {table.source}: {name} has the unknown unit {unit!r}; "
            f"give it in {COLUMNS[name]}"
        )
    if fault := table.fault(column):
        row, what = fault
        raise ConfigurationError(f"load path {table.source}, {table.places[row]}: {name} {what}")
    return tuple((factor * table.values(column)).tolist())
