"""Tables of a laboratory file: headers, units and cells, each with the place where it stands."""

import codecs
import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError
from granbench.laboratory.units import split_header, unit_factor

COMMENT = "#"
_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eEdD][+-]?\d+)?")


@dataclass(frozen=True)
class Column:
    """One column.

    Parameters
    ----------
    header : as it stands in the file
    name : the header without its unit
    unit : None where the file gives none
    cells : one a row; text, numbers, or None where there is nothing
    """

    header: str
    name: str
    unit: str | None
    cells: Sequence[str | float | None]


@dataclass(frozen=True)
class Table:
    """Columns of equal length.

    Parameters
    ----------
    source : file, and the sheet or path in it, for error texts
    places : where each row stands, such as `line 7`
    columns : in the order of the file
    """

    source: str
    places: Sequence[str]
    columns: Sequence[Column]

    @classmethod
    def of_arrays(
        cls, source: str, arrays: dict[str, NDArray[np.float64]], units: dict[str, str]
    ) -> "Table":
        """Table of equally long arrays (row,) by header, with the units that are known."""
        rows = len(next(iter(arrays.values())))
        columns = [
            Column(name, name, units.get(name), [float(value) for value in values])
            for name, values in arrays.items()
        ]
        return cls(source, [f"row {row + 1}" for row in range(rows)], columns)

    def numbers(self, column: Column) -> NDArray[np.float64]:
        """The cells of a column as numbers, (row,).

        Raises
        ------
        DatasetError
            Naming file, row and column of the first cell that is no finite number.
        """
        values = np.empty(len(self.places))
        for row, cell in enumerate(column.cells):
            value = _as_number(cell)
            if not math.isfinite(value):
                what = "is empty" if cell is None or cell == "" else f"holds {str(cell)!r}"
                raise DatasetError(
                    f"{self.source}, {self.places[row]}: column {column.header!r} {what}, which is "
                    "no number; mend the cell or remove the row"
                )
            values[row] = value
        return values


def _as_number(cell: str | float | None) -> float:
    if not isinstance(cell, str):
        return math.nan if cell is None else float(cell)
    return float(cell.replace(",", ".").lower().replace("d", "e")) if is_number(cell) else math.nan


def is_number(text: str) -> bool:
    """Whether a text is a decimal number, with a point or a comma."""
    return _NUMBER.fullmatch(text.strip()) is not None


def read_text_table(path: Path) -> Table:
    """A table in a text file: columns between commas, semicolons, tabs or blanks.

    The header is the last line before the numbers; a line of units such as ``[%] [kPa]`` may
    follow it. Lines that begin with ``#`` are comments, but the header may be one of them.

    Raises
    ------
    DatasetError
        If the file cannot be read, has no header, or a row is shorter than it.
    """
    lines = _lines(path)
    first = next((at for at, (_, text) in enumerate(lines) if _holds_numbers(text)), None)
    if first is None:
        raise DatasetError(f"{path}: holds no row of numbers; give a table with a header")
    number, text = lines[first]
    heading = [line for _, line in lines[:first]]
    separator = _separator([*heading[-2:], text])
    headers, units = _headers(heading, separator)
    if not headers:
        raise DatasetError(
            f"{path}, line {number}: numbers begin without a header above them; write the names "
            "of the columns there, such as eps1 [%]"
        )
    places, rows = [], []
    for number, text in lines[first:]:
        if text.startswith(COMMENT):
            continue
        cells = _split(text, separator)
        if len(cells) != len(headers):
            commas = separator == "," and len(cells) > len(headers)
            raise DatasetError(
                f"{path}, line {number}: has {len(cells)} cells for {len(headers)} columns; mend "
                "the row"
                + (", or separate columns by semicolons if commas are decimal" if commas else "")
            )
        places.append(f"line {number}")
        rows.append(cells)
    columns = []
    for at, header in enumerate(headers):
        name, unit = split_header(header)
        shown = header if unit or not units else f"{header} [{units[at]}]"
        columns.append(
            Column(shown, name, unit or (units[at] if units else None), [row[at] for row in rows])
        )
    return Table(str(path), places, columns)


def _lines(path: Path) -> list[tuple[int, str]]:
    """Numbered lines that hold something."""
    try:
        text = path.read_bytes()
    except OSError as error:
        raise DatasetError(
            f"{path}: cannot be read ({error.strerror or error}); check the name"
        ) from error
    try:
        # Spreadsheets save "Unicode text" as UTF-16, with a mark at its start.
        marked = text.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        content = text.decode("utf-16" if marked else "utf-8-sig")
    except UnicodeDecodeError:
        content = text.decode("latin-1")  # what laboratory software wrote before Unicode
    if "\0" in content:
        raise DatasetError(f"{path}: is not a text file; give a CSV, .dat, .xlsx or .npz file")
    numbered = enumerate(content.splitlines(), start=1)
    return [(number, line.strip(" ")) for number, line in numbered if line.strip(" \t,;")]


def _holds_numbers(text: str) -> bool:
    """Whether a line is a row of the table: no comment, and most of its cells are numbers."""
    if text.startswith(COMMENT):
        return False
    cells = [cell for cell in re.split(r"[,;\s]+", text.replace('"', "")) if cell]
    return sum(map(is_number, cells)) * 2 > len(cells)


def _separator(texts: Sequence[str]) -> str | None:
    """The character between cells, None for blanks."""
    row = texts[-1]
    for separator in (";", "\t", ","):
        if separator in row:
            return separator
    # Rows of one column have none; else blanks separate, which headers hold within their names.
    return "," if len(row.split()) == 1 else None


def _split(text: str, separator: str | None) -> list[str]:
    if separator is None:
        return text.split()
    return [cell.strip() for cell in next(csv.reader([text], delimiter=separator))]


def _headers(heading: Sequence[str], separator: str | None) -> tuple[list[str], list[str]]:
    """Names of the columns, and their units where a line of its own gives them."""
    lines = [line.lstrip(COMMENT).strip() for line in heading]
    units: list[str] = []
    if lines and (found := _unit_line(lines[-1], alone=len(lines) == 1)):
        units = found
        lines.pop()
    if not lines:
        return [], []
    names = _header_cells(lines[-1], separator)
    if units and len(units) != len(names):
        units = []
    return names, units


def _unit_line(line: str, alone: bool) -> list[str] | None:
    """The units of a line that holds nothing else, or None.

    Below a line of names it holds units where every cell is in brackets or most are known; which
    of them is not is for the reader of that column to say.
    """
    cells = [cell for cell in re.split(r"[,;\s]+", line) if cell]
    if not cells:
        return None
    units = [cell.strip("[]()") for cell in cells]
    known = sum(unit_factor(unit) is not None for unit in units)
    bracketed = all(cell[0] in "[(" and cell[-1] in "])" for cell in cells)
    if known == len(cells):
        return units
    return units if not alone and (bracketed or 2 * known > len(cells)) else None


def _header_cells(line: str, separator: str | None) -> list[str]:
    if separator is not None and separator in line:
        return _split(line, separator)
    if re.search(r"\s{2,}|\t", line):  # names of several words, as in ``Void ratio   q``
        return [cell.strip() for cell in re.split(r"\s{2,}|\t", line) if cell.strip()]
    return line.split()
