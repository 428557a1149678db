"""Ambiguous thousands separators, and rows that may belong to another test, raise questions."""

from pathlib import Path

import pytest

from granbench.errors import ConfigurationError, DatasetError
from granbench.laboratory import ImportSettings, read_tests
from granbench.laboratory.laboratory_test import LaboratoryTest
from granbench.paths.strain_files import read_path

HEADERS = ("eps1 [%]", "epsv [%]", "sigma3' [kPa]", "q [kPa]")


@pytest.fixture
def read(tmp_path: Path):
    """Reads a test from the text of a table."""

    def read_text(text: str) -> LaboratoryTest:
        path = tmp_path / "test.csv"
        path.write_text(text)
        (test,) = read_tests(path, ImportSettings())
        return test

    return read_text


def table(stresses: list[str], separator: str = ";", quote: str = "") -> str:
    rows = [
        (f"{row / 2:g}", f"{0.1 * row:g}", "300", stress) for row, stress in enumerate(stresses)
    ]
    return "\n".join(
        separator.join(f"{quote}{cell}{quote}" for cell in row) for row in [HEADERS, *rows]
    )


@pytest.mark.parametrize(
    ("stresses", "separator", "quote"),
    [
        (["0", "400", "800", "950", "1.058", "1.127", "1.150"], ";", ""),
        (["0", "400", "800", "950", "1.000", "1.127"], ",", '"'),
        (["0", "400", "800", "950", "12.500", "11.000"], ";", ""),
        (["0", "90", "950", "999", "1.001", "1.020"], "\t", ""),
        (["400", "500", "600", "700", "800", "-1.058"], ";", ""),
    ],
)
def test_points_in_a_column_with_larger_integers_are_ambiguous(
    stresses: list[str], separator: str, quote: str, read
) -> None:
    with pytest.raises(DatasetError, match=r"line \d+: .*'q \[kPa\]'.*point.*thousands"):
        read(table(stresses, separator, quote))


@pytest.mark.parametrize(
    "stresses",
    [
        ["0.000", "100.125", "110.500", "120.000", "121.250"],
        ["0", "100", "110.5", "120.125", "121"],
        ["0", "1.058", "1.127", "2", "3.5"],
        ["0", "400", "800", "950", "1.0580"],
        ["0", "100.125", "900.250", "1500", "1600"],
    ],
)
def test_points_that_are_decimal_are_read(stresses: list[str], read) -> None:
    found = read(table(stresses)).deviatoric_stress / 1e3
    assert found.tolist() == pytest.approx([float(stress) for stress in stresses])


@pytest.mark.parametrize("header", ["sig_xx", "sig_xx [Pa]", "SIG_XX [N/m2]"])
@pytest.mark.parametrize("last", ["150.000", "150000"])
def test_points_in_columns_of_pascals_are_ambiguous(header: str, last: str, tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text(f"{header},eps_yy,eps_xy\n100.000,0,0\n{last},0.01,0\n")
    with pytest.raises(ConfigurationError, match="line 2.*thousands"):
        read_path(path)


@pytest.mark.parametrize(
    "rows",
    [
        ["3,.3,400,1,158"],
        ["3,.3,1,158,900"],
        ["3,.3,400,1,000", "4,.3,400,1,010"],
    ],
)
def test_a_thousands_comma_that_fills_a_short_row_is_ambiguous(rows: list[str], read) -> None:
    lines = ["eps1 [%],epsv [%],s3' [kPa],q [kPa],note", "0,0,400,0,", "1,.1,400,500,"]
    rest = ["2,.2,400,950,", *rows, "5,.3,400,990,"]
    with pytest.raises(DatasetError, match="line 5.*one number, 1"):
        read("\n".join(lines + rest))


def test_remarks_in_some_rows_are_not_taken_for_numbers(read) -> None:
    lines = ["eps1 [%],epsv [%],s3' [kPa],q [kPa],note", "0,0,400,0,", "1,.1,400,500,"]
    test = read("\n".join([*lines, "2,.2,400,950,peak", "3,.3,400,940,", "4,.4,400,930,end"]))
    assert test.deviatoric_stress.max() == pytest.approx(950e3)


def rows(lateral: float, scale: float, first: int = 0) -> str:
    return "".join(
        f"{row},{0.1 * row:g},{lateral:g},{scale * row / (1 + row):.5g}\n"
        for row in range(first, 9)
    )


HEAD = ",".join(HEADERS) + "\n"


@pytest.mark.parametrize(
    ("between", "second"),
    [
        ("", rows(100, 100)),
        ("", rows(200, 200)),
        ("", rows(100, 90, first=1)),
        ("\n", rows(100, 110)),
        ("\n", rows(200, 200)),
        (HEAD, rows(200, 200)),
        ("\n" + HEAD, rows(100, 90, first=1)),
        ("", "4,0.4,100,66\n"),
        ("\n", "4.2,0.4,100,66\n"),
    ],
)
def test_a_second_test_and_a_row_of_averages_are_refused(between: str, second: str, read) -> None:
    with pytest.raises(DatasetError, match=r"line 1[123]: .*second test"):
        read(HEAD + rows(100, 100) + between + second)


def test_cycles_and_unloading_are_read(read) -> None:
    coarse = [(0, 0), (1, 50), (2, 80), (1, 10), (0, -20), (1, 40), (2, 85), (3, 90)]
    unloading = [(0, 0), (1, 50), (2, 80), (3, 90), (2.8, 0), (3, 89), (4, 95), (5, 97)]
    for points in (coarse, unloading):
        lines = [f"{strain},{0.1 * strain:g},100,{q}" for strain, q in points]
        assert read(HEAD + "\n".join(lines)).steps == len(points)


def test_extension_that_begins_again_is_refused(read) -> None:
    one = "".join(f"{-row},{-0.1 * row:g},100,{-50 * row / (1 + row):.5g}\n" for row in range(9))
    with pytest.raises(DatasetError, match="line 11: .*second test"):
        read(HEAD + one + one)
