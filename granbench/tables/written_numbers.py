"""Numbers in their usual spellings: decimal commas, thousands separators, exponents.

``1,058`` is one thousand and fifty-eight in one file and slightly more than one in another. Such a
cell is read if other cells of the column, or of the table, show which mark is decimal; otherwise it
is refused.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

Cell = str | float | None

LONGEST_NUMBER = 100
"""Largest number of characters of a number."""

MISSING_WORDS = frozenset(
    [
        "nan",
        "+nan",
        "-nan",
        "na",
        "n/a",
        "n.a.",
        "#n/a",
        "#na",
        "null",
        "none",
        "-",
        "--",
        "---",
        "–",
        "—",
        "?",
        "inf",
        "+inf",
        "-inf",
        "infinity",
        "1.#qnan",
        "-1.#ind",
        "1.#inf",
        "#div/0!",
        "#num!",
        "#value!",
        "#ref!",
        "#name?",
        "#null!",
        "overflow",
        "ovf",
        "ol",
        "err",
        "error",
    ]
)
"""Words that programs write for a missing number."""

_CHARACTERS = str.maketrans(
    {
        "\N{MINUS SIGN}": "-", "\N{EN DASH}": "-", "\N{HYPHEN}": "-",
        "\N{NON-BREAKING HYPHEN}": "-", "\N{FULLWIDTH HYPHEN-MINUS}": "-",
        "\N{SMALL HYPHEN-MINUS}": "-",
        "\N{NO-BREAK SPACE}": " ", "\N{NARROW NO-BREAK SPACE}": " ", "\N{THIN SPACE}": " ",
        "\N{FIGURE SPACE}": " ", "\N{RIGHT SINGLE QUOTATION MARK}": "'", "\N{ACUTE ACCENT}": "'",
        "\N{ZERO WIDTH NO-BREAK SPACE}": None, "\N{ZERO WIDTH SPACE}": None,
    }
)  # fmt: skip

_EXPONENT = r"(?:[eEdDqQ][+-]?\d{1,4}|(?<=[\d.])[+-]\d{3})?"
"""Fortran writes D+03 for double precision, and omits the letter in three-digit exponents."""
_INTEGER = re.compile(r"[+-]?\d+(?:[eEdDqQ][+-]?\d{1,4})?", re.ASCII)
_POINT = re.compile(rf"[+-]?(?:\d+\.\d*|\.\d+){_EXPONENT}", re.ASCII)
_COMMA = re.compile(rf"[+-]?(?:\d+,\d+|,\d+){_EXPONENT}", re.ASCII)
_OPEN = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}", re.ASCII)
"""A number whose only mark may be decimal or may separate thousands."""
_GROUPED = re.compile(
    r"(?P<sign>[+-]?)(?P<head>[1-9]\d{0,2}(?P<mark>[ .,'])\d{3}(?:(?P=mark)\d{3})*)"
    r"(?:(?P<decimal>[.,])(?P<tail>\d*))?",
    re.ASCII,
)
_DATE = re.compile(
    r"\d{1,4}[./-](?:\d{1,2}|[A-Za-z]{3,9}\.?)[./-]\d{1,4}(?:[T ]+\d{1,2}[:.h]\d{2}.*)?"
    r"|\d{1,3}:\d{2}(?::\d{2})?(?:[.,:]\d+)?(?:\s*[AaPp]\.?[Mm]\.?)?",
    re.ASCII,
)
_WITH_UNIT = re.compile(r"[+-]?\d[\d.,]*\s*(?:%|‰|[A-Za-zµμ°][\w/^²³.%]{0,9})")


def cleaned(text: str) -> str:
    """A text without blanks around it, with plain minus signs, blanks and apostrophes."""
    return text.translate(_CHARACTERS).strip()


def cell_kind(cell: Cell) -> str:
    """The kind of a cell: ``number``, ``blank``, ``missing``, ``date``, ``with unit`` or ``text``.

    A number may still be ambiguous.
    """
    if not isinstance(cell, str):
        return "blank" if cell is None else "number"
    if len(cell) <= LONGEST_NUMBER and (_POINT.fullmatch(cell) or _INTEGER.fullmatch(cell)):
        return "number"  # the usual case, without looking for unusual characters
    text = cleaned(cell)
    if not text:
        return "blank"
    if len(text) > LONGEST_NUMBER:
        return "text"
    if _marks(text) is not None:
        return "number"
    if text.lower() in MISSING_WORDS or set(text) == {"*"}:
        return "missing"
    if _DATE.fullmatch(text):
        return "date"
    return "with unit" if _WITH_UNIT.fullmatch(text) else "text"


def _marks(text: str) -> str | None:
    """The decimal mark of a number: ``.``, ``,``, none (empty), or ``?`` if it is ambiguous.

    None if the text is not a number.
    """
    if _INTEGER.fullmatch(text):
        return ""
    if _OPEN.fullmatch(text):
        return "?"
    if _POINT.fullmatch(text):
        return "."
    if _COMMA.fullmatch(text):
        return ","
    if grouped := _GROUPED.fullmatch(text):
        mark, decimal = grouped["mark"], grouped["decimal"]
        if decimal is None:
            return {",": ".", ".": ","}.get(mark, "")
        return None if decimal == mark else decimal
    return None


@dataclass
class DecimalMarks:
    """The decimal marks in the cells of a column or a table.

    Parameters
    ----------
    shown : ``.`` and ``,`` with the first row in which it is decimal
    grouped : marks that separate thousands, as shown by a cell with both marks or with one several
        times
    """

    shown: dict[str, int] = field(default_factory=dict)
    grouped: set[str] = field(default_factory=set)

    @classmethod
    def of(cls, cells: Iterable[Cell]) -> "DecimalMarks":
        """The marks in cells, with their rows."""
        marks = cls()
        for row, cell in enumerate(cells):
            if not isinstance(cell, str) or not ("." in cell or "," in cell):
                continue
            text = cleaned(cell)
            mark = _marks(text)
            if mark in (".", ","):
                marks.shown.setdefault(mark, row)
                other = "," if mark == "." else "."
                if other in text or text.count(other) > 1:
                    marks.grouped.add(other)
        return marks

    def joined(self, other: "DecimalMarks") -> "DecimalMarks":
        """The marks of both."""
        return DecimalMarks(other.shown | self.shown, self.grouped | other.grouped)


def number_of(cell: Cell, column: DecimalMarks, table: DecimalMarks) -> float | None:
    """The number in a cell, or None if there is none or it is ambiguous.

    Parameters
    ----------
    cell : as in the file
    column, table : the decimal marks in the cells of the column, and of all columns
    """
    if not isinstance(cell, str):
        return cell
    text = cleaned(cell)
    mark = _marks(text) if len(text) <= LONGEST_NUMBER else None
    if mark is None:
        return None
    if mark == "?":
        mark = _decimal_mark("." if "." in text else ",", column, table)
        if mark is None:
            return None
    elif mark and len(column.shown) > 1:
        return None
    if mark == ",":
        text = text.replace(".", "").replace(",", ".")
    elif mark == ".":
        text = text.replace(",", "")
    return _as_float(text.replace(" ", "").replace("'", ""))


FALL = 20.0
"""Ratio of integers to numbers with a point, above which that point separates thousands."""
HUNDRED = 100.0
THOUSAND = 1000.0


def is_open_point(cell: Cell) -> bool:
    """Whether a cell is a number like ``1.058``, whose point may separate thousands."""
    if not isinstance(cell, str):
        return False
    text = cleaned(cell)
    return "." in text and _OPEN.fullmatch(text) is not None


def points_may_group(cells: Sequence[Cell], *, in_pascals: bool) -> bool:
    """Whether the points of a column may separate thousands, judged by its other numbers.

    Parameters
    ----------
    cells : of the column
    in_pascals : whether it is a stress in Pa, of which less than 1000 is negligible
    """
    points = [cleaned(str(cell)) for cell in cells if is_open_point(cell)]
    if not points or "." in DecimalMarks.of(cells).shown:
        return False
    largest = max(abs(float(text)) for text in points)
    others = [_plain_size(cell) for cell in cells if not is_open_point(cell)]
    whole = max((size for size in others if size is not None), default=0.0)
    if in_pascals and max(whole, largest) < THOUSAND:
        return True
    # If thousands are grouped, no integer in the column has four digits.
    return HUNDRED <= whole < THOUSAND or whole > FALL * largest


def _plain_size(cell: Cell) -> float | None:
    """Magnitude of a number without a mark: an integer, or a number of a workbook."""
    if isinstance(cell, str):
        text = cleaned(cell)
        return abs(_as_float(text)) if _INTEGER.fullmatch(text) else None
    return None if cell is None else abs(cell)


def _decimal_mark(mark: str, column: DecimalMarks, table: DecimalMarks) -> str | None:
    """The decimal mark of an ambiguous number that has only `mark`; None if it is unknown."""
    marks = column if column.shown or column.grouped else table
    if len(marks.shown) > 1:
        return None
    (decimal,) = marks.shown or ("",)
    if mark == ".":
        # A point is decimal unless the file has decimal commas; then it is ambiguous.
        if decimal != ",":
            return "."
        return "," if "." in marks.grouped or "." in table.grouped else None
    return decimal or None


def _as_float(text: str) -> float:
    lowered = text.lower().replace("d", "e").replace("q", "e")
    if "e" not in lowered and (bare := re.fullmatch(r"(.*[\d.])([+-]\d{3})", lowered)):
        lowered = f"{bare[1]}e{bare[2]}"
    return float(lowered)


def why_no_number(cell: Cell, column: Sequence[Cell]) -> str:
    """What is wrong with a cell for which `number_of` returns None, and the remedy.

    Parameters
    ----------
    cell : of the column
    column : all of its cells
    """
    if cell is None or (isinstance(cell, str) and not cleaned(cell)):
        return "is empty; fill the cell or remove the row"
    text, shown = cleaned(str(cell)), str(cell)[:60]
    mark = _marks(text)
    mixed = len(DecimalMarks.of(column).shown) > 1
    if mark == "?" and "," in text:
        return (
            f"holds {shown!r}, which may be {text.replace(',', '')} or "
            f"{text.replace(',', '.')}: does the comma separate thousands, or is it decimal? Write "
            f"{text.replace(',', '')} or, for the other, {text}0"
        )
    if is_open_point(cell) and not any("," in str(other) for other in column):
        return (
            f"holds {shown!r}, which may be {text.replace('.', '')} or {text}: does the point "
            f"separate thousands, or is it decimal? Write {text.replace('.', '')} or, for the "
            f"other, {text}0"
        )
    if mark is not None and (mixed or mark == "?"):
        return (
            f"holds {shown!r} among numbers with "
            f"{'both decimal points and decimal commas' if mixed else 'decimal commas'}: what does "
            "the mark mean? Write all numbers with decimal points and without thousands separators"
        )
    if cell_kind(cell) == "with unit":
        return (
            f"holds {shown!r}, which is not a number; write the unit into the header and the "
            "number alone into the cell"
        )
    return f"holds {shown!r}, which is not a finite number; fix the cell or remove the row"
