"""Total and effective stresses: recognised in a file, or asked for."""

from pathlib import Path

import numpy as np
import pytest

from granbench.errors import ConfigurationError, DatasetError
from granbench.laboratory import ImportSettings, LaboratoryTest, read_tests

AXIAL = np.linspace(0.0, 8.0, 17)
GROWN = AXIAL / (1.0 + AXIAL)
Q = 180.0 * GROWN
EXCESS = 120.0 * GROWN
CELL = np.full(17, 500.0)
PORE = 300.0 + EXCESS
LATERAL = CELL - PORE
"""Effective: an undrained test from 200 kPa, kPa; strains in %."""

VOLUME = 1.5 * GROWN


def read(tmp_path: Path, columns: dict[str, np.ndarray], **said: object) -> LaboratoryTest:
    """The test of a file with these columns, separated by semicolons."""
    lines = [";".join(columns)]
    lines += [";".join(f"{v:.8g}" for v in row) for row in zip(*columns.values(), strict=True)]
    (tmp_path / "test.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (test,) = read_tests(tmp_path / "test.csv", ImportSettings(**said))
    return test


def check_undrained(test: LaboratoryTest) -> None:
    """It is the undrained test of the constants above, in effective stresses."""
    assert test.kind == "triaxial-undrained"
    assert test.initial_mean_stress == pytest.approx(200e3)
    np.testing.assert_allclose(test.stress[:, 2], 1e3 * LATERAL, rtol=1e-6)
    np.testing.assert_allclose(test.stress[:, 0], 1e3 * (LATERAL + Q), rtol=1e-6)
    np.testing.assert_allclose(test.volumetric_strain, 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"Cell pressure (kPa)": CELL, "Pore pressure (kPa)": PORE, "q [kPa]": Q}, {}),
        (
            {"Zelldruck [kPa]": CELL, "Porenwasserdruck [kPa]": PORE, "Deviatorspannung [kPa]": Q},
            {},
        ),
        (
            {
                "Pression cellulaire (kPa)": CELL,
                "Pression interstitielle u (kPa)": PORE,
                "Déviateur (kPa)": Q,
            },
            {},
        ),
        (
            {
                "cell [kPa]": CELL,
                "back pressure [kPa]": 300.0 + 0.0 * Q,
                "excess pore pressure [kPa]": EXCESS,
                "q [kPa]": Q,
            },
            {},
        ),
        ({"cell [kPa]": CELL, "Δu [kPa]": EXCESS, "q [kPa]": Q}, {"back_pressure": 3e5}),
        ({"cell [kPa]": CELL, "du [kPa]": EXCESS, "q [kPa]": Q, "p' [kPa]": LATERAL + Q / 3}, {}),
        ({"u [kPa]": PORE, "q [kPa]": Q}, {"cell_pressure": 5e5}),
        ({"sigma1 [kPa]": CELL + Q, "sigma3 [kPa]": CELL, "u [kPa]": PORE}, {}),
        ({"sigma1 [kPa]": LATERAL + Q, "sigma3 [kPa]": LATERAL, "u [kPa]": PORE}, {}),
        ({"p [kPa]": CELL + Q / 3, "q [kPa]": Q, "u [kPa]": PORE}, {}),
        (
            {"sigma1 [kPa]": 200.0 + Q, "sigma3 [kPa]": 200.0 + 0.0 * Q, "u [kPa]": EXCESS},
            {"back_pressure": 0.0},
        ),
        (
            {
                "Effective Major Principal Stress, σ1' (kPa)": LATERAL + Q,
                "Effective Minor Principal Stress, σ3' (kPa)": LATERAL,
                "Deviator Stress, (σ1-σ3) (kPa)": Q,
                "Excess PWP, Δu (kPa)": EXCESS,
            },
            {},
        ),
        (
            {"σ'1 [kPa]": LATERAL + Q, "σ'3 [kPa]": LATERAL},
            {"kind": "triaxial-undrained"},
        ),
        (
            {
                "effektive Axialspannung [kPa]": LATERAL + Q,
                "effektive Radialspannung [kPa]": LATERAL,
                "Zeit [min]": AXIAL,
            },
            {"kind": "triaxial-undrained"},
        ),
        (
            {
                "total axial stress [kPa]": CELL + Q,
                "total radial stress [kPa]": CELL,
                "effective axial stress [kPa]": LATERAL + Q,
                "effective radial stress [kPa]": LATERAL,
                "pwp [kPa]": PORE,
            },
            {},
        ),
    ],
)
def test_undrained_tests_are_read_in_effective_stresses(
    columns: dict[str, np.ndarray], said: dict, tmp_path: Path
) -> None:
    check_undrained(read(tmp_path, {"eps1 [%]": AXIAL} | columns, **said))


@pytest.mark.parametrize(
    ("columns", "said", "pressure"),
    [
        ({"cell [kPa]": CELL, "backpressure [kPa]": 300.0 + 0 * Q, "q [kPa]": Q}, {}, 200e3),
        ({"cell [kPa]": CELL, "q [kPa]": Q}, {"stresses": "effective"}, 500e3),
        ({"cell [kPa]": CELL, "q [kPa]": Q}, {"back_pressure": 3e5}, 200e3),
        (
            {"s1 [kPa]": CELL + Q, "s3 [kPa]": CELL, "bp [kPa]": 300.0 + 0 * Q},
            {"stresses": "total"},
            200e3,
        ),
        ({"sigma1 [kPa]": 200.0 + Q, "sigma3 [kPa]": 200.0 + 0 * Q}, {}, 200e3),
    ],
)
def test_drained_tests_are_read_less_their_back_pressure(
    columns: dict[str, np.ndarray], said: dict, pressure: float, tmp_path: Path
) -> None:
    test = read(tmp_path, {"eps1 [%]": AXIAL, "epsv [%]": VOLUME} | columns, **said)
    assert test.kind == "triaxial-drained"
    np.testing.assert_allclose(test.stress[:, 2], pressure, rtol=1e-6)
    np.testing.assert_allclose(test.stress[:, 0] - test.stress[:, 2], 1e3 * Q, atol=0.1)


@pytest.mark.parametrize(
    ("columns", "said", "named"),
    [
        # The pore pressure is not known.
        ({"cell [kPa]": CELL, "q [kPa]": Q, "epsv [%]": VOLUME}, {}, ["'cell [kPa]'", "effective"]),
        (
            {"cell [kPa]": CELL, "du [kPa]": EXCESS, "q [kPa]": Q},
            {},
            ["'du [kPa]'", "back_pressure"],
        ),
        (
            {"s1 [kPa]": CELL + Q, "s3 [kPa]": CELL, "bp [kPa]": 300.0 + 0 * Q, "epsv [%]": VOLUME},
            {},
            ["'s3 [kPa]'", "stresses"],
        ),
        (
            {"s1 [kPa]": 200.0 + Q, "s3 [kPa]": 200.0 + 0 * Q, "u [kPa]": EXCESS},
            {},
            ["'u [kPa]'", "back_pressure"],
        ),
        ({"u [kPa]": PORE, "q [kPa]": Q}, {}, ["lateral stress", "cell_pressure"]),
        # Total stresses of an undrained test, without its pore pressure.
        (
            {"s1 [kPa]": CELL + Q, "s3 [kPa]": CELL},
            {"kind": "triaxial-undrained"},
            ["'s3 [kPa]'", "total or effective"],
        ),
        (
            {"s1 [kPa]": CELL + Q, "s3 [kPa]": CELL, "epsv [%]": 0 * Q},
            {},
            ["'epsv [%]'", "total"],
        ),
        # Columns and options that contradict each other.
        (
            {"cell [kPa]": CELL, "u [kPa]": PORE, "q [kPa]": Q, "p' [kPa]": LATERAL + Q / 2},
            {},
            ["p' [kPa]", "'u [kPa]'"],
        ),
        (
            {"p [kPa]": 200.0 + Q / 3, "q [kPa]": Q, "epsv [%]": VOLUME},
            {"lateral_stress": 1e5},
            ["lateral_stress", "'p [kPa]'"],
        ),
        (
            {"u [kPa]": PORE, "q [kPa]": Q},
            {"lateral_stress": 2e5},
            ["lateral_stress", "cell_pressure"],
        ),
        (
            {"cell [kPa]": CELL, "u [kPa]": PORE, "q [kPa]": Q},
            {"kind": "triaxial-drained"},
            ["'u [kPa]'", "triaxial-undrained"],
        ),
        (
            {"s1' [kPa]": LATERAL + Q, "s3' [kPa]": LATERAL, "epsv [%]": VOLUME},
            {"kind": "triaxial-undrained"},
            ["'epsv [%]'", "kind"],
        ),
        (
            {"cell [kPa]": CELL, "u [kPa]": PORE, "q [kPa]": Q},
            {"back_pressure": 1e5},
            ["'u [kPa]'", "back_pressure"],
        ),
        (
            {"p [kPa]": 200.0 + Q / 3, "q [kPa]": Q, "epsv [%]": VOLUME, "e": 0.8 - 0.018 * VOLUME},
            {"initial_void_ratio": 0.6},
            ["'e'", "initial_void_ratio"],
        ),
        (
            {
                "p [kPa]": 200.0 + Q / 3,
                "q [kPa]": Q,
                "epsv [%]": -VOLUME,
                "e": 0.8 - 0.018 * VOLUME,
            },
            {},
            ["'epsv [%]'", "'e'", "sign"],
        ),
        # Several stages, of which the volume of one alone is known.
        (
            {"cell [kPa]": CELL, "u [kPa]": PORE, "q [kPa]": Q, "Stage": (AXIAL > 4.0) * 1.0},
            {},
            ["'Stage'", "stages"],
        ),
        # What no header says.
        (
            {"p [kPa]": 200.0 + Q / 3, "q [kPa]": Q, "Axial load (kN)": Q},
            {},
            ["'Axial load (kN)'", "ignore=('Axial load (kN)',)", "columns="],
        ),
        ({"Total axial stress σ1' [kPa]": Q, "q [kPa]": Q}, {}, ["σ1'", "columns="]),
    ],
)
def test_missing_information_is_asked_for(
    columns: dict[str, np.ndarray], said: dict, named: list[str], tmp_path: Path
) -> None:
    with pytest.raises(DatasetError) as error:
        read(tmp_path, {"eps1 [%]": AXIAL} | columns, **said)
    assert all(part in str(error.value) for part in ("test.csv", *named)), str(error.value)


def test_ignored_and_bookkeeping_columns_are_named_as_not_used(tmp_path: Path) -> None:
    columns = {"eps1 [%]": AXIAL, "p [kPa]": 200.0 + Q / 3, "q [kPa]": Q, "Load [kN]": Q}
    test = read(tmp_path, columns | {"Time (s)": AXIAL, "Step No.": AXIAL}, ignore=("Load [kN]",))
    assert test.interpretation is not None
    assert set(test.interpretation.not_used) == {"Load [kN]", "Time (s)", "Step No."}
    assert "effective" in test.interpretation.stresses
    assert test.interpretation.strain_measure == "engineering"


def test_extension_is_read_with_its_signs(tmp_path: Path) -> None:
    columns = {"cell [kPa]": CELL, "u [kPa]": 300.0 - 0.5 * EXCESS, "q [kPa]": -0.5 * Q}
    test = read(tmp_path, {"eps1 [%]": -AXIAL} | columns)
    assert test.kind == "triaxial-undrained"
    assert test.stress[-1, 0] < test.stress[-1, 2]
    assert test.axial_strain[-1] < 0.0


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"eps1 [%]": -AXIAL, "epsv [%]": -VOLUME}, ["'eps1 [%]'", "tension_positive=True"]),
        ({"q [kPa]": -Q, "p [kPa]": 200.0 - Q / 3}, ["'eps1 [%]'", "sign"]),
        (
            {"eps1 [%]": AXIAL / 100.0, "epsv [%]": VOLUME / 100.0},
            ["'eps1 [%]'", "units={'strain': '-'}"],
        ),
        ({"q [kPa]": Q / 1e3, "p [kPa]": 0.2 + Q / 3e3}, ["units={'stress': 'MPa'}"]),
        ({"q [kPa]": 1e3 * Q, "p [kPa]": 1e3 * (200.0 + Q / 3)}, ["units={'stress': 'Pa'}"]),
    ],
    ids=["strain negative", "q negative", "ratio as per cent", "MPa as kPa", "Pa as kPa"],
)
def test_wrong_signs_and_units_are_refused(
    change: dict[str, np.ndarray], named: list[str], tmp_path: Path
) -> None:
    right = {"eps1 [%]": AXIAL, "epsv [%]": VOLUME, "q [kPa]": Q, "p [kPa]": 200.0 + Q / 3}
    assert read(tmp_path, right).kind == "triaxial-drained"
    with pytest.raises(DatasetError) as error:
        read(tmp_path, right | change)
    assert all(part in str(error.value) for part in named), str(error.value)


def test_the_kind_of_test_determines_the_strain_that_was_not_measured(tmp_path: Path) -> None:
    stresses = {"sigma1' [kPa]": 100.0 + Q, "sigma3' [kPa]": 100.0 + 0.5 * Q}
    test = read(tmp_path, {"eps1 [%]": AXIAL} | stresses, kind="oedometer")
    np.testing.assert_array_equal(test.strain[:, 1:], 0.0)
    test = read(tmp_path, {"epsv [%]": AXIAL, "p' [kPa]": 100.0 + Q}, kind="isotropic")
    np.testing.assert_allclose(test.strain[:, 0], -np.log1p(-AXIAL / 100.0) / 3.0)
    np.testing.assert_allclose(test.stress[:, 0], test.stress[:, 2])


@pytest.mark.parametrize("by", ["strain", "void ratio", "both"])
def test_oedometer_tests_need_no_lateral_stress(by: str, tmp_path: Path) -> None:
    stress = np.array([10.0, 25.0, 50.0, 100.0, 200.0, 400.0, 100.0, 25.0])
    strain = np.array([0.0, 0.9, 1.6, 2.5, 3.5, 4.7, 4.4, 4.0])
    columns = {"sigma1 [kPa]": stress}
    if by != "void ratio":
        columns["eps1 [%]"] = strain
    if by != "strain":
        columns["Void ratio [-]"] = 1.02 - 0.0202 * strain
    test = read(tmp_path, columns, kind=None if by == "both" else "oedometer", k0=0.4)
    assert test.kind == "oedometer"
    assert not test.lateral_stress_known
    np.testing.assert_allclose(test.axial_strain, -np.log1p(-strain / 100.0), atol=1e-9)
    np.testing.assert_allclose(test.stress[0], [10e3, 4e3, 4e3])
    assert test.interpretation is not None
    assert any("K0 = 0.4" in note for note in test.interpretation.notes)
    with pytest.raises(DatasetError, match="lateral_stress"):
        read(tmp_path, columns, kind="oedometer", lateral_stress=1e5)


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"stresses": "both"}, "stresses='both'"),
        ({"cell_pressure": -1.0}, "cell_pressure=-1.0"),
        ({"cell_pressure": 500.0}, "cell_pressure=500.0 .*500000"),
        ({"back_pressure": -1.0}, "back_pressure=-1.0"),
        ({"back_pressure": 300.0}, "back_pressure=300.0 .*Pa"),
        ({"k0": 0.0}, "k0=0.0"),
    ],
)
def test_pressures_that_make_no_sense_are_refused(settings: dict, named: str) -> None:
    with pytest.raises(ConfigurationError, match=named):
        ImportSettings(**settings)
