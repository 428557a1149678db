"""The rows below a heading, without comments, repeated headings and footers."""

from collections.abc import Sequence
from itertools import pairwise

from granbench.errors import GranbenchError
from granbench.tables.table_layout import Headings
from granbench.tables.written_numbers import Cell, DecimalMarks, cell_kind, number_of

MOST_CELLS = 5_000_000
"""Largest number of rows times columns of a table."""

SUMMARIES = [
    "average",
    "avg",
    "mean",
    "median",
    "max",
    "maximum",
    "min",
    "minimum",
    "peak",
    "sum",
    "total",
    "std",
    "stdev",
    "st.dev",
    "sd",
    "range",
    "count",
    "end",
    "mittelwert",
    "mittel",
    "summe",
    "moyenne",
    "somme",
    "media",
    "promedio",
    "máx",
    "mín",
]
"""First words of a summary line below the table."""

Row = tuple[Cell, ...]


def table_rows(
    source: str, lines: Sequence, headings: Headings, error: type[GranbenchError]
) -> tuple[list[str], list[Row]]:
    """The rows of the table and their places; every row has one cell for each column.

    Comments, repeated headings and lines below the last row are left out.

    Raises
    ------
    GranbenchError
        The given one, naming file and line: a row has another number of cells, there is text
        between the rows, a second test begins below a repeated heading or a break, or there are
        too many rows.
    """
    count, separator = len(headings.names), headings.separator
    if count * (len(lines) - headings.first_row) > MOST_CELLS:
        raise error(
            f"{source}: has {len(lines) - headings.first_row:,} rows of {count} columns, more than "
            f"the {MOST_CELLS:,} cells that are read; keep fewer rows or columns"
        )
    repeated = {
        reading
        for line in lines[: headings.first_row]
        for reading in (line.cells(separator), *line.readings(separator))
    }
    kept: list[tuple[object, Row]] = []
    breaks: list[int] = []
    last_line = None
    for line in lines[headings.first_row :]:
        if line.comment is not None or line.is_drawn:
            breaks.append(len(kept))
            continue
        cells = line.row(separator, count)
        if cells in repeated and all(cell_kind(cell) != "number" for cell in cells):
            breaks.append(len(kept))
            continue
        if last_line is not None and line.number > last_line + 1:
            breaks.append(len(kept))
        last_line = line.number
        kept.append((line, cells))
    _drop_footer(kept, count)
    for line, cells in kept:
        _check_row(source, line, cells, headings, error)
    rows = [_fitted(cells, count) for _, cells in kept]
    places = [line.place for line, _ in kept]  # type: ignore[attr-defined]
    if separator == ",":
        _refuse_filled_up_rows(source, places, rows, error)
    _refuse_second_table(source, places, rows, breaks, error)
    return places, rows


def _drop_footer(kept: list[tuple[object, Row]], count: int) -> None:
    """Remove the lines below the last row: remarks, and marked averages."""
    while len(kept) > 1 and _is_footer(kept[-1][1], count, kept[0][1]):
        kept.pop()


def _is_footer(cells: Row, count: int, first: Row) -> bool:
    kinds = [cell_kind(cell) for cell in cells]
    written = [at for at, kind in enumerate(kinds) if kind != "blank"]
    if not written:
        return True
    at = written[0]
    if kinds[at] != "text":
        return False
    if not any(kind in ("number", "missing", "date", "with unit") for kind in kinds):
        # Only text; a row with a remark has numbers as well.
        return True
    words = str(cells[at]).lower().replace(":", " ").split()
    if words[0] in SUMMARIES:
        return True
    return len(cells) < count and (at >= len(first) or cell_kind(first[at]) != kinds[at])


def _check_row(
    source: str, line, cells: Row, headings: Headings, error: type[GranbenchError]
) -> None:
    count = len(headings.names)
    place = f"{source}, {line.place}"
    kinds = [cell_kind(cell) for cell in cells]
    if not any(kind in ("number", "missing", "date", "with unit") for kind in kinds):
        words = " ".join(str(cell) for cell in cells if cell is not None)
        raise error(
            f"{place}: has the text {words[:60]!r} among the rows of numbers; do the rows below it "
            "belong to the same test? Remove the line or, if they do not, the rows"
        )
    extra = [kind for kind in kinds[count:] if kind != "blank"]
    if len(cells) < count or extra:
        found = len(cells) if len(cells) < count else count + len(extra)
        commas = headings.separator == "," and extra
        raise error(
            f"{place}: has {found} cells for {count} column{'s' if count > 1 else ''}; fix the row"
            + (
                ", quote numbers that have commas, or separate columns by semicolons if commas are "
                "decimal"
                if commas
                else ""
            )
        )
    if headings.separator == ",":
        _refuse_split_thousands(place, cells[:count], error)


def _refuse_split_thousands(place: str, cells: Row, error: type[GranbenchError]) -> None:
    """Refuse ``1,058`` between commas if it is two cells and an empty cell hides that."""
    for before, cell in pairwise(cells):
        if (
            isinstance(cell, str)
            and isinstance(before, str)
            and len(cell) == 3
            and cell.isdigit()
            and cell[0] == "0"
            and before.lstrip("+-").isdigit()
            and 1 <= len(before.lstrip("+-")) <= 3
            and int(before) != 0
        ):
            raise error(
                f"{place}: are {before!r} and {cell!r} one number, {before}{cell}? Remove the "
                "comma that separates thousands, or the zeros before the number"
            )


def _refuse_filled_up_rows(
    source: str, places: Sequence[str], rows: Sequence[Row], error: type[GranbenchError]
) -> None:
    """Refuse ``1,158`` between commas if other rows have an empty last cell."""
    lengths = [max((at + 1 for at, cell in enumerate(row) if cell), default=0) for row in rows]
    shortest = min(lengths, default=0)
    for place, row, length in zip(places, rows, lengths, strict=True):
        if length == shortest or cell_kind(row[length - 1]) != "number":
            continue
        for before, cell in pairwise(row[:length]):
            digits = str(before or "").lstrip("+-")
            group = str(cell or "")
            if (
                digits.isdigit()
                and len(digits) <= 3
                and digits[0] != "0"
                and len(group) == 3
                and group.isdigit()
            ):
                raise error(
                    f"{source}, {place}: are {before!r} and {cell!r} one number, {before}{cell}? "
                    "Other rows have fewer cells. Remove the comma that separates thousands or, if "
                    "they are two numbers, fill or remove the cells that are empty in other rows"
                )


def _fitted(cells: Row, count: int) -> Row:
    return tuple(None if cell_kind(cell) == "blank" else cell for cell in cells[:count])


def _refuse_second_table(
    source: str,
    places: Sequence[str],
    rows: Sequence[Row],
    breaks: Sequence[int],
    error: type[GranbenchError],
) -> None:
    """Refuse rows that begin again after a break: they belong to another test."""
    nothing = DecimalMarks()
    for at in breaks:
        if not 1 < at < len(rows):
            continue
        first, before, after = (
            [number_of(cell, nothing, nothing) for cell in rows[row]] for row in (0, at - 1, at)
        )
        moved = [
            column
            for column, (start, end) in enumerate(zip(first, before, strict=True))
            if start is not None and end is not None and start != end
        ]
        back = [column for column in moved if after[column] == first[column]]
        if moved and moved[0] in back and 2 * len(back) > len(moved):
            raise error(
                f"{source}, {places[at]}: after a break the rows begin again at the numbers of "
                f"{places[0]}; does a second test begin here? Put every test into a file of its "
                "own, or close the gap"
            )
