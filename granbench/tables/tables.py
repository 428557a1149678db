"""Tables from files of a user: headers, units and cells, with their places in the file."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError
from granbench.tables.written_numbers import (
    Cell,
    DecimalMarks,
    cell_kind,
    is_open_point,
    number_of,
    points_may_group,
    why_no_number,
)
from granbench.units.known_units import is_stress_unit, unit_factor


@dataclass(frozen=True)
class Column:
    """One column.

    Parameters
    ----------
    header : as in the file
    name : the header without its unit
    unit : None if the file gives none
    cells : one per row; text, numbers, or None for an empty cell
    """

    header: str
    name: str
    unit: str | None
    cells: Sequence[Cell]

    @cached_property
    def has_numbers(self) -> bool:
        """Whether any cell is a number; a column of dates, times or remarks has none."""
        return any(cell_kind(cell) == "number" for cell in self.cells)


@dataclass(frozen=True)
class Table:
    """Columns of equal length.

    Parameters
    ----------
    source : file, and the sheet or path in it, for error texts
    places : of the rows, such as `line 7`
    columns : in the order of the file
    preamble : lines above the first row other than the names of columns: number and text
    """

    source: str
    places: Sequence[str]
    columns: Sequence[Column]
    preamble: tuple[tuple[int, str], ...] = ()

    @classmethod
    def of_arrays(
        cls, source: str, arrays: dict[str, NDArray[np.float64]], units: dict[str, str]
    ) -> "Table":
        """A table of equally long arrays (row,) by header, with their known units."""
        rows = len(next(iter(arrays.values())))
        columns = [
            Column(name, name, units.get(name), [float(value) for value in values])
            for name, values in arrays.items()
        ]
        return cls(source, [f"row {row + 1}" for row in range(rows)], columns)

    @cached_property
    def _marks(self) -> DecimalMarks:
        marks = DecimalMarks()
        for column in self.columns:
            marks = marks.joined(DecimalMarks.of(column.cells))
        return marks

    def values(self, column: Column) -> NDArray[np.float64]:
        """The cells of a column as numbers, (row,), NaN for other cells; see `fault`."""
        own = DecimalMarks.of(column.cells)
        in_pascals = column.unit is not None and unit_factor(column.unit) == 1.0
        asked = points_may_group(
            column.cells, in_pascals=in_pascals and is_stress_unit(column.unit or "")
        )
        found = (
            None if asked and is_open_point(cell) else number_of(cell, own, self._marks)
            for cell in column.cells
        )
        values = np.array([np.nan if value is None else value for value in found], dtype=float)
        return np.where(np.isfinite(values), values, np.nan)

    def fault(self, column: Column) -> tuple[int, str] | None:
        """The first row, from 0, whose cell is not a finite number, and what is wrong with it."""
        missing = np.isnan(self.values(column))
        if not missing.any():
            return None
        row = int(missing.argmax())
        return row, why_no_number(column.cells[row], column.cells)

    def numbers(self, column: Column) -> NDArray[np.float64]:
        """The cells of a column as numbers, (row,).

        Raises
        ------
        DatasetError
            Naming file, row and column of the first cell that is not a finite number, or is
            ambiguous.
        """
        values = self.values(column)
        if np.isnan(values).any() and (fault := self.fault(column)):
            row, what = fault
            raise DatasetError(
                f"{self.source}, {self.places[row]}: column {column.header!r} {what}"
            )
        return values
