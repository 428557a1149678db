"""Reading of the cells of .xlsx workbooks, as far as tables of numbers need them.

A workbook is a ZIP archive of XML (ECMA-376 part 1, section 18). A file of a few kilobytes may
declare an endless number of cells, so they are counted while they are parsed. No spreadsheet
library is used: openpyxl allocates cells before it can count them, and refuses workbooks without
``[Content_Types].xml``, which are read here.
"""

import posixpath
import re
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

from granbench.errors import GranbenchError
from granbench.files.bounded_reading import read_bounded
from granbench.files.input_file import require_archive
from granbench.tables.sheet_cells import Book, Rows, SheetCells
from granbench.tables.written_numbers import Cell

MOST_UNPACKED = 128_000_000
"""Largest size of all parts of a workbook, bytes."""
MOST_SHEETS = 255
MOST_TEXTS = 1_000_000

_DATE_FORMATS = frozenset((*range(14, 23), *range(27, 37), 45, 46, 47, *range(50, 59)))
"""Numbers of the built-in formats of dates and times."""
_LITERAL = re.compile(r'"[^"]*"|\\.|\[(?:[^\]hms]|[hms][^\]])[^\]]*\]|_.|General')
"""Literal parts of the code of a format, including colours and conditions."""
_PERCENT_FORMATS = frozenset((9, 10))


class _DamagedError(Exception):
    """A part of the archive is missing or damaged."""


_DAMAGE = (zipfile.BadZipFile, zlib.error, expat.ExpatError, EOFError, _DamagedError)


@dataclass(frozen=True)
class SheetRow:
    """A row of a sheet, with the interface of `granbench.tables.text_rows.Line`."""

    number: int
    values: tuple[Cell, ...]
    comment: None = None
    is_blank: bool = False
    is_drawn: bool = False

    @property
    def place(self) -> str:
        """The place, for errors."""
        return f"row {self.number}"

    @property
    def text(self) -> str:
        """The cells as one text."""
        return " ".join(str(cell) for cell in self.values if cell is not None)

    def cells(self, separator: str) -> tuple[Cell, ...]:
        """The cells, without separators."""
        return self.values

    def row(self, separator: str, columns: int) -> tuple[Cell, ...]:
        """The cells below the headings, padded with empty ones: a row ends at its last cell.

        Further cells are notes next to the table.
        """
        return (self.values + (None,) * (columns - len(self.values)))[:columns]

    def fits(self, separator: str, columns: int) -> bool:
        """Whether it may be a row of so many columns: the columns of a sheet do not shift."""
        return True

    def readings(self, separator: str) -> Iterator[tuple[str, ...]]:
        """The cells as names or units of columns."""
        texts = [cell or "" for cell in self.values if cell is None or isinstance(cell, str)]
        if len(texts) == len(self.values):
            yield tuple(" ".join(text.split()) for text in texts)


def is_workbook(path: Path) -> bool:
    """Whether a file is an archive, as workbooks are, by its first bytes or its name."""
    with path.open("rb") as file:
        return file.read(4) == b"PK\3\4" or path.suffix.lower() in (".xlsx", ".xlsm")


def read_sheets(
    path: Path, error: type[GranbenchError], prefix: str = "", *, hidden: bool = True
) -> dict[str, Rows]:
    """The sheets whose names begin with a prefix, by name, in the order of the book.

    Raises
    ------
    GranbenchError
        The given one, if the file is not a .xlsx workbook, is damaged, protected or too large, or
        breaks the bounds of `granbench.files.bounded_reading`.
    """
    return read_bounded(path, error, cells_of_sheets, str(path), error, prefix, hidden)


def read_only_sheet(path: Path, error: type[GranbenchError]) -> tuple[str, list[SheetRow]]:
    """Name and rows of the one visible sheet of a workbook that has any cells.

    Raises
    ------
    GranbenchError
        The given one, see `read_sheets`, or if several sheets have cells.
    """
    filled = {}
    for name, cells in read_sheets(path, error, hidden=False).items():
        rows = [
            SheetRow(number, tuple(row))
            for number, row in cells.items()
            if any(cell is not None for cell in row)
        ]
        if rows:
            filled[name] = rows
    if len(filled) != 1:
        names = ", ".join(list(filled)[:8])
        raise error(
            f"{path}: has {len(filled) or 'no'} sheets with cells{f' ({names})' if names else ''}; "
            "which one has the test? Save only that one, or export it as CSV"
        )
    return next(iter(filled.items()))


def cells_of_sheets(
    path: str, error: type[GranbenchError], prefix: str, hidden: bool
) -> dict[str, Rows]:
    """Read sheets without bounds on memory and time, see `read_sheets`."""
    try:
        with zipfile.ZipFile(path) as archive:
            require_archive(archive, path, error, MOST_UNPACKED)
            return _sheets(archive, path, error, prefix, hidden)
    except OSError as problem:
        raise error(
            f"{path}: cannot be read ({problem.strerror or problem}); check the name"
        ) from problem
    except _DAMAGE as problem:
        raise error(
            f"{path}: is not a .xlsx workbook or is damaged ({problem}); save it again or "
            "export the sheet as CSV"
        ) from problem


def _sheets(
    archive: zipfile.ZipFile, source: str, error: type[GranbenchError], prefix: str, hidden: bool
) -> dict[str, Rows]:
    elements = list(_elements(archive, "xl/workbook.xml", error, source))
    parts = _parts_by_link(archive, source, error)
    chosen: dict[str, str] = {}
    for tag, attributes, _ in elements:
        if tag != "sheet" or not (hidden or attributes.get("state", "visible") == "visible"):
            continue
        part = parts.get(_link(attributes), "")
        if part in chosen.values() or attributes.get("name", "") in chosen:
            raise error(
                f"{source}: has one sheet under several names; save the workbook again or "
                "export the sheet as CSV"
            )
        chosen[attributes.get("name", "")] = part
        if len(chosen) > MOST_SHEETS:
            raise error(f"{source}: has more than {MOST_SHEETS} sheets; keep the one of the test")
    epoch_1904 = any(
        tag == "workbookPr" and attributes.get("date1904") in ("1", "true")
        for tag, attributes, _ in elements
    )
    book = Book(
        source, error, _texts(archive, source, error), *_styles(archive, source, error), epoch_1904
    )
    left = book.most_cells
    found = {}
    for name, part in chosen.items():
        if name.startswith(prefix) and "chartsheet" not in part:
            cells = SheetCells(book, name, left)
            _parse(archive, part, source, error, cells.start, cells.end, cells.text)
            found[name] = cells.rows
            left -= cells.count
    return found


def _link(attributes: Mapping[str, str]) -> str:
    return next((value for name, value in attributes.items() if name.endswith(" id")), "")


def _parts_by_link(
    archive: zipfile.ZipFile, source: str, error: type[GranbenchError]
) -> dict[str, str]:
    """Names of the parts by the links of the workbook."""
    return {
        attributes.get("Id", ""): posixpath.normpath(
            posixpath.join("/xl", attributes.get("Target", ""))
        ).lstrip("/")
        for tag, attributes, _ in _elements(archive, "xl/_rels/workbook.xml.rels", error, source)
        if tag == "Relationship"
    }


def _texts(archive: zipfile.ZipFile, source: str, error: type[GranbenchError]) -> list[str]:
    """The shared texts, to which cells refer by number."""
    if "xl/sharedStrings.xml" not in archive.namelist():
        return []
    texts: list[str] = []
    pieces: list[str] = []
    for tag, _, text in _elements(archive, "xl/sharedStrings.xml", error, source):
        if tag == "t":
            pieces.append(text)
        elif tag == "rPh":  # the pronunciation of a Japanese text
            pieces.pop()
        elif tag == "si":
            texts.append("".join(pieces))
            pieces.clear()
    return texts


def _styles(
    archive: zipfile.ZipFile, source: str, error: type[GranbenchError]
) -> tuple[frozenset[int], frozenset[int]]:
    """The numbers of the styles for dates, and for per cent."""
    if "xl/styles.xml" not in archive.namelist():
        return frozenset(), frozenset()
    codes: dict[str, str] = {}
    formats: list[str] = []
    xfs: list[str] = []
    for tag, attributes, _ in _elements(archive, "xl/styles.xml", error, source):
        if tag == "numFmt":
            codes[attributes.get("numFmtId", "")] = attributes.get("formatCode", "")
        elif tag == "xf":
            xfs.append(attributes.get("numFmtId", "0"))
        elif tag == "cellStyleXfs":
            xfs.clear()
        elif tag == "cellXfs":
            formats, xfs = xfs, []
    plain = [_LITERAL.sub("", codes.get(number, "")) for number in formats]
    dates = {
        at
        for at, number in enumerate(formats)
        if (number in codes and re.search(r"[dmyhs]", plain[at], re.IGNORECASE))
        or (number not in codes and number.isdigit() and int(number) in _DATE_FORMATS)
    }
    percent = {
        at
        for at, number in enumerate(formats)
        if "%" in plain[at] or (number.isdigit() and int(number) in _PERCENT_FORMATS)
    }
    return frozenset(dates), frozenset(percent - dates)


def _elements(
    archive: zipfile.ZipFile, name: str, error: type[GranbenchError], source: str
) -> Iterator[tuple[str, Mapping[str, str], str]]:
    """Elements of a part in the order of their ends: name, attributes and text."""
    ended: list[tuple[str, Mapping[str, str], str]] = []
    opened: list[tuple[Mapping[str, str], list[str]]] = []

    def start(tag: str, attributes: Mapping[str, str]) -> None:
        opened.append((attributes, []))

    def text(piece: str) -> None:
        opened[-1][1].append(piece)

    def end(tag: str) -> None:
        attributes, pieces = opened.pop()
        ended.append((tag, attributes, "".join(pieces)))
        if len(ended) > MOST_TEXTS:
            raise error(f"{source}: its part {name!r} has more than {MOST_TEXTS:,} elements")

    _parse(archive, name, source, error, start, end, text)
    return iter(ended)


def _parse(archive: zipfile.ZipFile, name: str, source: str, error, start, end, text) -> None:
    """Parse a part; the handlers get the names of elements without their namespace."""

    def refuse_entities(*declaration: object) -> None:
        # Entities can multiply endlessly ("billion laughs"); no spreadsheet program writes one.
        raise error(
            f"{source}: its part {name!r} defines entities (DOCTYPE); save the file again or "
            "export the sheet as CSV"
        )

    if name not in archive.namelist():
        raise _DamagedError(f"there is no item named {name!r} in the archive")
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    parser.StartElementHandler = lambda tag, attributes: start(tag.rpartition(" ")[2], attributes)
    parser.EndElementHandler = lambda tag: end(tag.rpartition(" ")[2])
    parser.CharacterDataHandler = text
    parser.StartDoctypeDeclHandler = refuse_entities
    with archive.open(name) as file:
        parser.ParseFile(file)
