"""Reader of all tables from users: strain paths, load paths and laboratory tests.

It reads text in the usual encodings, with cells separated by commas, semicolons, tabs, bars or
blanks, and sheets of .xlsx workbooks. Ambiguous files are refused with a question to the user.
"""

from collections.abc import Sequence
from pathlib import Path

from granbench.errors import GranbenchError
from granbench.files.input_file import require_file
from granbench.tables.table_layout import HEAD, Headings, IsKnown, find_headings
from granbench.tables.table_rows import table_rows
from granbench.tables.tables import Column, Table
from granbench.tables.text_rows import SEPARATORS, Line, is_number_row, read_lines
from granbench.tables.workbook import SheetRow, is_workbook, read_only_sheet
from granbench.tables.written_numbers import Cell, cell_kind
from granbench.units.known_units import (
    is_unit,
    length_factor,
    split_header,
    time_factor,
    unit_factor,
)

MOST_BYTES = 64_000_000
"""Largest size of a text file or a workbook."""


def read_table(
    path: Path, error: type[GranbenchError], is_known: IsKnown, example: str, kinds: str
) -> Table:
    """Read the table in a text file or in a workbook with one sheet.

    Parameters
    ----------
    path : of the file
    error : type of the error
    is_known : whether the name of a column, without its unit, is a known one; of several possible
        headings the one with the most known names is chosen
    example : columns that the file should have, for error texts
    kinds : permitted kinds of file, for error texts

    Raises
    ------
    GranbenchError
        The given one, naming file and line: the file is missing, too large or of another kind,
        there is no heading above the numbers, a row has another number of cells than the heading,
        there is text between the rows, a second table begins, a column has two units.
    """
    require_file(path, error, MOST_BYTES)
    if is_workbook(path):
        name, rows = read_only_sheet(path, error)
        lines: Sequence[Line] | Sequence[SheetRow] = rows
        source = f"{path}, sheet {name}"
        separators: tuple[str, ...] = ("cells",)
    else:
        lines = read_lines(path, error, kinds)
        source, separators = str(path), SEPARATORS
    headings = find_headings(lines, separators, is_known)
    if headings is None:
        raise _no_table(source, lines, separators, error, example)
    return _table(source, lines, headings, error)


def _no_table(
    source: str,
    lines: Sequence,
    separators: Sequence[str],
    error: type[GranbenchError],
    example: str,
) -> GranbenchError:
    if not lines:
        return error(f"{source}: is empty, with no row of numbers; give {example}")
    for line in lines[:HEAD]:
        if line.comment is None and any(is_number_row(line.cells(s)) for s in separators):
            return error(
                f"{source}, {line.place}: numbers begin without a header above them; add the "
                f"names of the columns: {example}"
            )
    return error(
        f"{source}: has no row of numbers below a header (its first line is "
        f"{' '.join(lines[0].text.split())[:60]!r}); give {example}"
    )


def _table(source: str, lines: Sequence, headings: Headings, error: type[GranbenchError]) -> Table:
    places, rows = table_rows(source, lines, headings, error)
    columns = []
    for at, header in enumerate(headings.names):
        cells = [row[at] for row in rows]
        if not header.strip() and _is_left_out(cells):
            continue
        below = (headings.units[at] if headings.units else "") or None
        columns.append(
            _column(source, " ".join(header.split()) or f"column {at + 1}", below, cells, error)
        )
    above = [*lines[: headings.at], *lines[headings.at + 1 : headings.first_row]]
    preamble = tuple((line.number, line.text) for line in above if not line.is_blank)
    return Table(source, places, columns, preamble)


def _column(
    source: str, header: str, below: str | None, cells: list, error: type[GranbenchError]
) -> Column:
    name, unit = split_header(header)
    if within := _unit_within(cells):
        cells = [str(cell).strip().removesuffix(within) if cell else cell for cell in cells]
        below = below or within
        if _in_si(below) != _in_si(within):
            unit, below = below, within
    if unit and below and _in_si(unit) != _in_si(below):
        raise error(
            f"{source}: column {header!r} has the unit {unit} in its header and {below} in the "
            "line below; keep the correct one"
        )
    shown = header if unit or not below else f"{header} [{below}]"
    return Column(shown, name, unit or below, cells)


def _unit_within(cells: Sequence[Cell]) -> str | None:
    """The unit after every number of a column, or None."""
    written = [str(cell).strip() for cell in cells if cell_kind(cell) != "blank"]
    units = {cell.lstrip("+-−0123456789.,' \N{NO-BREAK SPACE}") for cell in written}
    if len(units) != 1 or not all(cell_kind(cell) == "with unit" for cell in written):
        return None
    (unit,) = units
    return unit if is_unit(unit) else None


def _in_si(unit: str) -> object:
    """The factors of a unit to SI, for comparison with another unit."""
    factors = unit_factor(unit), length_factor(unit), time_factor(unit)
    return factors if any(factors) else unit.lower()


def _is_left_out(cells: list) -> bool:
    """Whether a column without a name is empty or holds row numbers, as from pandas."""
    if all(cell_kind(cell) == "blank" for cell in cells):
        return True
    texts = [str(cell).strip().removesuffix(".0") for cell in cells]
    return any(
        texts == [str(number) for number in range(first, first + len(texts))] for first in (0, 1)
    )
