"""Bad laboratory files: one sentence that names file, row and column."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from laboratory_files import drained_curve, write_csv, write_protocol

from granbench.errors import ConfigurationError, DatasetError
from granbench.laboratory import ImportSettings, read_tests

HEADERS = ["eps1 [%]", "epsv [%]", "q [kPa]", "p [kPa]", "e"]


def spoilt(tmp_path: Path, spoil: Callable[[list[str], list[np.ndarray]], None]) -> Path:
    headers, columns = list(HEADERS), list(drained_curve().values())
    spoil(headers, columns)
    return write_csv(tmp_path / "cd.csv", headers, columns)


def wrong_unit(headers: list[str], columns: list[np.ndarray]) -> None:
    columns[2] = columns[2].copy()
    columns[2][6] = 5e8


def pascals(headers: list[str], columns: list[np.ndarray]) -> None:
    headers[2:4] = ["q [Pa]", "p [Pa]"]


def percent_as_ratio(headers: list[str], columns: list[np.ndarray]) -> None:
    headers[0] = "eps1 [-]"


def void_ratio_in_percent(headers: list[str], columns: list[np.ndarray]) -> None:
    headers[4] = "e [%]"


def not_a_number(headers: list[str], columns: list[np.ndarray]) -> None:
    columns[3][4] = np.nan


def no_unit(headers: list[str], columns: list[np.ndarray]) -> None:
    headers[2] = "q"


def force(headers: list[str], columns: list[np.ndarray]) -> None:
    headers[2] = "q [kN]"


def barrels(headers: list[str], columns: list[np.ndarray]) -> None:
    headers[4] = "e [bbl]"


def twice(headers: list[str], columns: list[np.ndarray]) -> None:
    headers.append("p [kPa]")
    columns.append(columns[3])


def two_names(headers: list[str], columns: list[np.ndarray]) -> None:
    headers.append("deviator stress [kPa]")
    columns.append(columns[2])


def stress_in_percent(headers: list[str], columns: list[np.ndarray]) -> None:
    headers[2] = "q [%]"


def no_axial_strain(headers: list[str], columns: list[np.ndarray]) -> None:
    headers[0] = "time [-]"


def no_lateral_stress(headers: list[str], columns: list[np.ndarray]) -> None:
    del headers[3], columns[3]


def four_points(headers: list[str], columns: list[np.ndarray]) -> None:
    columns[:] = [column[:4] for column in columns]


def tension(headers: list[str], columns: list[np.ndarray]) -> None:
    columns[3] = -columns[3]


@pytest.mark.parametrize(
    ("spoil", "named"),
    [
        (
            wrong_unit,
            ["line 8", "'q [kPa]'", "5e+08 kPa", "suspicious", "units={'deviatoric_stress'"],
        ),
        (pascals, ["suspicious", "units={'stress': 'kPa'}"]),
        (percent_as_ratio, ["line 41", "'eps1 [-]'", "suspicious", "units={'axial_strain': '%'}"]),
        (void_ratio_in_percent, ["line 2", "'e [%]'", "suspicious", "units={'void_ratio': '-'}"]),
        (not_a_number, ["line 6", "'p [kPa]'", "'nan'"]),
        (no_unit, ["'q'", "no unit", "'q [kPa]'", "units={'deviatoric_stress': 'kPa'}"]),
        (force, ["'q [kN]'", "'kN'", "not a known unit", "MPa", "units={'deviatoric_stress'"]),
        (barrels, ["'e [bbl]'", "'bbl'", "use %", "units={'void_ratio'"]),
        (stress_in_percent, ["'q [%]'", "'%'", "kPa", "units={'deviatoric_stress': 'kPa'}"]),
        (no_axial_strain, ["axial strain", "'time [-]'", "columns={'axial_strain': HEADER}"]),
        (no_lateral_stress, ["lateral stress", "'q [kPa]'", "lateral_stress=PA"]),
        (twice, ["'p [kPa]' and 'p [kPa]' both", "mean stress", "remove one"]),
        (
            two_names,
            ["'q [kPa]' and 'deviator stress [kPa]'", "columns={'deviatoric_stress': HEADER}"],
        ),
        (four_points, ["4 rows", "5"]),
        (tension, ["line 2", "mean stress", "-100000 Pa", "tension_positive=True"]),
    ],
)
def test_bad_files_are_refused_in_one_sentence(
    spoil: Callable[[list[str], list[np.ndarray]], None], named: list[str], tmp_path: Path
) -> None:
    path = spoilt(tmp_path, spoil)
    with pytest.raises(DatasetError) as error:
        read_tests(path)
    text = str(error.value)
    assert "\n" not in text
    for part in (str(path), *named):
        assert part in text


def test_a_falling_axial_strain_is_refused_only_where_the_test_is_monotonic(tmp_path: Path) -> None:
    def swap(headers: list[str], columns: list[np.ndarray]) -> None:
        columns[0] = columns[0].copy()
        columns[0][[10, 11]] = columns[0][[11, 10]]

    path = spoilt(tmp_path, swap)
    assert len(read_tests(path)) == 1
    with pytest.raises(DatasetError, match=r"line 13: column 'eps1 \[%\]': .* falls.*monotonic"):
        read_tests(path, ImportSettings(monotonic=True))


def test_a_test_without_volume_is_read_only_where_the_lateral_stress_stands_for_it(
    tmp_path: Path,
) -> None:
    curve = drained_curve()
    columns = [curve["eps1"], curve["q"], curve["p"]]
    path = write_csv(tmp_path / "cd.csv", ["eps1 [%]", "q [kPa]", "p [kPa]"], columns)
    (test,) = read_tests(path)
    assert not test.lateral_strain_known
    with pytest.raises(DatasetError, match="stresses='effective'"):
        read_tests(path, ImportSettings(kind="triaxial-undrained"))


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (b"", "no row of numbers"),
        (b"1,2,3\n4,5,6\n", "line 1: numbers begin without a header"),
        (b"eps1 [%],q [kPa]\n0,1\n1,2,3\n", "line 3: has 3 cells for 2 .* if commas are decimal"),
        (b"\x00\x01\x02\x00binary", "not a text file"),
        (b"PK\x05\x06" + b"\0" * 18, "no known format"),
    ],
)
def test_files_of_another_kind_are_refused(content: bytes, named: str, tmp_path: Path) -> None:
    path = tmp_path / "test.dat"
    path.write_bytes(content)
    with pytest.raises(DatasetError, match=named):
        read_tests(path)


def test_workbooks_that_are_none_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "protocol.xlsx"
    path.write_bytes(b"no archive")
    with pytest.raises(DatasetError, match=r"xlsx"):
        read_tests(path)
    with pytest.raises(DatasetError, match="there is no such file"):
        read_tests(tmp_path / "nothing.csv")


def test_a_workbook_names_sheet_and_row_of_a_bad_cell(tmp_path: Path) -> None:
    curve = drained_curve()
    curve["q"][5] = 7e8
    curve["p"][5] = 100.0 + 7e8 / 3.0
    path = write_protocol(tmp_path / "protocol.xlsx", curve)
    with pytest.raises(DatasetError, match=r"sheet CID-REC-1, row 8: column 'q \[kPa\]'"):
        read_tests(path)


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        (
            {"columns": {"strain_axial": "A"}},
            "columns=.*no quantity 'strain_axial'",
        ),
        ({"units": {"stress": "%"}}, "units=.*'%'"),
        ({"units": {"mean_stress": "psig"}}, "units=.*'psig'.*kPa"),
        ({"units": {"strian": "%"}}, "units=.*strian"),
        ({"kind": "triaxal"}, "kind='triaxal'"),
        ({"strain_measure": "true"}, "strain_measure='true'"),
        ({"initial_void_ratio": -0.1}, "initial_void_ratio=-0.1"),
        ({"initial_void_ratio": 80.0}, "initial_void_ratio=80.0"),
        ({"lateral_stress": -1e5}, "lateral_stress=-100000.0 .*Pa"),
        ({"lateral_stress": 1e12}, "lateral_stress"),
    ],
)
def test_settings_that_make_no_sense_are_refused(settings: dict, named: str) -> None:
    with pytest.raises(ConfigurationError, match=named):
        ImportSettings(**settings)


def test_a_column_that_is_not_there_is_named(tmp_path: Path) -> None:
    path = spoilt(tmp_path, lambda headers, columns: None)
    with pytest.raises(DatasetError, match=r"no column 'Sigma'.*'eps1 \[%\]'"):
        read_tests(path, ImportSettings(columns={"axial_stress": "Sigma"}))
    path = spoilt(tmp_path, twice)
    with pytest.raises(DatasetError, match=r"2 columns 'p \[kPa\]'; rename one"):
        read_tests(path, ImportSettings(columns={"mean_stress": "p [kPa]"}))
    path = spoilt(tmp_path, two_names)
    chosen = ImportSettings(columns={"deviatoric_stress": "deviator stress"})
    assert len(read_tests(path, chosen)) == 1


def test_a_strange_unit_is_overruled_by_the_one_that_the_user_gives(tmp_path: Path) -> None:
    (plain,) = read_tests(spoilt(tmp_path, lambda headers, columns: None))
    path = spoilt(tmp_path, force)
    (given,) = read_tests(path, ImportSettings(units={"deviatoric_stress": "kPa"}))
    np.testing.assert_array_equal(given.stress, plain.stress)
    # A unit for all stresses does not make a stress of a force.
    with pytest.raises(DatasetError, match="'kN'"):
        read_tests(path, ImportSettings(units={"stress": "kPa"}))


@pytest.mark.parametrize("units", ["%;%;kN;kPa", "[%];[%];[kN];[pounds]"])
def test_a_strange_unit_in_a_line_of_units_is_named(units: str, tmp_path: Path) -> None:
    curve = drained_curve()
    columns = [curve[name] for name in ("eps1", "epsv", "q", "p")]
    rows = [";".join(f"{value:.12g}" for value in row) for row in zip(*columns, strict=True)]
    path = tmp_path / "cd.csv"
    path.write_text("\n".join(["Versuch 7", "eps1;epsv;q;p", units, *rows]))
    with pytest.raises(DatasetError, match=r"column 'q \[kN\]' .* is in 'kN'.*units="):
        read_tests(path)
