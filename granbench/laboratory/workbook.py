"""The cells of an .xlsx file, as far as a table of numbers needs them.

An .xlsx file is a ZIP archive of XML (ECMA-376 part 1, section 18); what a laboratory protocol
needs of it is so little that a library would be the larger part.
"""

import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from granbench.errors import DatasetError

Cell = str | float | None

_MAIN = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
_LINK = "{http://schemas.openxmlformats.org/officeDocument/2006/relationships}id"
LARGEST_PART = 64_000_000
"""Bytes of one unpacked part; more is no protocol but an archive that unpacks without end."""


def read_workbook(path: Path) -> dict[str, dict[int, list[Cell]]]:
    """Cells of every sheet: by sheet name and row number (from 1), each row from column A on.

    Raises
    ------
    DatasetError
        If the file is no .xlsx workbook or is damaged.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            texts = _shared_texts(archive)
            return {
                name: dict(_rows(_part(archive, place), texts)) for name, place in _sheets(archive)
            }
    except OSError as error:
        raise DatasetError(
            f"{path}: cannot be read ({error.strerror or error}); check the name"
        ) from error
    except (zipfile.BadZipFile, ElementTree.ParseError, KeyError, IndexError, ValueError) as error:
        raise DatasetError(
            f"{path}: is no .xlsx workbook or is damaged ({error}); save it again or export the "
            "sheet as CSV"
        ) from error


def _part(archive: zipfile.ZipFile, name: str) -> ElementTree.Element:
    if archive.getinfo(name).file_size > LARGEST_PART:
        raise ValueError(f"{name} unpacks to more than {LARGEST_PART / 1e6:g} MB")
    text = archive.read(name)
    # Entities multiply without end ("billion laughs"); a workbook defines none.
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise ValueError(f"{name} defines entities")
    return ElementTree.fromstring(text)


def _shared_texts(archive: zipfile.ZipFile) -> list[str]:
    if "xl/sharedStrings.xml" not in archive.namelist():
        return []
    items = _part(archive, "xl/sharedStrings.xml").iter(f"{_MAIN}si")
    return ["".join(text.text or "" for text in item.iter(f"{_MAIN}t")) for item in items]


def _sheets(archive: zipfile.ZipFile) -> Iterator[tuple[str, str]]:
    """Name of every sheet and its part of the archive, in the order of the book."""
    links = _part(archive, "xl/_rels/workbook.xml.rels")
    targets = {link.attrib["Id"]: link.attrib["Target"] for link in links}
    for sheet in _part(archive, "xl/workbook.xml").iter(f"{_MAIN}sheet"):
        target = targets[sheet.attrib[_LINK]]
        yield sheet.attrib["name"], target[1:] if target.startswith("/") else f"xl/{target}"


def _rows(sheet: ElementTree.Element, texts: list[str]) -> Iterator[tuple[int, list[Cell]]]:
    number = 0
    for row in sheet.iter(f"{_MAIN}row"):
        number = int(row.get("r", number + 1))
        cells: list[Cell] = []
        for cell in row.iter(f"{_MAIN}c"):
            at = _place(cell.get("r")) if cell.get("r") else len(cells)
            cells.extend([None] * (at + 1 - len(cells)))
            cells[at] = _value(cell, texts)
        yield number, cells


def _place(reference: str | None) -> int:
    """Column number from 0 of a reference such as ``AB12``."""
    letters = re.match(r"[A-Z]{1,3}", reference or "")
    if letters is None:
        raise ValueError(f"{reference!r} names no cell")
    place = 0
    for letter in letters.group():
        place = 26 * place + ord(letter) - ord("A") + 1
    return place - 1


def _value(cell: ElementTree.Element, texts: list[str]) -> Cell:
    kind = cell.get("t", "n")
    if kind == "inlineStr":
        return "".join(text.text or "" for text in cell.iter(f"{_MAIN}t"))
    value = cell.find(f"{_MAIN}v")
    if value is None or not value.text:
        return None
    if kind == "s":
        return texts[int(value.text)]
    return float(value.text) if kind == "n" else value.text
