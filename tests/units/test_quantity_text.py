"""Pressures and strains as users write them: known units, and questions about wrong ones."""

import pytest

from granbench.errors import ConfigurationError
from granbench.fem.problems import chosen_from_text
from granbench.units.quantity_text import pressure_from_text, strain_from_text


@pytest.mark.parametrize(
    ("text", "pascals"),
    [
        ("1e5", 1e5),
        ("100kPa", 1e5),
        (" 100 kPa ", 1e5),
        ("0.1MPa", 1e5),
        ("1 bar", 1e5),
        ("100kN/m2", 1e5),
        ("100Pa", 100.0),
        ("5kPa", 5e3),
        ("0", 0.0),
        ("10000", 1e4),
        ("-1e5", -1e5),
    ],
)
def test_a_pressure_has_the_unit_that_is_written(text: str, pascals: float) -> None:
    assert pressure_from_text("--p0 ", text) == pytest.approx(pascals, rel=1e-12)


@pytest.mark.parametrize("text", ["100", "50", "0.1", "200.0", "4e3", "9999"])
def test_a_bare_number_that_may_be_kilopascals_is_refused(text: str) -> None:
    with pytest.raises(ConfigurationError, match=r"kPa, or .*write --p0 .*kPa or --p0 .*Pa"):
        pressure_from_text("--p0 ", text)


@pytest.mark.parametrize("text", ["1e12", "2GPa", "nan", "inf", "-inf", "1e999", "", "kPa", "1,000",
                                  "100 m", "20%", "1e5 kPa kPa"])  # fmt: skip
def test_what_is_no_pressure_is_refused_by_the_option(text: str) -> None:
    with pytest.raises(ConfigurationError, match="^--p0 "):
        pressure_from_text("--p0 ", text)


@pytest.mark.parametrize(
    ("text", "strain"), [("0.2", 0.2), ("20%", 0.2), ("-5 %", -0.05), ("0", 0)]
)
def test_a_strain_is_a_ratio_or_a_number_with_its_unit(text: str, strain: float) -> None:
    assert strain_from_text("--strain ", text) == pytest.approx(strain, rel=1e-12)


@pytest.mark.parametrize("text", ["30", "1", "-15", "1e300", "200%", "nan", "5kPa", "a"])
def test_a_bare_number_that_may_be_per_cent_is_refused(text: str) -> None:
    with pytest.raises(ConfigurationError, match="^--strain "):
        strain_from_text("--strain ", text)


@pytest.mark.parametrize(
    ("choice", "named"),
    [
        ("confinement=100", "confinement=100kPa"),
        ("confinement=50", "confinement=50kPa"),
        ("confinement=1e300", "1 GPa"),
        ("confinement=nan", "finite"),
        ("confinement=random:1e300:1", "v_c"),
        ("confinement=random:nan", "v_c"),
        ("confinement=random:3:-1", "seed"),
        ("confinement=random:3:²", "seed"),
        ("confinement=random:3:99999999999999999999", "seed"),
        ("end_strain=10", "20 %"),
        ("end_strain=0", "end_strain"),
        ("speed=1e300", "speed"),
        ("speed=nan", "speed"),
    ],
)
def test_ambiguous_choices_of_a_problem_are_refused(choice: str, named: str) -> None:
    with pytest.raises(ConfigurationError, match=named):
        chosen_from_text("biaxial", [choice])


def test_choices_of_a_problem_take_units() -> None:
    problem = chosen_from_text("biaxial", ["confinement=100kPa", "end_strain=5%"])
    assert (problem.initial_pressure, problem.end_strain) == (1e5, 0.05)
