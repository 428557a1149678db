"""Position of the table in a file: its heading, its line of units, and the separator of cells.

The file of a laboratory holds more than a table: lines about the specimen, comments, headings of
two lines, units. The heading is a line of names directly above rows with as many cells; of several
such lines it is the one with the most known names.
"""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from granbench.tables.text_rows import is_number_row
from granbench.tables.written_numbers import cell_kind
from granbench.units.known_units import LONGEST_HEADER, is_unit, split_header

HEAD, HEAD_CHARACTERS = 2000, 200_000
"""Largest number of lines and characters before the table."""
LINES_BELOW = 4
"""Largest number of lines of text between the names of the columns and the first row."""
COMMENTS_BELOW = 100
"""Largest number of lines of any kind between them."""
ROWS_JUDGED = 20

IsKnown = Callable[[str], bool]
_BARE_UNIT = re.compile(r"[\[({].*[\])}]")


@dataclass(frozen=True)
class Headings:
    """The heading of a table.

    Parameters
    ----------
    separator : between cells, one of `granbench.tables.text_rows.SEPARATORS`
    at : index of the line of names, from 0
    first_row : index of the first row of numbers; the number of lines if there is none
    names : of the columns
    units : of the columns, None if no line gives them
    fits : whether the first row has as many cells as there are names
    """

    separator: str
    at: int
    first_row: int
    names: tuple[str, ...]
    units: tuple[str, ...] | None
    fits: bool
    score: tuple[int, ...] = ()


def find_headings(lines: Sequence, separators: Iterable[str], is_known: IsKnown) -> Headings | None:
    """Find the heading of the table; None if there is no line of names.

    Parameters
    ----------
    lines : with `cells`, `readings`, `comment`, `is_blank` and `is_drawn`, see
        `granbench.tables.text_rows.Line`
    separators : possible separators of cells, the preferred one first
    is_known : whether the name of a column, without its unit, is a known one
    """
    lines = _head(lines)
    found: list[Headings] = []
    for preference, separator in enumerate(separators):
        rows = [line.cells(separator) if line.comment is None else () for line in lines]
        numeric = [is_number_row(row) for row in rows]
        for at, line in enumerate(lines):
            if line.is_drawn:
                continue
            headings = _headings_on(lines, rows, numeric, at, separator, is_known)
            if headings is not None:
                found.append(_scored(headings, lines, rows, is_known, preference))
    return max(found, key=lambda headings: headings.score, default=None)


def _head(lines: Sequence) -> Sequence:
    left = HEAD_CHARACTERS
    for count, line in enumerate(lines[:HEAD]):
        left -= len(line.text)
        if left < 0:
            return lines[: max(count, 2)]
    return lines[:HEAD]


def _headings_on(
    lines: Sequence,
    rows: Sequence[Sequence],
    numeric: Sequence[bool],
    at: int,
    separator: str,
    is_known: IsKnown,
) -> Headings | None:
    """The heading with its names on one line, or None if the line cannot be one."""
    first = _first_row(lines, numeric, at)
    if first is None:
        return None
    readings = [_trimmed(reading) for reading in lines[at].readings(separator)]
    readings = [reading for reading in readings if _may_be_names(reading, is_known)]
    if first == len(rows):
        # Without rows only known names distinguish a heading from other text.
        readings = [r for r in readings if all(_knows(name, is_known) for name in r)]
    if not readings:
        return None
    fitting = [r for r in readings if first == len(rows) or lines[first].fits(separator, len(r))]
    chosen = max(fitting or readings, key=lambda reading: _known_count(reading, is_known))
    names = _with_line_above(lines, at, separator, chosen, is_known) if fitting else chosen
    units = _unit_line(lines[at + 1 : first], separator, len(names))
    return Headings(separator, at, first, names, units, bool(fitting))


def _first_row(lines: Sequence, numeric: Sequence[bool], at: int) -> int | None:
    """The first row of numbers below a line, if only a few lines are between them."""
    between = 0
    for below in range(at + 1, min(at + 1 + COMMENTS_BELOW, len(lines))):
        if numeric[below] and not lines[below].is_drawn:
            return below
        between += lines[below].comment is None and not lines[below].is_drawn
        if between > LINES_BELOW:
            return None
    return len(lines) if at + 1 + COMMENTS_BELOW >= len(lines) else None


def _may_be_names(cells: Sequence, is_known: IsKnown) -> bool:
    if any(len(str(cell)) > LONGEST_HEADER for cell in cells):
        return False
    kinds = [cell_kind(cell) for cell in cells]
    if not kinds or any(kind in ("number", "date") for kind in kinds):
        return False
    written = [str(cell) for cell, kind in zip(cells, kinds, strict=True) if kind != "blank"]
    lettered = sum(any(character.isalpha() for character in name) for name in written)
    if written[:1] == ["%"] or any(_BARE_UNIT.fullmatch(n) and _are_units([n]) for n in written):
        return False
    if 2 * len(written) < len(cells) or 2 * lettered < len(written) or "text" not in kinds:
        return False
    # A line of units is not a line of names, unless known names are spelled like units.
    return not _are_units(written) or _known_count(written, is_known) > 0


def _with_line_above(
    lines: Sequence, at: int, separator: str, names: tuple[str, ...], is_known: IsKnown
) -> tuple[str, ...]:
    """The names, joined with the line above if the joined names are known: two-line names."""
    if at == 0:
        return names
    best = names
    for reading in lines[at - 1].readings(separator):
        above = _trimmed(reading)
        if len(above) != len(names) or not all(
            cell_kind(cell) in ("text", "blank", "missing") for cell in above
        ):
            continue
        joined = tuple(f"{a} {b}".strip() for a, b in zip(above, names, strict=True))
        if _known_count(joined, is_known) > _known_count(best, is_known):
            best = joined
    return best


def _scored(
    headings: Headings,
    lines: Sequence,
    rows: Sequence[Sequence],
    is_known: IsKnown,
    preference: int,
) -> Headings:
    known = _known_count(headings.names, is_known)
    fits = headings.fits
    rank = 3 if fits and known else 2 if known > 1 else 1 if fits else 0
    if headings.first_row == len(lines):
        rank = -1
    count = len(headings.names)
    judged = [at for at in range(headings.first_row, len(rows)) if rows[at]][:ROWS_JUDGED]
    cells = sum(
        sum(cell_kind(cell) == "number" for cell in rows[at][:count])
        for at in judged
        if lines[at].fits(headings.separator, count)
    )
    score = (rank, known, cells, -headings.first_row, headings.at, -preference)
    return replace(headings, score=score)


def _knows(name: str, is_known: IsKnown) -> bool:
    return is_known(split_header(name)[0]) or is_known(name)


def _known_count(names: Iterable[str], is_known: IsKnown) -> int:
    return sum(_knows(str(name), is_known) for name in names)


def _trimmed(cells: Sequence) -> tuple:
    """Cells without empty ones at the end, which come from trailing separators."""
    count = len(cells)
    while count and cell_kind(cells[count - 1]) == "blank":
        count -= 1
    return tuple(cells[:count])


def _unit_line(lines: Sequence, separator: str, count: int) -> tuple[str, ...] | None:
    """The units on a line below the names with nothing else, one for each column."""
    best: tuple[str, ...] | None = None
    for line in lines:
        for reading in line.readings(separator):
            units = tuple(_bare_unit(cell) for cell in _trimmed(reading))
            units += ("",) * (count - len(units)) if separator == "cells" else ()
            if len(units) != count or not _may_be_units([c for c in reading if c.strip()]):
                continue
            if best is None or sum(map(bool, units)) > sum(map(bool, best)):
                best = units
    return best


def _bare_unit(cell: str) -> str:
    return cell.strip().strip("[](){}").strip()


def _are_units(cells: Sequence[str]) -> bool:
    return bool(cells) and all(is_unit(_bare_unit(cell)) for cell in cells)


def _may_be_units(cells: Sequence[str]) -> bool:
    """Whether cells are units: all in brackets, or most of them known.

    An unknown unit is reported when its column is read.
    """
    if not cells:
        return False
    known = sum(is_unit(_bare_unit(cell)) for cell in cells)
    bracketed = all(cell.strip()[0] in "[({" and cell.strip()[-1] in "])}" for cell in cells)
    return bracketed or 2 * known > len(cells)
