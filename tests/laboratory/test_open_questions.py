"""What a laboratory file leaves open, or says above its table, is asked about and never guessed."""

from pathlib import Path

import numpy as np
import pytest

from granbench.errors import DatasetError
from granbench.laboratory import ImportSettings, LaboratoryTest, read_tests

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
    with pytest.raises(DatasetError, match="--back-pressure"):
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
    with pytest.raises(DatasetError, match="--ignore"):
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
def test_an_unmarked_stress_beside_a_changing_pore_pressure_is_asked_about(
    axial: np.ndarray, name: str, tmp_path: Path
) -> None:
    columns = {
        "eps1 [%]": AXIAL,
        name: axial,
        "Cell pressure [kPa]": CELL - 100.0,
        "Pore pressure [kPa]": 200.0 + EXCESS,
    }
    with pytest.raises(DatasetError, match="--stresses"):
        read(tmp_path, columns)
    read(tmp_path, columns, stresses="effective")


@pytest.mark.parametrize("name", ["sigma_v [kPa]", "Axial stress [kPa]", "Vertical stress [kPa]"])
@pytest.mark.parametrize("other", ["eps1 [%]", "Void ratio [-]"])
def test_an_axial_stress_alone_is_first_thought_to_be_of_an_oedometer(
    name: str, other: str, tmp_path: Path
) -> None:
    deformed = AXIAL if other == "eps1 [%]" else 0.8 - 0.01 * AXIAL
    with pytest.raises(DatasetError) as problem:
        read(tmp_path, {other: deformed, name: 50.0 + 100.0 * AXIAL})
    text = str(problem.value)
    assert text.find("--kind oedometer") > 0
    assert "--lateral-stress" not in text[: text.find("--kind oedometer")]


def test_without_a_volume_both_kinds_of_drainage_are_named(tmp_path: Path) -> None:
    columns = {"eps1 [%]": AXIAL, "s1' [kPa]": 200.0 - EXCESS + Q, "s3' [kPa]": 200.0 - EXCESS}
    with pytest.raises(DatasetError, match=r"triaxial-drained.*triaxial-undrained"):
        read(tmp_path, columns)
