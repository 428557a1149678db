"""Missing information, and statements above a table, raise questions and are never guessed."""

from pathlib import Path

import numpy as np
import pytest

from granbench.errors import DatasetError
from granbench.laboratory import ImportSettings, LaboratoryTest, read_tests
from granbench.laboratory.headers import known_quantity
from granbench.laboratory.interpretation import laboratory_test_from
from granbench.tables.table_files import _table as table_of
from granbench.tables.table_layout import find_headings
from granbench.tables.workbook import SheetRow

AXIAL = np.linspace(0.0, 8.0, 17)
GROWN = AXIAL / (1.0 + AXIAL)
Q = 180.0 * GROWN
EXCESS = 120.0 * GROWN
CELL = np.full(17, 500.0)
SAME = np.zeros(17)
VOLUME = 1.5 * GROWN
DRAINED = {"eps1 [%]": AXIAL, "epsv [%]": VOLUME, "q [kPa]": Q, "sigma3 [kPa]": CELL}
"""kPa; strains in %."""


def read(
    tmp_path: Path, columns: dict[str, np.ndarray], above: tuple[str, ...] = (), **said: object
) -> LaboratoryTest:
    """The test of a file with these columns below these lines."""
    lines = [*above, ",".join(columns)]
    lines += [",".join(f"{v:.8g}" for v in row) for row in zip(*columns.values(), strict=True)]
    (tmp_path / "test.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (test,) = read_tests(tmp_path / "test.csv", ImportSettings(**said))
    return test


@pytest.mark.parametrize("first", [2.0, 5.0, 9.0, 24.0])
@pytest.mark.parametrize("header", ["Pore pressure [kPa]", "u [kPa]", "Presión de poro [kPa]"])
def test_a_pore_pressure_that_begins_low_may_be_an_excess(
    first: float, header: str, tmp_path: Path
) -> None:
    columns = {"eps1 [%]": AXIAL, "q [kPa]": Q, "Cell pressure [kPa]": CELL, header: first + EXCESS}
    with pytest.raises(DatasetError, match="back_pressure"):
        read(tmp_path, columns)
    absolute = read(tmp_path, columns, back_pressure=0.0)
    assert absolute.initial_mean_stress == pytest.approx(1e3 * (500.0 - first))
    excess = read(tmp_path, columns, back_pressure=3e5)
    assert excess.initial_mean_stress == pytest.approx(1e3 * (200.0 - first))


def test_a_low_pore_pressure_that_the_header_calls_total_is_absolute(tmp_path: Path) -> None:
    columns = {"eps1 [%]": AXIAL, "q [kPa]": Q, "Cell pressure [kPa]": CELL}
    test = read(tmp_path, columns | {"Total pore pressure [kPa]": 8.0 + EXCESS})
    assert test.initial_mean_stress == pytest.approx(492e3)


@pytest.mark.parametrize("header", ["Sr [%]", "q [mm]", "p [-]", "sigma1 [kN]", "u [mm]", "Sr"])
def test_a_unit_for_all_stresses_leaves_columns_of_another_dimension_alone(
    header: str, tmp_path: Path
) -> None:
    columns = {"eps1 [%]": AXIAL, "epsv [%]": VOLUME, header: CELL}
    others = {"q [kPa]": Q, "sigma3 [kPa]": CELL}
    columns |= {name: series for name, series in others.items() if name[:2] != header[:2]}
    with pytest.raises(DatasetError, match="ignore="):
        read(tmp_path, columns, units={"stress": "kPa"})


def test_a_column_left_out_does_not_matter_and_a_lateral_stress_may_be_sr(tmp_path: Path) -> None:
    test = read(tmp_path, DRAINED | {"Sr [%]": SAME}, units={"stress": "kPa"}, ignore=("Sr [%]",))
    assert test.initial_mean_stress == pytest.approx(500e3)
    columns = {"eps1 [%]": AXIAL, "epsv [%]": VOLUME, "q [kPa]": Q, "sr [kPa]": CELL}
    assert read(tmp_path, columns).initial_mean_stress == pytest.approx(500e3)


@pytest.mark.parametrize(
    "header", ["t [kPa]", "Test [kPa]", "Reading (MPa)", "Stage, psi", "n [%]", "Point [kPa abs]"]
)
def test_a_column_with_a_unit_of_stress_or_strain_is_no_bookkeeping(
    header: str, tmp_path: Path
) -> None:
    columns = {f'"{header}"': Q} | DRAINED
    with pytest.raises(DatasetError, match="not known"):
        read(tmp_path, columns)


@pytest.mark.parametrize("header", ["t [min]", "Cycle [-]", "Humidity [%]", "Reading (1)", "No"])
def test_bookkeeping_is_still_passed_over(header: str, tmp_path: Path) -> None:
    assert read(tmp_path, {header: AXIAL} | DRAINED).interpretation.not_used == (header,)


@pytest.mark.parametrize(
    "axial", [400.0 + Q, 200.0 + Q, 400.0 - GROWN * 30.0], ids=["total", "effective", "extension"]
)
@pytest.mark.parametrize("name", ["Axial stress [kPa]", "sigma_v [kPa]", "p [kPa]"])
def test_a_stress_that_may_be_total_or_effective_is_ambiguous(
    axial: np.ndarray, name: str, tmp_path: Path
) -> None:
    columns = {
        "eps1 [%]": AXIAL,
        name: axial,
        "Cell pressure [kPa]": CELL - 100.0,
        "Pore pressure [kPa]": 200.0 + EXCESS,
    }
    with pytest.raises(DatasetError, match="stresses"):
        read(tmp_path, columns)
    read(tmp_path, columns, stresses="effective")


@pytest.mark.parametrize("name", ["sigma_v [kPa]", "Axial stress [kPa]", "Vertical stress [kPa]"])
@pytest.mark.parametrize("other", ["eps1 [%]", "Void ratio [-]"])
def test_an_axial_stress_alone_suggests_an_oedometer_test(
    name: str, other: str, tmp_path: Path
) -> None:
    deformed = AXIAL if other == "eps1 [%]" else 0.8 - 0.01 * AXIAL
    with pytest.raises(DatasetError) as problem:
        read(tmp_path, {other: deformed, name: 50.0 + 100.0 * AXIAL})
    text = str(problem.value)
    assert text.find("kind='oedometer'") > 0
    assert "lateral_stress" not in text[: text.find("kind='oedometer'")]


def test_without_a_volume_both_kinds_of_drainage_are_named(tmp_path: Path) -> None:
    columns = {"eps1 [%]": AXIAL, "s1' [kPa]": 200.0 - EXCESS + Q, "s3' [kPa]": 200.0 - EXCESS}
    with pytest.raises(DatasetError, match=r"triaxial-drained.*triaxial-undrained"):
        read(tmp_path, columns)


@pytest.mark.parametrize(
    "line",
    [
        "Cell pressure: 500 kPa",
        "# Back pressure (kPa) = 300",
        "u0 [kPa],300",
        "u_0 = 300 kPa",
        "Stresses are total, u0 = 300 kPa",
        "Stress type: total",
        "Gesamtspannungen",
        "Gegendruck 300 kPa",
        "Saettigungsdruck: 300 kPa",
        "Sättigungsdruck;300;kPa",
        "Zelldruck 500 kPa",
        "contre-pression : 300 kPa",
        "Contrapresión = 300 kPa",
        "Initial pore water pressure = 300 kPa",
        "BACKPRESSURE 300",
        "B.P. 300 kPa",
        "Sätt.druck 300",
        "Contrapressão 300 kPa",
    ],
)
def test_pressures_above_the_table_raise_a_question(line: str, tmp_path: Path) -> None:
    for above in ((line,), ("Specimen 4", line, "", "Sand")):
        with pytest.raises(DatasetError, match=r"stresses") as problem:
            read(tmp_path, DRAINED, above)
        assert line.split()[0].strip("#,;") in str(problem.value)
        effective = read(tmp_path, DRAINED, above, stresses="effective")
        assert effective.initial_mean_stress == pytest.approx(500e3)
        total = read(tmp_path, DRAINED, above, stresses="total", back_pressure=3e5)
        assert total.initial_mean_stress == pytest.approx(200e3)


def test_pressures_above_the_table_do_not_matter_where_its_headers_settle_them(
    tmp_path: Path,
) -> None:
    above = ("Cell pressure: 500 kPa", "Back pressure: 300 kPa")
    strains = {"eps1 [%]": AXIAL, "epsv [%]": VOLUME, "q [kPa]": Q}
    for stresses in (
        {"sigma3' [kPa]": CELL - 300.0},
        {"Cell pressure [kPa]": CELL, "Back pressure [kPa]": SAME + 300.0},
    ):
        test = read(tmp_path, strains | stresses, above)
        assert test.initial_mean_stress == pytest.approx(200e3)


@pytest.mark.parametrize(
    "line",
    [
        "Test type: CU",
        "# CIU test 7",
        "Test,CIUC-3",
        "Undrained triaxial compression",
        "Versuch: undrainiert",
        "Essai non drainé",
        "Ensayo no drenado",
        "Drainage: closed",
        "Versuch undräniert",
        "Ensaio não drenado",
    ],
)
def test_an_undrained_test_is_not_read_as_another(line: str, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="kind='triaxial-undrained'"):
        read(tmp_path, DRAINED, (line,))
    assert read(tmp_path, DRAINED, (line,), kind="triaxial-drained").kind == "triaxial-drained"
    effective = {"eps1 [%]": AXIAL, "q [kPa]": Q, "p' [kPa]": 200.0 - EXCESS + Q / 3.0}
    undrained = read(tmp_path, effective, (line,), kind="triaxial-undrained")
    assert undrained.initial_mean_stress == pytest.approx(200e3)


@pytest.mark.parametrize(
    "line",
    ["Tension positive", "# sign: tension is positive", "Zug positiv", "Compression negative",
     "Traction positive", "Stresses (positive in tension)"],
)  # fmt: skip
def test_a_file_with_tension_positive_needs_the_setting(line: str, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="tension_positive=True"):
        read(tmp_path, DRAINED, (line,))
    turned = DRAINED | {name: -DRAINED[name] for name in ("eps1 [%]", "epsv [%]", "sigma3 [kPa]")}
    test = read(tmp_path, turned, (line,), tension_positive=True)
    np.testing.assert_allclose(test.strain, read(tmp_path, DRAINED).strain)


@pytest.mark.parametrize(
    "line",
    ["Strains: logarithmic", "# natural strain", "Hencky", "Logarithmic", "True strains",
     "Dehnungen logarithmisch", "Déformation logarithmique"],
)  # fmt: skip
def test_a_file_with_logarithmic_strain_needs_the_setting(line: str, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="strain_measure='logarithmic'"):
        read(tmp_path, DRAINED, (line,))
    test = read(tmp_path, DRAINED, (line,), strain_measure="logarithmic")
    np.testing.assert_allclose(test.axial_strain, AXIAL / 100.0)


@pytest.mark.parametrize(
    "line",
    [
        "Consolidated drained test CD-2",
        "Compression positive, tension negative",
        "Total number of rows: 17",
        "CU = 2.1 (coefficient of uniformity)",
        "Total compression: 12 mm",
        "Engineering strains",
        "Sand, natural water content 4 %",
        "Confining pressure 500 kPa",
    ],
)
def test_other_lines_above_the_table_are_passed_over(line: str, tmp_path: Path) -> None:
    assert read(tmp_path, DRAINED, (line,)).initial_mean_stress == pytest.approx(500e3)


def test_a_line_between_the_names_and_the_rows_counts_as_well(tmp_path: Path) -> None:
    (tmp_path / "test.dat").write_text(
        "eps1 epsv q sigma3\n% % kPa kPa\n# back pressure 300 kPa\n"
        + "\n".join(f"{e} {v} {q} 500" for e, v, q in zip(AXIAL, VOLUME, Q, strict=True))
    )
    with pytest.raises(DatasetError, match="line 3.*stresses"):
        read_tests(tmp_path / "test.dat")


def test_lines_above_the_table_of_a_sheet_count_as_well(tmp_path: Path) -> None:
    rows = [SheetRow(3, ("Back pressure", 300.0)), SheetRow(5, tuple(DRAINED))]
    rows += [
        SheetRow(number, tuple(float(value) for value in row))
        for number, row in enumerate(zip(*DRAINED.values(), strict=True), start=6)
    ]
    headings = find_headings(rows, ("cells",), lambda name: known_quantity(name) is not None)
    assert headings is not None
    table = table_of("test.xlsx", rows, headings, DatasetError)
    assert table.preamble == ((3, "Back pressure 300.0"),)
    with pytest.raises(DatasetError, match=r"row 3.*stresses"):
        laboratory_test_from(table, ImportSettings(), "test")
