"""Workbooks: what a person sees in a sheet is what is read, and sizes are bounded before."""

import zipfile
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
import pytest

from granbench.errors import ConfigurationError, DatasetError
from granbench.fem.load_path_file import read_load_path
from granbench.laboratory import read_tests
from granbench.paths.strain_files import read_path
from granbench.tables.workbook import read_sheets

MAIN = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
OFFICE = 'xmlns:r="http://schemas.openxmlformats.org/officeDocument/2006/relationships"'
STYLES = (
    f'<styleSheet {MAIN}><numFmts><numFmt numFmtId="164" formatCode="yyyy\\-mm\\-dd hh:mm"/>'
    '<numFmt numFmtId="165" formatCode="0.0&quot; d&quot;"/></numFmts>'
    '<cellStyleXfs><xf numFmtId="14"/></cellStyleXfs><cellXfs><xf numFmtId="0"/>'
    '<xf numFmtId="164"/><xf numFmtId="10"/><xf numFmtId="165"/></cellXfs></styleSheet>'
)


def cell(value, **attributes: str) -> str:
    """A cell of text, a number, or raw XML that begins with ``<``."""
    inside = f"<v>{value!r}</v>"
    if isinstance(value, str):
        attributes |= {} if value.startswith("<") else {"t": "inlineStr"}
        inside = value if value.startswith("<") else f"<is><t>{escape(value)}</t></is>"
    return f"<c {' '.join(f'{k}={v!r}' for k, v in attributes.items())}>{inside}</c>"


def sheet(rows) -> str:
    inside = "".join(
        f"<row>{''.join(part if str(part).startswith('<c') else cell(part) for part in row)}</row>"
        for row in rows
    )
    return f"<worksheet {MAIN}><sheetData>{inside}</sheetData></worksheet>"


def workbook(path: Path, sheets: dict[str, str], *, states: dict[str, str] | None = None, **parts):
    names = "".join(
        f'<sheet name="{name}" sheetId="{k}" state="{(states or {}).get(name, "visible")}" '
        f'r:id="rId{k}"/>'
        for k, name in enumerate(sheets, start=1)
    )
    links = "".join(
        f'<Relationship Id="rId{k}" Type="t" Target="worksheets/sheet{k}.xml"/>'
        for k in range(1, len(sheets) + 1)
    )
    relations = "http://schemas.openxmlformats.org/package/2006/relationships"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(
            "xl/workbook.xml", f"<workbook {MAIN} {OFFICE}><sheets>{names}</sheets></workbook>"
        )
        archive.writestr(
            "xl/_rels/workbook.xml.rels",
            f'<Relationships xmlns="{relations}">{links}</Relationships>',
        )
        archive.writestr("xl/styles.xml", STYLES)
        for k, content in enumerate(sheets.values(), start=1):
            archive.writestr(f"xl/worksheets/sheet{k}.xml", content)
        for name, content in parts.items():
            archive.writestr(name, content)
    return path


NUMBERS = [[0.0, 0.0, 100.0], [0.5, 60.0, 120.0], [1.0, 100.0, 133.0], [1.5, 130.0, 143.0],
           [2.0, 150.0, 150.0], [2.5, 160.0, 153.0]]  # fmt: skip
TEST = [["eps1 [%]", "q [kPa]", "p [kPa]"], *NUMBERS]


@pytest.mark.parametrize(
    "rows",
    [
        TEST,
        [["Specimen 3"], ["Height (mm)", 100.2, 100.1], [], *TEST],
        [["eps1", "q", "p"], ["%", "kPa", "kPa"], *NUMBERS, ["End of test"]],
        [["Time", *TEST[0]], *([cell(44958.5 + k, s="1"), *row] for k, row in enumerate(NUMBERS))],
        [TEST[0], *([f"<c t='str'><f>A1</f><v>{row[0]!r}</v></c>", *row[1:]] for row in NUMBERS)],
        [TEST[0], *([cell(row[0] / 100.0, s="2"), *row[1:]] for row in NUMBERS)],
        [TEST[0], *([cell(row[0], s="3"), *row[1:]] for row in NUMBERS)],
        [[*TEST[0]], *([*row, "", "a note", 7.0] for row in NUMBERS)],
    ],
    ids=["plain", "metadata", "units", "dates", "formulas", "per cent", "literal", "notes"],
)
def test_the_one_sheet_of_a_workbook_is_a_table(rows, tmp_path) -> None:
    (test,) = read_tests(workbook(tmp_path / "x.xlsx", {"Data": sheet(rows)}))
    numbers = np.array(NUMBERS)
    np.testing.assert_allclose(test.axial_strain, -np.log1p(-numbers[:, 0] / 100), atol=1e-12)
    np.testing.assert_allclose(test.deviatoric_stress, 1e3 * numbers[:, 1], atol=1e-6)


def test_paths_and_load_paths_are_read_from_workbooks_too(tmp_path) -> None:
    rows = [
        ["eps_11 [%]", "sig_22 [kPa]", "sig_33 [kPa]"],
        [0.0, 100.0, 100.0],
        [1.0, 100.0, 100.0],
    ]
    path = read_path(workbook(tmp_path / "p.xlsx", {"A": sheet(rows)}))
    np.testing.assert_allclose(path.values, [[0, 1e5, 1e5], [0.01, 1e5, 1e5]])
    rows = [["time", "displacement"], ["s", "mm"], [0.0, 0.0], [1.0, 5.0]]
    history = read_load_path(workbook(tmp_path / "l.xlsx", {"A": sheet(rows)}))
    assert history.values == (0.0, 0.005)


def test_hidden_and_empty_sheets_do_not_count_but_two_tables_are_refused(tmp_path) -> None:
    sheets = {"Data": sheet(TEST), "Old": sheet(TEST), "Empty": sheet([])}
    assert read_tests(workbook(tmp_path / "a.xlsx", sheets, states={"Old": "hidden"}))
    with pytest.raises(DatasetError, match=r"2 sheets with cells \(Data, Old\)"):
        read_tests(workbook(tmp_path / "b.xlsx", sheets))


def test_a_formula_without_stored_result_is_named(tmp_path) -> None:
    rows = [*TEST[:3], ["<c><f>A2+1</f></c>", 100.0, 133.0], *TEST[4:]]
    with pytest.raises(DatasetError, match=r"sheet Data, row 4: column 'eps1 \[%\]' .*formula"):
        read_tests(workbook(tmp_path / "x.xlsx", {"Data": sheet(rows)}))


ENTITIES = '<!DOCTYPE x [<!ENTITY a "AAAA"><!ENTITY b "&a;&a;&a;">]>'
WIDE_TEXT = '<?xml version="1.0" encoding="utf-16"?>'
WIDE = "".join(f'<row r="{k}"><c r="XFD{k}"><v>1</v></c></row>' for k in range(1, 1000))


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (sheet([]).replace("<sheetData>", '<sheetData><row r="1"><c r="ZZZ1"/></row>'), "ZZZ1"),
        (f"<worksheet {MAIN}><sheetData>{WIDE}</sheetData></worksheet>", "more than 2,000,000"),
        (sheet([]).replace("<sheetData>", '<sheetData><row r="99999999"/>'), "row numbered"),
        (sheet([]).replace("<sheetData>", '<sheetData><row r="-1"/>'), "row numbered"),
        (sheet([]).replace("<sheetData>", '<sheetData><row r="1"><c r="A7"/></row>'), "'A7'"),
        (sheet([["<c t='s'><v>9</v></c>"]]), "text '9'"),
        (f"{ENTITIES}{sheet(TEST)}", "entities"),
        (
            f'<?xml version="1.0" encoding="utf-16"?>{ENTITIES}{sheet(TEST)}'.encode("utf-16"),
            "entit",
        ),
        ("<worksheet>", "damaged"),
        ("", "damaged"),
    ],
    ids=[
        "column",
        "area",
        "row",
        "negative",
        "elsewhere",
        "text",
        "entities",
        "utf-16",
        "open",
        "none",
    ],
)
def test_sheets_beyond_their_bounds_are_refused(content, named, tmp_path) -> None:
    path = workbook(tmp_path / "x.xlsx", {"Data": content})
    with pytest.raises(DatasetError, match=named) as refusal:
        read_tests(path)
    assert "x.xlsx" in str(refusal.value) and "\n" not in str(refusal.value)


def test_utf_16_without_entities_is_read(tmp_path) -> None:
    content = f"{WIDE_TEXT}{sheet(TEST)}".encode("utf-16")
    assert read_tests(workbook(tmp_path / "x.xlsx", {"Data": content}))


def test_archives_with_false_sizes_are_refused(tmp_path) -> None:
    path = workbook(tmp_path / "x.xlsx", {"Data": sheet(TEST)})
    whole = path.read_bytes()
    with pytest.warns(UserWarning), zipfile.ZipFile(path, "a") as archive:
        archive.writestr("xl/worksheets/sheet1.xml", sheet(TEST))
    with pytest.raises(ConfigurationError, match="occurs twice"):
        read_sheets(path, ConfigurationError)
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ConfigurationError, match="damaged"):
        read_sheets(path, ConfigurationError)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/workbook.xml", b" " * 200_000_000)
    with pytest.raises(ConfigurationError, match="unpacks to 200 MB"):
        read_sheets(path, ConfigurationError)


@pytest.mark.parametrize("numbers", [(0.0, 400.0, 800.0, 950.5), ("0", "400", "800", "950")])
def test_text_that_may_be_grouped_thousands_is_refused(numbers, tmp_path) -> None:
    stresses = [*numbers, "1.058", "1.127"]
    rows = [(float(row), 0.1 * row, 300.0, q) for row, q in enumerate(stresses)]
    headers = ("eps1 [%]", "epsv [%]", "sigma3' [kPa]", "q [kPa]")
    path = tmp_path / "test.xlsx"
    workbook(path, {"test": sheet([headers, *rows])})
    with pytest.raises(DatasetError, match=r"row 6.*q \[kPa\].*thousands"):
        read_tests(path)
