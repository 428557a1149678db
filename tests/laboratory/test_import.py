"""Laboratory files: what is read from each format is what was measured."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from laboratory_files import drained_curve, write_csv, write_karlsruhe, write_protocol

from granbench.errors import DatasetError
from granbench.laboratory import ImportSettings, LaboratoryTest, read_tests, to_records
from granbench.records import open_records, validate_records, write_records

ROUNDED = 1e-10
"""The files hold 12 digits of numbers up to some hundred."""


def check_drained(test: LaboratoryTest, lateral: float = 100.0) -> None:
    """The test is that of `drained_curve`, in SI units and logarithmic strain."""
    curve = drained_curve(lateral=lateral)
    assert test.kind == "triaxial-drained"
    np.testing.assert_allclose(
        test.axial_strain, -np.log(1.0 - curve["eps1"] / 100.0), atol=ROUNDED
    )
    np.testing.assert_allclose(
        test.volumetric_strain, -np.log(1.0 - curve["epsv"] / 100.0), atol=ROUNDED
    )
    np.testing.assert_array_equal(test.strain[:, 1], test.strain[:, 2])
    np.testing.assert_allclose(test.stress[:, 2], 1e3 * lateral, rtol=1e-8)
    np.testing.assert_allclose(test.deviatoric_stress, 1e3 * curve["q"], atol=1e-3)


@pytest.mark.parametrize(
    "headers",
    [
        ("eps1 [%]", "epsv [%]", "q [kPa]", "p [kPa]", "e"),
        ("Axial strain (%)", "Volumetric strain (%)", "q/kPa", "p' (kPa)", "Void ratio [-]"),
        ("eps_a [percent]", "eps_v [percent]", "q [kN/m2]", "p [kN/m²]", "e [1]"),
    ],
)
def test_headers_and_units_are_understood(headers: tuple[str, ...], tmp_path: Path) -> None:
    curve = drained_curve()
    (test,) = read_tests(write_csv(tmp_path / "cd.csv", headers, list(curve.values())))
    check_drained(test)
    assert test.void_ratio is not None
    np.testing.assert_allclose(test.void_ratio, curve["e"], atol=ROUNDED)
    assert test.name == "cd"


def test_a_column_map_and_units_from_the_user_name_what_the_header_does_not(tmp_path: Path) -> None:
    curve = drained_curve()
    headers = ("A", "B", "stress difference", "cell", "remark")
    columns = [curve["eps1"], curve["epsv"], curve["q"] / 1e3, np.full(40, 0.1), np.zeros(40)]
    (test,) = read_tests(
        write_csv(tmp_path / "cd.csv", headers, columns),
        ImportSettings(
            columns={
                "axial_strain": "A",
                "volumetric_strain": "b",
                "deviatoric_stress": "stress difference",
                "radial_stress": "cell",
            },
            units={"strain": "%", "stress": "MPa"},
        ),
    )
    check_drained(test)


def test_the_volume_follows_from_the_void_ratio_and_the_other_way_round(tmp_path: Path) -> None:
    curve = drained_curve()
    parts = {"eps1 [%]": "eps1", "q [kPa]": "q", "p [kPa]": "p"}
    columns = [curve[name] for name in parts.values()]
    (from_e,) = read_tests(write_csv(tmp_path / "e.csv", [*parts, "e"], [*columns, curve["e"]]))
    check_drained(from_e)
    (from_volume,) = read_tests(
        write_csv(tmp_path / "v.csv", [*parts, "epsv [%]"], [*columns, curve["epsv"]]),
        ImportSettings(initial_void_ratio=0.8),
    )
    assert from_volume.void_ratio is not None
    np.testing.assert_allclose(from_volume.void_ratio, curve["e"], atol=ROUNDED)


def test_decimal_commas_and_a_line_of_units_are_read(tmp_path: Path) -> None:
    curve = drained_curve()
    rows = [
        ";".join(f"{value:.12g}".replace(".", ",") for value in row)
        for row in zip(*(curve[name] for name in ("eps1", "epsv", "q", "p")), strict=True)
    ]
    lines = ["Versuch 7", "eps1;epsv;q;p", "%;%;kPa;kPa", *rows]
    (tmp_path / "cd.csv").write_text("\n".join(lines), encoding="latin-1")
    (test,) = read_tests(tmp_path / "cd.csv")
    check_drained(test)


def test_quoted_cells_and_unicode_text_of_spreadsheets_are_read(tmp_path: Path) -> None:
    curve = drained_curve()
    headers = ("eps1 [%]", "epsv [%]", "q [kPa]", "p [kPa]")
    path = write_csv(tmp_path / "cd.csv", headers, [curve[n] for n in ("eps1", "epsv", "q", "p")])
    plain = path.read_text()
    quoted = "\n".join('"' + line.replace(",", '","') + '"' for line in plain.splitlines())
    for content in (quoted.encode(), plain.encode("utf-16"), plain.replace("\n", "\r\n").encode()):
        path.write_bytes(content)
        (test,) = read_tests(path)
        check_drained(test)


def test_tension_positive_files_are_turned_round(tmp_path: Path) -> None:
    curve = drained_curve()
    columns = [-curve["eps1"], -curve["epsv"], curve["q"], -curve["p"]]
    headers = ("eps1 [%]", "epsv [%]", "q [kPa]", "p [kPa]")
    path = write_csv(tmp_path / "cd.csv", headers, columns)
    # Lengths grow by their strain in this convention, so the measure is taken after the turn.
    (test,) = read_tests(path, ImportSettings(tension_positive=True))
    check_drained(test)


def test_logarithmic_strain_is_kept(tmp_path: Path) -> None:
    curve = drained_curve()
    headers = ("eps1 [%]", "epsv [%]", "q [kPa]", "p [kPa]")
    path = write_csv(tmp_path / "cd.csv", headers, [curve[n] for n in ("eps1", "epsv", "q", "p")])
    (test,) = read_tests(path, ImportSettings(strain_measure="logarithmic"))
    np.testing.assert_allclose(test.axial_strain, curve["eps1"] / 100.0, atol=ROUNDED)


def test_karlsruhe_files_are_read(tmp_path: Path) -> None:
    curve = drained_curve()
    (test,) = read_tests(write_karlsruhe(tmp_path / "TMD1.dat", curve))
    check_drained(test)
    # Their header says that the void ratio is in %, and it is not.
    assert test.initial_void_ratio == pytest.approx(0.8)


def test_soilmodels_protocols_are_read(tmp_path: Path) -> None:
    (test,) = read_tests(write_protocol(tmp_path / "protocol.xlsx", drained_curve()))
    check_drained(test)
    assert test.name == "CID-REC-1"
    assert test.void_ratio is not None
    np.testing.assert_allclose(test.void_ratio, drained_curve()["e"], atol=ROUNDED)


def test_void_ratio_of_a_protocol_is_not_overridden(tmp_path: Path) -> None:
    path = write_protocol(tmp_path / "protocol.xlsx", drained_curve())
    stated = drained_curve()["e"][0]
    (test,) = read_tests(path, ImportSettings(initial_void_ratio=stated))
    assert test.initial_void_ratio == pytest.approx(stated)
    with pytest.raises(DatasetError, match=r"cell B1.*initial_void_ratio is"):
        read_tests(path, ImportSettings(initial_void_ratio=stated + 0.1))


def test_soilmodels_paths_are_read_with_their_odd_signs(tmp_path: Path) -> None:
    curve = drained_curve()
    dilation, axial = -curve["epsv"] / 100.0, curve["eps1"] / 100.0
    q = curve["q"] + 1.0  # q is positive from the first row on, as in the published file
    np.savez(
        tmp_path / "data_CID.npz",
        a0=np.stack([dilation, axial - dilation / 3.0], axis=-1)[:, None],
        a1=np.stack([300.0 + q, q], axis=-1)[:, None],
        a2=2650.0 / 1.8 * (1.0 + dilation)[:, None, None],
    )
    (test,) = read_tests(tmp_path / "data_CID.npz")
    assert test.kind == "triaxial-drained"
    np.testing.assert_allclose(test.stress[:, 2], 1e5, rtol=1e-9)
    np.testing.assert_allclose(test.axial_strain, -np.log1p(-axial), atol=1e-14)
    np.testing.assert_allclose(test.volumetric_strain, -np.log1p(dilation), atol=1e-14)
    np.testing.assert_allclose(test.void_ratio, curve["e"], rtol=1e-12)


def test_grainlearning_runs_and_table_are_read(tmp_path: Path) -> None:
    axial = np.linspace(0.0, 0.02, 11)
    void_ratio = 1.6 * np.exp(-axial) - 1.0
    keys = np.array(["e_x", "e_y", "e_z", "n", "p", "q"])
    p, q = 5.0 + 100.0 * axial, 2.0 + 50.0 * axial
    series = [0.0 * axial, 0.0 * axial, axial, void_ratio / (1.0 + void_ratio), p, q]
    np.savez(tmp_path / "oedo.npz", data=np.stack(series)[None], keys=keys, params=np.zeros((1, 4)))
    (run,) = read_tests(tmp_path / "oedo.npz")
    assert run.kind == "oedometer"
    np.testing.assert_array_equal(run.axial_strain, axial)
    np.testing.assert_allclose(run.mean_stress, 1e6 * p, rtol=1e-12)
    np.testing.assert_allclose(run.void_ratio, void_ratio, rtol=1e-12)

    # Half of the volume change of an oedometer.
    rows = zip(axial, 1.6 * np.exp(-0.5 * axial) - 1.0, p, q, strict=True)
    text = "# epsilon_axial \t e \t p \t q\n" + "\n".join(
        "\t".join(map(repr, map(float, r))) for r in rows
    )
    (tmp_path / "drained.dat").write_text(text)
    (table,) = read_tests(tmp_path / "drained.dat")
    assert table.kind == "triaxial-drained"
    np.testing.assert_allclose(table.deviatoric_stress, 1e6 * q, rtol=1e-9)


def test_masi_paths_are_read_in_the_units_that_are_given(tmp_path: Path) -> None:
    units = ImportSettings(units={"strain": "%", "stress": "kPa"})
    volume, shear = np.linspace(1.0, 0.5, 12), np.linspace(0.0, 3.0, 12)
    p, q = np.full(12, 50.0), np.linspace(0.0, 40.0, 12)
    strain, stress = np.stack([volume, shear], -1), np.stack([p, q], -1)
    # Two paths of 11 steps, of which the second ends after 7.
    pair = [np.stack([part, part], axis=1) for part in (strain, stress)]
    named = {"strain_k": pair[0][:-1], "strain_k1": pair[0][1:], "stress_k": pair[1][:-1]}
    np.savez(tmp_path / "dp.npz", **named, stress_k1=pair[1][1:], stop=np.array([11, 7]))
    whole, short = read_tests(tmp_path / "dp.npz", units)
    assert (whole.steps, short.steps) == (12, 8)
    np.testing.assert_allclose(whole.volumetric_strain, (volume - 1.0) / 100.0, atol=1e-15)
    deviatoric = 2.0 / 3.0 * (whole.strain[:, 0] - whole.strain[:, 2])
    np.testing.assert_allclose(deviatoric, shear / 100.0, atol=1e-15)
    np.testing.assert_allclose(whole.mean_stress, 5e4, rtol=1e-12)
    np.testing.assert_allclose(short.deviatoric_stress, 1e3 * q[:8], atol=1e-9)

    bar = np.linspace(0.0, 0.5, 12)[:, None, None]
    arrays = {"strain_k": bar[:-1], "strain_k1": bar[1:], "stress_k": 200 * bar[:-1]}
    np.savez(tmp_path / "bar.npz", **arrays, stress_k1=200 * bar[1:])
    (test,) = read_tests(tmp_path / "bar.npz", units)
    assert test.kind == "uniaxial"
    assert not test.lateral_strain_known
    np.testing.assert_allclose(test.stress[:, 0], 2e5 * bar[:, 0, 0])

    np.savez(  # NICE, benchmark 1, inference: stress, strain, 8 others, time step, steps of a path
        tmp_path / "nice.npz",
        **{"a0": np.tile(stress, (2, 1)), "a1": np.tile(strain, (2, 1))},
        **{f"a{k}": np.zeros(3) for k in range(2, 10)},
        **{"a10": np.array(1.0), "a11": np.array(12)},
    )
    first, second = read_tests(tmp_path / "nice.npz", units)
    np.testing.assert_array_equal(first.strain, second.strain)
    np.testing.assert_allclose(second.deviatoric_stress, 1e3 * q, atol=1e-9)


def test_thinning_keeps_start_end_and_measured_points(tmp_path: Path) -> None:
    (test,) = read_tests(write_karlsruhe(tmp_path / "TMD1.dat", drained_curve(rows=400)))
    thin = test.thinned(50)
    assert 25 < thin.steps <= 50
    for row in (0, -1):
        np.testing.assert_array_equal(thin.stress[row], test.stress[row])
    measured = {tuple(row) for row in test.strain}
    assert all(tuple(row) in measured for row in thin.strain)
    # The steep first percent of strain has more points than its share of 1/20.
    assert np.mean(thin.axial_strain < 0.01) > 0.2


def test_records_of_tests_follow_the_schema(tmp_path: Path) -> None:
    (test,) = read_tests(write_karlsruhe(tmp_path / "TMD1.dat", drained_curve()))
    other = dataclasses.replace(test, name="other", stress=2.0 * test.stress)
    records = to_records([test, other], left_out=["other"], steps=81)
    validate_records(records)
    file = write_records(records, tmp_path / "tests.nc")
    with open_records(file) as read:
        assert read.sizes == {"path": 2, "step": 81, "component": 3}
        assert read["split"].values.tolist() == ["train", "test"]
        assert read["loading_family"].values.tolist() == ["constant-sigma3"] * 2
        np.testing.assert_allclose(read["initial_mean_stress"], [1e5, 2e5], rtol=1e-9)
        # Linear interpolation stays on the measured polygon: the peak cannot be passed.
        assert read["stress"].values[0].max() <= test.stress.max() * (1.0 + 1e-6)


def test_published_files_agree_with_their_publications(shared_data: Path) -> None:
    lateral = {"TMD2": 100e3, "TMD6": 50e3, "TMD11": 50e3, "TMD17": 100e3, "TMD23": 200e3}
    for name, pressure in lateral.items():
        (test,) = read_tests(shared_data / "karlsruhe_fine_sand" / f"{name}.dat")
        # The cell pressure wanders by up to 8 % at the start of the author's records.
        np.testing.assert_allclose(test.stress[:, 2], pressure, rtol=0.09)
        assert test.void_ratio is not None
        specific = (1.0 + test.void_ratio) / (1.0 + test.void_ratio[0])
        # Void ratio and volumetric strain tell the same, so strains are engineering ones.
        np.testing.assert_allclose(test.volumetric_strain, -np.log(specific), atol=1e-7)

    dobrany = shared_data / "dobrany_sand_soilmodels"
    oedometer, *protocol = read_tests(dobrany / "SoilModels-labProtocol-Sand.xlsx")
    assert oedometer.kind == "oedometer"
    assert oedometer.initial_void_ratio == pytest.approx(0.99609, rel=1e-4)
    assert [round(test.stress[-1, 2]) for test in protocol] == [50000, 100000, 200000]
    for measured, path in zip(protocol, read_tests(dobrany / "data_CID_raw.npz"), strict=True):
        assert path.initial_void_ratio == pytest.approx(measured.initial_void_ratio, rel=1e-5)
        # Interpolated between other points of the same curve; a wrong sign were off by 0.1.
        volume = np.interp(path.axial_strain, measured.axial_strain, measured.volumetric_strain)
        np.testing.assert_allclose(path.volumetric_strain, volume, atol=1e-3)

    simulated = read_tests(shared_data / "grainlearning_oedometer" / "oedo_sims_even.npz")
    assert len(simulated) == 200
    for run in simulated:
        assert run.void_ratio is not None
        specific = (1.0 + run.void_ratio) / (1.0 + run.void_ratio[0])
        np.testing.assert_allclose(run.volumetric_strain, -np.log(specific), atol=1e-6)

    units = ImportSettings(units={"strain": "%", "stress": "MPa"})
    paths = shared_data / "masi_plasticity_paths" / "Drucker_Prager" / "training_data.npz"
    tests = read_tests(paths, units)
    assert len(tests) == 18
    # K = 0.46667 in the files' unit: dp = K de_v in the elastic first step of the first path.
    first = tests[0]
    modulus = (first.mean_stress[1] - first.mean_stress[0]) / first.volumetric_strain[1]
    assert modulus == pytest.approx(0.466667e8, rel=1e-3)
