"""The cells of one sheet of a workbook, counted while they are parsed."""

import datetime
import re
from collections.abc import Mapping
from dataclasses import dataclass

from granbench.errors import GranbenchError
from granbench.tables.written_numbers import Cell

Rows = dict[int, list[Cell]]
"""Cells by row number (from 1), each row from column A on."""

MOST_CELLS = 2_000_000
"""Largest number of cells of all sheets, including empty ones before the last of a row."""
MOST_ROWS, MOST_COLUMNS = 1_048_576, 16_384
"""Largest size of a sheet by the standard."""

NO_RESULT = "=(a formula without a stored result)"
"""Text of a cell whose formula has not been evaluated by a spreadsheet program."""

_REFERENCE = re.compile(r"([A-Z]{1,4})([0-9]{1,9})")
_EPOCH, _EPOCH_1904 = datetime.datetime(1899, 12, 30), datetime.datetime(1904, 1, 1)
_LAST_DAY = 2_958_466


@dataclass(frozen=True)
class Book:
    """Data that the sheets of a workbook share.

    Parameters
    ----------
    source : the file, for errors
    error : type of the error
    texts : shared texts, to which cells refer by number
    dates, percents : numbers of the styles for dates, and for per cent
    epoch_1904 : whether days are counted from 1904
    most_cells : of all sheets together
    """

    source: str
    error: type[GranbenchError]
    texts: list[str]
    dates: frozenset[int]
    percents: frozenset[int]
    epoch_1904: bool
    most_cells: int = MOST_CELLS


class SheetCells:
    """Handler of a parser that collects the cells of a sheet in `rows`."""

    def __init__(self, book: Book, name: str, most_cells: int) -> None:
        self.rows: Rows = {}
        self.count = 0
        self._book, self._most_cells = book, most_cells
        self._source = f"{book.source}, sheet {name}"
        self._number = 0
        self._cells: list[Cell] = []
        self._at = -1
        self._attributes: Mapping[str, str] = {}
        self._value: list[str] | None = None
        self._inside = ""
        self._has_formula = False

    def start(self, tag: str, attributes: Mapping[str, str]) -> None:
        """Handle the start of an element."""
        if tag == "row":
            text = attributes.get("r", str(self._number + 1))
            if not (text.isascii() and text.isdigit() and 0 < int(text[:9]) <= MOST_ROWS):
                raise self._refusal(f"has a row numbered {text[:20]!r}")
            self._number = int(text)
            self._cells = self.rows.setdefault(self._number, [])
            self._at = -1
        elif tag == "c":
            self._attributes = attributes
            self._value, self._has_formula = None, False
            self._at = self._place(attributes.get("r"))
        elif tag in ("v", "t", "f"):
            self._inside = tag
            self._has_formula |= tag == "f"

    def text(self, piece: str) -> None:
        """Handle text."""
        if self._inside in ("v", "t"):
            self._value = [*(self._value or ()), piece]

    def end(self, tag: str) -> None:
        """Handle the end of an element."""
        if tag == "c":
            # Rows without numbers, and cells without references, follow each other.
            missing = self._at + 1 - len(self._cells)
            self.count += max(missing, 0)
            if self.count > self._most_cells:
                raise self._refusal(
                    f"and those before it have more than {MOST_CELLS:,} cells, the empty ones "
                    "within their rows included"
                )
            self._cells.extend([None] * missing)
            self._cells[self._at] = self._cell()
        elif tag in ("v", "t", "f"):
            self._inside = ""

    def _refusal(self, what: str) -> GranbenchError:
        return self._book.error(
            f"{self._source} {what}; keep only the table and save it again, or export the sheet "
            "as CSV"
        )

    def _place(self, reference: str | None) -> int:
        """Column number from 0 of a reference such as ``AB12``."""
        if reference is None:
            column = self._at + 2
        else:
            found = _REFERENCE.fullmatch(reference.replace("$", "").upper())
            if found is None or int(found[2]) != self._number:
                raise self._refusal(
                    f"has in row {self._number} a cell with the reference {reference[:20]!r}"
                )
            column = 0
            for letter in found[1]:
                column = 26 * column + ord(letter) - ord("A") + 1
        if column > MOST_COLUMNS:
            raise self._refusal(
                f"has the cell {reference or column!r}, beyond the {MOST_COLUMNS:,} columns of a "
                "sheet"
            )
        return column - 1

    def _cell(self) -> Cell:
        kind = self._attributes.get("t", "n")
        text = "".join(self._value or ())
        if not text:
            return NO_RESULT if self._has_formula and self._value is None else None
        if kind == "s":
            if not (text.isdigit() and int(text) < len(self._book.texts)):
                raise self._refusal(f"refers to the text {text[:20]!r} that the workbook lacks")
            return self._book.texts[int(text)] or None
        if kind != "n":
            return {"b": {"1": "TRUE", "0": "FALSE"}.get(text, text)}.get(kind, text)
        try:
            number = float(text)
        except ValueError:
            return text
        style = self._attributes.get("s", "0")
        known = int(style) if style.isdigit() and len(style) < 9 else 0
        if known in self._book.percents:
            # The sheet shows 0.05 as "5 %", as its author sees it.
            return f"{100.0 * number!r}%"
        if known in self._book.dates and 0.0 <= number < _LAST_DAY:
            epoch = _EPOCH_1904 if self._book.epoch_1904 else _EPOCH
            moment = epoch + datetime.timedelta(days=number)
            return moment.time().isoformat() if number < 1.0 else moment.isoformat(" ")
        return number
