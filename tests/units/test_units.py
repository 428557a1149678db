"""Units: every spelling of one unit is one number, and what is unknown stays unknown."""

import pytest

from granbench.units.known_units import (
    is_stress_unit,
    length_factor,
    split_header,
    split_unknown_unit,
    time_factor,
    unit_factor,
)

STANDARD_GRAVITY = 9.80665


@pytest.mark.parametrize(
    ("pascals", "spellings"),
    [
        (1e3, ["kPa", "KPA", "kPa.", "kN/m2", "kN/m²", "kN/m^2", "kN / m2", "kN/m**2", "kN m-2",
               "kN·m⁻²", "kN/sq m", "kN per m2", "kN/mý", "kN/mÂ²"]),
        (1e6, ["MPa", "N/mm2", "MN/m²"]),
        (1e4 * STANDARD_GRAVITY, ["kg/cm2", "kgf/cm²", "kgf/cm^2", "kg/cm²", "kp/cm2"]),
        (1e3 * STANDARD_GRAVITY, ["t/m2", "t/m²", "tf/m2", "tonnes/m2"]),
        (6894.757293168, ["psi", "PSI", "lb/in2", "lbs/sq. in.", "lbf/in²"]),
        (6894757.293168, ["ksi", "kip/in2"]),
        (47880.25898, ["ksf", "kips/ft2"]),
        (95760.51796, ["tsf", "tons/ft2", "tons/sq ft"]),
        (1e5, ["bar", "Bar"]),
        (1e2, ["mbar", "hPa"]),
        (101325.0, ["atm"]),
    ],
)  # fmt: skip
def test_a_stress_has_one_value_however_its_unit_is_spelt(pascals, spellings) -> None:
    for spelling in spellings:
        assert is_stress_unit(spelling), spelling
        assert unit_factor(spelling) == pytest.approx(pascals, rel=1e-9), spelling


@pytest.mark.parametrize(
    ("ratio", "spellings"),
    [
        (1.0, ["-", "–", "1", "mm/mm", "m/m", "in./in."]),
        (1e-2, ["%", "percent", "per cent", "pct"]),
        (1e-3, ["‰", "per mille", "mm/m"]),
        (1e-6, ["µε", "με", "microstrain", "µm/m"]),
    ],
)
def test_a_strain_has_one_value_however_its_unit_is_spelt(ratio, spellings) -> None:
    for spelling in spellings:
        assert not is_stress_unit(spelling)
        assert unit_factor(spelling) == pytest.approx(ratio, rel=1e-12), spelling


@pytest.mark.parametrize("unit", ["mm", "kN", "psig", "lbs", "furlong", "s", "kPa/min", ""])
def test_what_is_neither_a_stress_nor_a_ratio_has_no_factor(unit) -> None:
    assert unit_factor(unit) is None


def test_lengths_and_times_are_apart() -> None:
    assert length_factor("mm") == 1e-3 and length_factor("in") == 0.0254
    assert time_factor("min") == 60.0 and time_factor("mm") is None and length_factor("s") is None


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("q [kPa]", "q", "kPa"),
        ("Deviator Stress\n(kgf/cm²)", "Deviator Stress", "kgf/cm²"),
        ("q/kPa", "q", "kPa"),
        ("q / (kN/m²)", "q", "kN/m²"),
        ("Axial strain, %", "Axial strain", "%"),
        ("sigma1_kPa", "sigma1", "kPa"),
        ("q in kPa", "q", "kPa"),
        ("q (s1-s3) [psi]", "q (s1-s3)", "psi"),
        ("displacement [mm]", "displacement", "mm"),
        ("eta = q/p", "eta = q/p", None),
        ("V/V0", "V/V0", None),
        ("p_bar", "p_bar", None),
        ("Void ratio", "Void ratio", None),
    ],
)
def test_a_header_is_a_name_and_a_unit(header, name, unit) -> None:
    assert split_header(header) == (name, unit)


def test_an_unknown_unit_is_named_apart_from_the_column() -> None:
    assert split_unknown_unit("q [pounds per acre]") == ("q", "pounds per acre")
