"""One reader for every table: however one table is written, it has the same numbers."""

import numpy as np
import pytest

from granbench.errors import DatasetError
from granbench.tables.table_files import read_table

NAMES = ("eps1", "epsv", "q", "p")
HEADER = "eps1 [%],epsv [%],q [kPa],p [kPa]"
ROWS = ["0.0,0.00,0,100.0", "0.5,0.05,60,120.0", "1.0,0.10,100,133.3", "1.5,0.15,130,143.3"]
NUMBERS = np.array([[float(cell) for cell in row.split(",")] for row in ROWS])
PLAIN = "\n".join([HEADER, *ROWS])
UNITS = "[%],[%],[kPa],[kPa]"


def separated(text: str, separator: str, point: str = ".") -> str:
    return text.replace(",", separator).replace(".", point)


def read(tmp_path, content: str | bytes, known=NAMES):
    file = tmp_path / "table.csv"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_table(file, DatasetError, lambda name: name in known, "eps1 [%], q [kPa]", "a CSV")


def check(table) -> None:
    columns = {column.name: column for column in table.columns}
    found = np.stack([table.numbers(columns[name]) for name in NAMES], axis=-1)
    np.testing.assert_array_equal(found, NUMBERS)
    assert [columns[name].unit for name in NAMES] == ["%", "%", "kPa", "kPa"]


@pytest.mark.parametrize(
    "content",
    [
        PLAIN.encode(encoding)
        for encoding in (
            "utf-8",
            "utf-8-sig",
            "utf-16",
            "utf-16-le",
            "utf-16-be",
            "utf-32",
            "cp1252",
        )
    ]
    + [
        separated(PLAIN, ";", ",")
        .replace("kPa", "kN/m²")
        .encode("cp1252")
        .replace(b"kN/m\xb2", b"kPa"),
        PLAIN.replace("\n", "\r\n").encode(),
        PLAIN.replace("\n", "\r").encode(),
        (PLAIN + "\n\x1a").encode(),
        ("\n\n" + PLAIN.replace("\n", "\n\n") + "\n\n").encode(),
    ],
)
def test_encodings_and_line_ends(content, tmp_path) -> None:
    check(read(tmp_path, content))


@pytest.mark.parametrize(
    "text",
    [
        separated(PLAIN, ";"),
        separated(PLAIN, ";", ","),
        separated(PLAIN, "\t", ","),
        separated(PLAIN, " , "),
        "\n".join(f"| {line.replace(',', ' | ')} |" for line in [HEADER, *ROWS]),
        "\n".join(
            ["eps1  epsv  q  p", separated(UNITS, "  "), *(separated(r, "   ") for r in ROWS)]
        ),
        "\n".join(["eps1 epsv q p", "% % kPa kPa", *(separated(r, " ", ",") for r in ROWS)]),
        "\n".join([separated(HEADER, " "), *(separated(r, "\t") for r in ROWS)]),
        "\n".join(f"{line},," for line in [HEADER, *ROWS]),
        "\n".join([HEADER, *(f"{row}," for row in ROWS)]),
        "\n".join('"' + line.replace(",", '","') + '"' for line in [HEADER, *ROWS]),
        "\n".join(f'"{line}"' for line in [HEADER, *ROWS]),
        PLAIN.replace("eps1 [%]", '"eps1\n[%]"').replace("q [kPa]", '"q, [kPa]"'),
    ],
)
def test_separators_quotes_and_decimal_commas(text, tmp_path) -> None:
    check(read(tmp_path, text))


@pytest.mark.parametrize("mark", ["#", "##", "**", "*", "%", "!", "//"])
def test_headings_behind_comment_marks(mark, tmp_path) -> None:
    rows = "\n".join(separated(row, " ") for row in ROWS)
    heading = f"{mark} a test on sand\n{mark} eps1 epsv q p\n{mark} {separated(UNITS, ' ')}\n"
    check(read(tmp_path, heading + rows))
    check(read(tmp_path, f"{mark} a test\n{PLAIN}\n{mark} the end"))


@pytest.mark.parametrize(
    "before",
    [
        "Specimen 3\nHeight (mm),100.2,100.1,100.3\n",
        "Project,Dam\nDepth (m),5.5\nDiameter (mm),50.1\nVoid ratio,0.8\n\n",
        "Sample,Depth,Type,Date\nS1,5.5,CD,2020-01-01\n\n",
        "".join(f"Parameter {k},{k}.5\n" for k in range(40)),
        'Diameter: 1.4"\nHeight: 2.8"\nOperator: AB, CD\n',
        "Started 01.02.2023 10:00\n-----------------------\n",
    ],
)
def test_lines_about_the_specimen_are_not_the_table(before, tmp_path) -> None:
    check(read(tmp_path, before + PLAIN))


@pytest.mark.parametrize(
    "text",
    [
        "\n".join([HEADER, *ROWS[:2], HEADER, *ROWS[2:]]),
        "\n".join(["eps1,epsv,q,p", UNITS, *ROWS[:2], "", "eps1,epsv,q,p", UNITS, *ROWS[2:]]),
        "\n".join([PLAIN, "End of test"]),
        "\n".join([PLAIN, "", "Average,0.1,72,124", "Peak q (kPa),160", "Operator: AB"]),
        "\n".join([HEADER, "-----,-----,-----", "Ch1,Ch2,Ch3,Ch4", *ROWS]),
        "\n".join([HEADER, *ROWS[:2], "# unloading", *ROWS[2:]]),
        "\n".join([HEADER, ROWS[0] + "   # start", *ROWS[1:]]),
    ],
)
def test_repeated_headings_footers_and_remarks_are_left_out(text, tmp_path) -> None:
    check(read(tmp_path, text))


@pytest.mark.parametrize(
    ("header", "cell"),
    [
        ("Timestamp", "01/02/2023 10:0{}:00"),
        ("time", "2023-02-01T10:0{}:00Z"),
        ("Clock", "1:0{}:00 PM"),
        ("Remark", "stage {}"),
        ("u [kPa]", "NaN"),
        ("", "{}"),
        ("#", "{}"),
        ("LVDT", "#DIV/0!"),
    ],
)
def test_unused_columns_have_no_effect(header, cell, tmp_path) -> None:
    lines = [f"{header},{HEADER}", *(f"{cell.format(k)},{row}" for k, row in enumerate(ROWS))]
    check(read(tmp_path, "\n".join(lines)))


def test_a_heading_of_two_lines_is_one(tmp_path) -> None:
    text = "axial,volume,deviator,mean\nstrain,strain,stress,stress\n" + UNITS + "\n"
    known = ("axial strain", "volume strain", "deviator stress", "mean stress")
    table = read(tmp_path, text + "\n".join(ROWS), known)
    assert tuple(column.name for column in table.columns) == known


@pytest.mark.parametrize(
    ("cells", "numbers"),
    [
        (["0.5", '"1,058"', '"1,094"'], [0.5, 1058, 1094]),
        (["0.5", '"1,058.25"', '"12,001,058"'], [0.5, 1058.25, 12001058]),
        (["1'058", "1’094", "−3"], [1058, 1094, -3]),
        (["1\u00a0058", "1\u202f094", "–3"], [1058, 1094, -3]),
        (["1.0D+03", "2.5d-1", "1.0-005"], [1e3, 0.25, 1e-5]),
        (['"0,5"', '"1,25"', '"1,058"'], [0.5, 1.25, 1.058]),
        (['"1.058,5"', '"0,5"', '"1.058"'], [1058.5, 0.5, 1058]),
        ([".5", "5.", "+5e0"], [0.5, 5, 5]),
    ],
)
def test_numbers_are_read_as_they_are_written(cells, numbers, tmp_path) -> None:
    table = read(tmp_path, "\n".join(["q [kPa],n", *(f"{cell},1" for cell in cells)]))
    np.testing.assert_array_equal(table.numbers(table.columns[0]), numbers)


@pytest.mark.parametrize(
    ("cells", "named"),
    [
        (["900", '"1,058"', "2"], ["line 3", "1058 or 1.058"]),
        (['"0,5"', "1.058", "2"], ["line 3", "'1.058'"]),
        (['"0,5"', "0.5", "2"], ["line 2", "decimal commas"]),
        (["1_000", "2", "3"], ["line 2", "'1_000'"]),
        (["(5)", "2", "3"], ["line 2", "'(5)'"]),
        (["1", "****", "3"], ["line 3", "'****'"]),
        (["1", "1e999", "3"], ["line 3", "'1e999'"]),
        (["1", "", "3"], ["line 3", "is empty"]),
        (["1", "5 kPa", "3"], ["line 3", "into the header"]),
    ],
)
def test_a_cell_that_is_no_number_or_may_be_two_is_named(cells, named, tmp_path) -> None:
    table = read(tmp_path, "\n".join(["q [kPa],n", *(f"{cell},1" for cell in cells)]))
    with pytest.raises(DatasetError) as refusal:
        table.numbers(table.columns[0])
    for part in ("table.csv", "'q [kPa]'", *named):
        assert part in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "is empty"),
        ("some words\nand more\n", "no row of numbers"),
        ("1,2,3\n4,5,6\n", "line 1: numbers begin without a header"),
        (f"{PLAIN}\n0.5,0.1\n", "line 6: has 2 cells for 4"),
        (f"{HEADER},Remark\n0,0,900,900,\n1.0,0.2,1,058,900\n", "line 3: are '1' and '058' one"),
        ("eps1 [%],q [kPa]\n0,0,0,0\n0,5,60,0\n", "line 2: has 4 cells for 2 .*decimal"),
        ("\n".join([*PLAIN.split("\n")[:3], "power failure", *ROWS[2:]]), "line 4: has the text"),
        ("\n".join([PLAIN, HEADER, *ROWS]), "line 7: .*second test"),
        ("\n".join([PLAIN, "# next test", *ROWS]), "line 7: .*second test"),
        ("eps1 [%],q [kPa]\n-,MPa\n0,0\n1,5\n", r"eps1 \[%\].*has the unit % .* and -"),
        ("<html><table><tr><td>1</td></tr></table>", "web page"),
        ("%PDF-1.4 eps1", "PDF"),
        ("\x1f\x8b\x08", "compressed"),
        ("\0\1\2\3", "not a text file"),
    ],
)
def test_what_is_no_table_for_certain_is_refused(text, named, tmp_path) -> None:
    with pytest.raises(DatasetError, match=named) as refusal:
        read(tmp_path, text.encode("latin-1"))
    assert "table.csv" in str(refusal.value) and "\n" not in str(refusal.value)


def test_units_behind_every_number_are_those_of_the_column(tmp_path) -> None:
    table = read(tmp_path, "eps1,q\n0 %,0 kPa\n0.5 %,60 kPa\n")
    assert [column.unit for column in table.columns] == ["%", "kPa"]
    np.testing.assert_array_equal(table.numbers(table.columns[1]), [0, 60])
    with pytest.raises(DatasetError, match="has the unit"):
        read(tmp_path, "eps1 [-],q [kPa]\n0 %,0\n0.5 %,60\n")


def test_a_line_of_endless_cells_is_refused(tmp_path) -> None:
    with pytest.raises(DatasetError, match="line 2: has more than"):
        read(tmp_path, "eps1,q\n" + "0," * 50_000)
