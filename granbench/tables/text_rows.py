"""Text files as lines and cells: encodings, line ends, comment marks, separators and quotes."""

import codecs
import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from granbench.errors import GranbenchError
from granbench.tables.written_numbers import cell_kind

SEPARATORS = ("\t", ";", "|", ",", "blanks", "white space")
"""Separators of cells, in order of preference. *White space* includes the no-break blank."""

MOST_COLUMNS = 10_000
"""Largest number of separators on a line."""

LONGEST_QUOTE = 20
"""Largest number of lines of one quoted cell."""

_LINE_END = re.compile(r"\r*\n|\r")
_COMMENT = re.compile(
    r"(?:#(?!N/A|NA\b|DIV/0|NUM|VALUE|REF|NAME|NULL|#*[\s,;]*$)|\*{1,2}(?!\*)|%|!|//)[#*%!/]*\s*"
)
"""Marks of comments. ``#N/A`` and ``****`` are numbers that a program could not write."""
_BANNER = re.compile(r"[-=_+|*~#%!/:\s]*[-=_*~#]{3}[-=_+|*~#%!/:\s]*")
"""A ruled line, such as ``-----+-----``."""
_LAST_BRACKET = re.compile(r"[^\[\](){}]+[\[({][^\[\](){}]*[\])}]")
_REMARK_MARKS = ("#", "!", "//")
LONGEST_HEADING = 10_000
"""Largest number of characters of a heading; a longer line is a row of numbers."""

_KINDS_BY_START = (
    (b"\x1f\x8b", "is compressed; unpack it first"),
    (b"%PDF", "is a PDF document; export the table as CSV"),
    (b"\x89HDF", "is an HDF5 or netCDF file; give it the ending .nc, or export the table as CSV"),
    (b"CDF", "is a netCDF file; give it the ending .nc"),
    (
        b"\xd0\xcf\x11\xe0",
        "is an old Excel workbook (.xls) or one that is protected by a password; save it as .xlsx "
        "without a password, or export the sheet as CSV",
    ),
    (b"{\\rtf", "is a formatted document (RTF); save it as plain text"),
)
_MARKUP = re.compile(r"\s*<(?:\?xml|!doctype|html|table)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Line:
    """A line of text, or several that one quoted cell joins.

    Parameters
    ----------
    number : of the first line, from 1
    text : without the line end
    """

    number: int
    text: str

    @property
    def place(self) -> str:
        """The place, for errors."""
        return f"line {self.number}"

    @property
    def is_blank(self) -> bool:
        """Whether it holds only separators."""
        return not self.text.strip(' \t,;|"\N{NO-BREAK SPACE}')

    @property
    def is_drawn(self) -> bool:
        """Whether it is a ruled line, as below a heading."""
        return len(self.text) < LONGEST_HEADING // 10 and bool(_BANNER.fullmatch(self.text))

    @property
    def comment(self) -> str | None:
        """The text after a comment mark, or None if the line does not begin with one."""
        text = self.text.strip(" \t\"'")
        found = _COMMENT.match(text)
        return text[found.end() :].strip(" \t\"'") if found else None

    def cells(self, separator: str) -> tuple[str, ...]:
        """The line between separators, one of `SEPARATORS`."""
        return split_cells(self.text, separator)

    def row(self, separator: str, columns: int) -> tuple[str, ...]:
        """The cells of a row of numbers, without a remark at its end."""
        cells = self.cells(separator)
        bare = _without_remark(self.text)
        if bare == self.text:
            return cells
        shorter = split_cells(bare, separator)
        is_meant = len(shorter) == columns and (
            len(cells) != columns or cell_kind(cells[-1]) != "number" == cell_kind(shorter[-1])
        )
        return shorter if is_meant else cells

    def fits(self, separator: str, columns: int) -> bool:
        """Whether it may be a row of so many columns; further cells must be empty."""
        cells = self.row(separator, columns)
        return len(cells) >= columns and not any(cell.strip() for cell in cells[columns:])

    def readings(self, separator: str) -> Iterator[tuple[str, ...]]:
        """The line as names or units of columns, split in all ways in use."""
        texts = [self.text if self.comment is None else self.comment]
        first = self.cells(separator)[0] if self.comment is not None else ""
        if first == "%" or (first == "#" and separator not in ("blanks", "white space")):
            texts.append(self.text)  # a unit, or the name of a column that counts the rows
        for text in texts:
            if not text.strip():
                continue
            text = text.strip(" |") if separator == "|" else text.strip(" ")
            yield split_cells(text, separator)
            for mark in "\t;,":
                if mark in text:
                    yield split_cells(text, mark)
            words = [word.strip() for word in re.split(r"\s{2,}|\t", text) if word.strip()]
            yield tuple(words)  # names of several words, as in ``Void ratio   q``
            if len(text) < LONGEST_HEADING // 10:
                yield tuple(word.strip(" \t,;") for word in _LAST_BRACKET.findall(text))
            yield split_cells(text, "blanks")
            if not any(mark in text for mark in "\t;,|"):
                yield (text,)


def _without_remark(text: str) -> str:
    """A row without the text after a comment mark that follows a blank."""
    places = (text.find(mark) for mark in _REMARK_MARKS)
    starts = [at for at in places if at > 0 and text[at - 1] in " \t"]
    return text[: min(starts)].rstrip() if starts else text


def split_cells(text: str, separator: str) -> tuple[str, ...]:
    """The cells of a line, without blanks around them."""
    if separator == "white space":
        return tuple(text.split())
    if separator == "blanks":
        if '"' not in text:
            return tuple(cell for cell in re.split(r"[ \t]+", text) if cell)
        return tuple(cell for cell in _quoted(text.replace("\t", " "), " ") if cell)
    if separator == "|":
        text = text.strip().removeprefix("|").removesuffix("|")
    cells = _quoted(text, separator) if '"' in text else text.split(separator)
    if len(cells) == 1 and separator in cells[0]:
        cells = cells[0].split(separator)  # quotes around the whole line
    return tuple(_unquoted(cell.strip(" \t\f\v")) for cell in cells)


def _unquoted(cell: str) -> str:
    return cell[1:-1].strip() if len(cell) > 2 and cell[0] == cell[-1] == "'" else cell


def _quoted(text: str, separator: str) -> Sequence[str]:
    try:
        rows = list(
            csv.reader(
                io.StringIO(text, ""), delimiter=separator, skipinitialspace=True, strict=True
            )
        )
    except csv.Error:
        return text.split(separator)
    return rows[0] if len(rows) == 1 else text.split(separator)


def read_lines(path: Path, error: type[GranbenchError], kinds: str) -> list[Line]:
    """The lines of a text file that are not empty.

    Parameters
    ----------
    path : a regular file
    error : type of the error
    kinds : permitted kinds of file, for the error about a file that is not text

    Raises
    ------
    GranbenchError
        The given one, if the file cannot be read, is not text, or has a line of too many cells.
    """
    try:
        content = path.read_bytes()
    except OSError as problem:
        raise error(
            f"{path}: cannot be read ({problem.strerror or problem}); check the name"
        ) from problem
    for start, what in _KINDS_BY_START:
        if content.startswith(start):
            raise error(f"{path}: {what}")
    text = _decoded(content)
    if text is None:
        raise error(f"{path}: is not a text file; give {kinds}")
    if _MARKUP.match(text):
        raise error(
            f"{path}: is a web page or an XML file; open it in a "
            "spreadsheet program and save the table as CSV"
        )
    lines = [line for line in _joined(_LINE_END.split(text)) if not line.is_blank]
    for line in lines:
        if len(line.text) > MOST_COLUMNS and len(re.findall(r"[\t;|, ]+", line.text)) > (
            MOST_COLUMNS
        ):
            raise error(
                f"{path}, {line.place}: has more than {MOST_COLUMNS:,} cells; give a table with "
                "one row per line"
            )
    return lines


def _decoded(content: bytes) -> str | None:
    """The text of a file, or None if it is not text."""
    for mark, name in (
        (codecs.BOM_UTF8, "utf-8-sig"),
        (codecs.BOM_UTF32_LE, "utf-32"),
        (codecs.BOM_UTF32_BE, "utf-32"),
        (codecs.BOM_UTF16_LE, "utf-16"),
        (codecs.BOM_UTF16_BE, "utf-16"),
    ):
        if content.startswith(mark):
            return _plain_text(content.decode(name, errors="replace"))
    head = content[:4096]
    zeros = [head[start::2].count(0) / max(len(head) // 2, 1) for start in (0, 1)]
    for first, second, name in ((0, 1, "utf-16-le"), (1, 0, "utf-16-be")):
        # ASCII in two bytes a character: every other byte is zero.
        if zeros[second] > 0.6 and zeros[first] < 0.05:
            return _plain_text(content.decode(name, errors="replace"))
    if head[:1] == b"\0" or head.count(0) > 0.05 * len(head):
        return None
    for name in ("utf-8", "cp1252", "latin-1"):  # what laboratory software wrote before Unicode
        try:
            return _plain_text(content.decode(name))
        except UnicodeDecodeError:
            continue
    return None


def _plain_text(text: str) -> str | None:
    text = text.rstrip("\x1a\0")  # the end of a file on DOS
    head = text[:4096]
    strange = sum(character < " " and character not in "\t\n\r\f\v" for character in head)
    return None if strange > 0.05 * len(head) else text.lstrip("\ufeff")


def _joined(texts: Sequence[str]) -> Iterator[Line]:
    """Lines, joined where a quoted cell has line breaks."""
    at = 0
    while at < len(texts):
        end = _end_of_quotes(texts, at) if '"' in texts[at] else at
        yield Line(at + 1, "\n".join(texts[at : end + 1]))
        at = end + 1


def _end_of_quotes(texts: Sequence[str], at: int) -> int:
    """The line with the closing quote of a cell that begins on a line, or that line itself."""
    if not _is_open(texts[at]):
        return at
    for end in range(at + 1, min(at + LONGEST_QUOTE, len(texts))):
        if texts[end].count('"') % 2:
            return end
    return at


def _is_open(text: str) -> bool:
    """Whether a line ends within a quoted cell; a quote inside a cell, as in 1.4", opens none."""
    is_open, at_start = False, True
    for character in text:
        if character == '"':
            is_open = not is_open if is_open or at_start else False
        elif not is_open:
            at_start = character in ",;\t|" or (at_start and character == " ")
    return is_open


def is_number_row(cells: Sequence[str | float | None]) -> bool:
    """Whether a line between separators may be a row of the table: it has a number."""
    return any(cell_kind(cell) in ("number", "with unit") for cell in cells)
