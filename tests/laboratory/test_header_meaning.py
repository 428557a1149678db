"""Definitions in headers, and text after the unit."""

from pathlib import Path

import pytest

from granbench.errors import DatasetError
from granbench.laboratory import ImportSettings, read_tests
from granbench.laboratory.headers import known_quantity
from granbench.units.known_units import unit_factor

ROWS = [(0.0, 0.0, 100.0, 0.0), (1.0, 0.3, 100.0, 80.0), (2.0, 0.4, 100.0, 120.0),
        (3.0, 0.3, 100.0, 140.0), (4.0, 0.2, 100.0, 150.0)]  # fmt: skip
PLAIN = ("eps1 [%]", "epsv [%]", "sigma3' [kPa]", "q [kPa]")


def write(folder: Path, place: int, header: str) -> Path:
    headers = [*PLAIN]
    headers[place] = header
    lines = [";".join(headers), *(";".join(map(str, row)) for row in ROWS)]
    path = folder / "test.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("place", "header"),
    [
        (3, "q=(s1-s3)/2 [kPa]"),
        (3, "q = (sigma1-sigma3)/2 [kPa]"),
        (3, "q=tau_max [kPa]"),
        (3, "s1+s3 [kPa]"),
        (3, "-q [kPa]"),
        (2, "sigma3' = cell pressure [kPa]"),
        (2, "sigma3=sigma3'+u [kPa]"),
        (0, "eps1=ln(H0/H) [%]"),
        (3, "q [kPa] x10"),
        (3, "q [kPa]/2"),
        (3, "q [kPa] (MIT)"),
        (3, "q [kPa] 10^-3"),
        (0, "eps1 [%] x 0.1"),
        (0, "eps1 (-) [%]"),
        (1, "epsv [%] (dilation positive)"),
        (1, "epsv [%] (-)"),
        (2, "s3' [kPa] - u [kPa]"),
        (2, "sigma3' [kPa] incl. u"),
    ],
)
def test_a_header_that_means_something_else_is_not_taken_for_the_quantity(
    place: int, header: str, tmp_path: Path
) -> None:
    path = write(tmp_path, place, header)
    with pytest.raises(DatasetError, match="columns=") as refused:
        read_tests(path, ImportSettings())
    assert header in str(refused.value)
    assert "ignore=" in str(refused.value)


@pytest.mark.parametrize(
    ("place", "header"),
    [
        (3, "q=s1-s3 [kPa]"),
        (3, "q = σ1' − σ3' [kPa]"),
        (3, "q [kPa] = sigma1-sigma3"),
        (3, "q [kPa] (corrected)"),
        (3, "q [kPa] (kN/m2)"),
        (2, "sigma3' = sigma3 - u [kPa]"),
        (2, "sigma3 [kPa] (effective)"),
        (0, "epax=dh/h0 [%]"),
        (0, "eps1 [%], compression positive"),
        (1, "epv=dV/V0 [%] (dilatancy is negative)"),
    ],
)
def test_usual_definitions_and_harmless_remarks_are_read(
    place: int, header: str, tmp_path: Path
) -> None:
    (test,) = read_tests(write(tmp_path, place, header), ImportSettings())
    assert test.deviatoric_stress[-1] == pytest.approx(150e3)
    assert test.stress[-1, 2] == pytest.approx(100e3)


@pytest.mark.parametrize(
    ("header", "quantity"),
    [
        ("p=(s1+2s3)/3", "mean_stress"),
        ("p' = (s1'+2*s3')/3", "effective_mean_stress"),
        ("p=(s1+s2+s3)/3 total", None),
        ("p=(s1+s3)/2", None),
        ("p=(s1'+2s3')/3", None),
        ("epsq=eps1-eps3", None),
        ("epsq=2/3(eps1-eps3)", "deviatoric_strain"),
        ("eta = q/p", "stress_ratio"),
        ("eta = s1/s3", None),
        ("s1-s3", "deviatoric_stress"),
        ("σ1 – σ3", "deviatoric_stress"),
        ("s1 s3", None),
        ("s1·s3", None),
        ("(-)eps1", None),
    ],
)
def test_definitions_of_invariants_are_compared(header: str, quantity: str | None) -> None:
    assert known_quantity(header) == quantity


@pytest.mark.parametrize("unit", ["ton/m2", "tons/m2", "tonne/m2", "tonnes/m2", "tonnes/m²"])
def test_tonnes_are_one_unit_however_they_are_spelt(unit: str) -> None:
    assert unit_factor(unit) == unit_factor("t/m2")
    assert unit_factor("ton/ft2") == unit_factor("tsf")
