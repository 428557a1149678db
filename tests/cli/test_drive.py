"""`granbench drive`: from a CSV file or a test's name to a file, or one sentence."""

import csv
import json
import sys

import numpy as np
import pytest
from driven_cells import elastic

from granbench.cli import main
from granbench.records import open_records, verify

PLANE = "eps_xx,eps_yy,eps_xy\n0,0,0\n0.004,0,0.001\n0.01,-0.004,0.002\n"
MINE = json.dumps(
    {"model": "j2", "parameters": {"bulk_modulus": 2e6, "shear_modulus": 1e6, "yield_stress": 5e4}}
)
MODEL = """
from driven_cells import Limited, elastic, learnt

def hooke():
    return elastic("full")

def learnt_cell():
    return learnt()

def limited():
    cell = Limited(largest_strain=0.05)
    cell.pressure_dependent = True
    return cell
"""


@pytest.fixture
def drive(capsys, monkeypatch, tmp_path):
    """Run `granbench drive` in a folder of its own; gives exit code, output and error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "my_cells", raising=False)
    (tmp_path / "my_cells.py").write_text(MODEL)

    def run(*words):
        capsys.readouterr()
        with pytest.raises(SystemExit) as left:
            main(["drive", *map(str, words)])
        captured = capsys.readouterr()
        return left.value.code, captured.out, captured.err

    return run


def refused(result, *parts):
    code, out, err = result
    assert (code, out) == (2, ""), err
    assert err.startswith("error: ") and err.count("\n") == 1, err
    for part in parts:
        assert part in err, err


def columns(file):
    with open(file, newline="") as lines:
        header, *rows = csv.reader(lines)
    return dict(zip(header, np.array(rows, dtype=float).T, strict=True))


def test_a_path_of_strains_gives_the_same_rows_with_stresses(drive, tmp_path):
    (tmp_path / "path.csv").write_text(PLANE)
    code, out, _ = drive("j2", "--path", "path.csv", "--out", "out.csv")
    assert code == 0 and out.startswith("out.csv: 3 rows of j2; at the end p = ")
    found = columns("out.csv")
    assert list(found) == ["eps_xx", "eps_yy", "eps_xy", "sig_xx", "sig_yy", "sig_xy"]
    np.testing.assert_array_equal(found["eps_xx"], [0.0, 0.004, 0.01])
    # Elastic: K = 1.25 MPa, G = 2/2.4 MPa in the plane.
    expected = 1e5 + 1.25e6 * 0.004 + 2.0 * 2e6 / 2.4 * 0.002
    assert found["sig_xx"][1] == pytest.approx(expected, rel=1e-12)


def test_a_first_row_that_is_not_zero_keeps_the_rows(drive, tmp_path):
    (tmp_path / "path.csv").write_text(PLANE.replace("0,0,0\n", ""))
    assert drive("j2", "--path", "path.csv", "--out", "out.csv", "--quiet")[:2] == (0, "")
    assert columns("out.csv")["eps_xx"].tolist() == [0.004, 0.01]


def test_stress_columns_are_met_and_their_strains_lead_back(drive, tmp_path):
    (tmp_path / "mixed.csv").write_text(
        "eps_11,sig_22,sig_33\n0,1e5,1e5\n0.01,1e5,1e5\n0.02,1.2e5,0.9e5\n"
    )
    assert drive("j2", "--path", "mixed.csv", "--out", "out.csv")[0] == 0
    found = columns("out.csv")
    np.testing.assert_allclose(found["sig_22"], [1e5, 1e5, 1.2e5], rtol=1e-8)
    np.testing.assert_allclose(found["sig_33"], [1e5, 1e5, 0.9e5], rtol=1e-8)
    names = ["eps_11", "eps_22", "eps_33"]
    rows = np.column_stack([found[name] for name in names]).tolist()
    (tmp_path / "strains.csv").write_text(
        "\n".join([",".join(names), *(",".join(map(repr, row)) for row in rows)])
    )
    assert drive("j2", "--path", "strains.csv", "--out", "again.csv")[0] == 0
    np.testing.assert_allclose(columns("again.csv")["sig_11"], found["sig_11"], rtol=1e-9)


def test_a_standard_test_with_turning_points_and_its_picture(drive, tmp_path):
    code, out, _ = drive(
        "j2", "--control", "triaxial-drained", "--turning-points", "0.05,0.02", "--strain", "0.08",
        "--steps", "14", "--p0", "2e5", "--out", "deep/out.nc", "--plot", "test.png", "--json",
    )  # fmt: skip
    assert code == 0
    said = json.loads(out)
    assert (said["model"], said["order"], said["rows"]) == ("j2", "principal", 15)
    # At flow q = sigma_Y, and p = p0 + q/3 where s22 = s33 = p0.
    assert said["deviatoric_stress"] == [pytest.approx(1e5, rel=1e-9)]
    assert said["mean_stress"] == [pytest.approx(2e5 + 1e5 / 3.0, rel=1e-8)]
    assert said["parameters"]["yield_stress"] == 1e5
    assert (tmp_path / "test.png").read_bytes().startswith(b"\x89PNG")
    with open_records("deep/out.nc") as ds:
        verify(ds)
        axial = ds["strain"].values[0, :, 0]
        assert json.loads(ds.attrs["configuration"])["course"] == "triaxial-drained"
    assert axial[-1] == pytest.approx(0.08) and np.float32(0.05) in axial


def test_records_are_driven_along_path_by_path(drive, records_file, records, tmp_path):
    code, out, _ = drive(
        "linear-elastic", "--task", records_file, "--path", records_file, "--out", "out.nc"
    )
    assert code == 0 and f"along each of {records.sizes['path']} paths" in out
    with open_records("out.nc") as ds:
        verify(ds)
        assert ds["path_id"].values.tolist() == records["path_id"].values.tolist()
        np.testing.assert_array_equal(ds["strain"].values, records["strain"].values)
        # Each path starts from what is recorded, and its void ratio as well.
        np.testing.assert_allclose(ds["stress"].values[:, 0], records["stress"].values[:, 0])
        np.testing.assert_allclose(
            ds["void_ratio"].values[:, 0], records["void_ratio"].values[:, 0], rtol=1e-6
        )
    refused(drive("j2", "--path", records_file, "--out", "out.csv"), "--out out.csv", "one path")


def test_a_column_of_axial_strain_drives_a_test(drive, tmp_path):
    (tmp_path / "history.csv").write_text("eps_axial\n0.01\n0.02\n-0.01\n")
    words = ("--path", "history.csv", "--out", "out.csv")
    refused(drive("j2", *words), "history.csv", "add --control NAME")
    refused(drive("j2", *words, "--control", "oedometer", "--steps", "9"), "--steps",
            "history.csv gives the driving strain")  # fmt: skip
    refused(drive("j2", *words, "--control", "simple-shear"), "eps_shear")
    assert drive("j2", *words, "--control", "constant-p")[0] == 0
    found = columns("out.csv")
    assert found["eps_11"].tolist() == [0.01, 0.02, -0.01]
    mean = (found["sig_11"] + found["sig_22"] + found["sig_33"]) / 3.0
    np.testing.assert_allclose(mean, 1e5, rtol=1e-8)


def test_a_users_own_cell_is_driven(drive, tmp_path):
    code, _, err = drive(
        "my_cells:hooke", "--control", "simple-shear-drained", "--steps", "5", "--out", "out.csv"
    )
    assert code == 0, err
    found = columns("out.csv")
    assert set(found) == {
        f"{kind}_{c}" for kind in ("eps", "sig") for c in ("xx", "yy", "zz", "yz", "xz", "xy")
    }
    np.testing.assert_allclose(found["sig_yy"], 1e5, rtol=1e-8)
    stiffness = elastic("full").module.stiffness[5, 5].item()
    np.testing.assert_allclose(found["sig_xy"], stiffness * found["eps_xy"], rtol=1e-12)
    code, _, err = drive("my_cells:learnt_cell", "--control", "triaxial-undrained", "--steps", "5",
                         "--strain", "-0.02", "--out", "net.csv")  # fmt: skip
    assert code == 0, err
    found = columns("net.csv")
    assert abs(found["eps_11"] + found["eps_22"] + found["eps_33"]).max() <= 1e-12


def test_options_give_what_a_baseline_needs_at_the_start(drive, tmp_path):
    words = ("linear-elastic", "--control", "oedometer", "--steps", "3", "--out", "out.csv")
    refused(drive(*words), "'initial_void_ratio'", "give it with --e0")
    assert drive(*words, "--e0", "0.6")[0] == 0
    assert columns("out.csv")["void_ratio"][0] == 0.6
    refused(
        drive(*words, "--e0", "0.6", "--start", "grading_index=1.1"),
        "--start grading_index is given",
        "does not use it",
    )


def test_parameters_come_from_a_file_or_a_set(drive, tmp_path):
    values = json.loads(MINE)["parameters"]
    (tmp_path / "mine.json").write_text(MINE)
    test = ("--control", "oedometer", "--steps", "4", "--json", "--out", "out.csv")
    for model in (("j2", "--params", "mine.json"), ("mine.json",)):
        code, out, err = drive(*model, *test)
        assert code == 0, err
        assert json.loads(out)["parameters"] == values
        # In the plane q = s1 - s2 = sigma_Y.
        assert json.loads(out)["deviatoric_stress"] == [pytest.approx(5e4, rel=1e-9)]
    assert drive("j2", "--set", "guan2023-sec6.6", *test)[0] == 0
    refused(drive("ime", "--params", "mine.json", *test), "mine.json", "'j2', not of 'ime'")
    (tmp_path / "mine.json").write_text('{"model": "j2", "parameters": {"stiffness": 1}}')
    refused(drive("mine.json", *test), "mine.json", "'stiffness'")


def test_internal_variables_are_in_the_answer(drive, tmp_path):
    assert drive("ime", "--control", "biaxial", "--order", "plane", "--strain", "0.05", "--steps",
                 "8", "--out", "out.csv", "--plot", "ime.svg")[0] == 0  # fmt: skip
    found = columns("out.csv")
    assert "out_of_plane_stress" in found
    assert found["plastic_strain_yy"][-1] > 0.0 > found["plastic_strain_xx"][-1]


def test_mistakes_of_a_user_are_errors_of_one_sentence(drive, tmp_path):
    (tmp_path / "path.csv").write_text(PLANE)
    (tmp_path / "nan.csv").write_text(PLANE + "0.02,nan,0\n")
    (tmp_path / "principal.csv").write_text("eps_11,eps_22,eps_33\n0.1,0,0\n")
    (tmp_path / "percent.csv").write_text(PLANE + "0.02,5.0,0\n")
    (tmp_path / "crushed.csv").write_text("eps_11,eps_22,eps_33\n0.1,0.1,0.1\n0.2,0.2,0.2\n")
    (tmp_path / "pascal.csv").write_text("eps_11,eps_22,sig_33\n0,0,1e15\n")
    (tmp_path / "history.csv").write_text("eps_axial\n0.1\n20\n")
    (tmp_path / "mine.csv").write_text(MINE)
    before = sorted(tmp_path.iterdir())
    path = ("--path", "path.csv")
    test = ("--control", "oedometer")
    cases = [
        (("j2", "--path", "nan.csv"), ["nan.csv: row 4 (line 5), column eps_yy"]),
        (("j2", "--path", "absent.csv"), ["absent.csv"]),
        (("j2", "--path", "absent.nc"), ["absent.nc"]),
        (("j2",), ["--control NAME", "--path FILE"]),
        (("j3", *test), ["unknown model 'j3'", "j2"]),
        (("mlstm", *test), ["has to be trained first"]),
        (("j2", *path, *test), ["--control", "path.csv prescribes every component"]),
        (("j2", *path, "--strain", "0.1"), ["--strain"]),
        (("j2", *path, "--b", "0"), ["--b"]),
        (("j2", "--control", "odometer"), ["did you mean 'oedometer'"]),
        (("j2", *test, "--b", "0.5"), ["b = 0.5", "leave b out"]),
        (("j2", "--control", "constant-p", "--b", "1.5"), ["--b 1.5 must lie in [0, 1]"]),
        (
            ("csuh", "--path", "percent.csv"),
            ["percent.csv: row 4 (line 5), column eps_yy holds 5", "divide it by 100"],
        ),
        (("csuh", "--path", "crushed.csv"), ["crushed.csv: row 2 (line 3)", "voids"]),
        (("j2", "--path", "pascal.csv"), ["row 1 (line 2), column sig_33", "1 GPa", "in Pa"]),
        (("j2", "--path", "history.csv", *test), ["row 2 (line 3), column eps_axial holds 20"]),
        (("j2", *test, "--strain", "20"), ["--strain 20", "write 0.2 for 20 %"]),
        (("j2", *test, "--turning-points", "0.1,-2"), ["--turning-points -2", "0.2 for 20 %"]),
        (("j2", *test, "--p0", "1e15"), ["--p0 1e+15", "in Pa (1e5 is 100 kPa)"]),
        (("csuh", *test, "--e0", "-0.1"), ["--e0 -0.1", "0.8, not 80 %"]),
        (("csuh", *test, "--e0", "80"), ["--e0 80", "0.8, not 80 %"]),
        (("csuh", *test, "--e0", "3"), ["--e0 3: ", "loosest"]),
        (("csuh", *test, "--ocr", "0.5"), ["--ocr 0.5", "give 1"]),
        (("j2", *test, "--params", "mine.csv", "--out", "mine.csv"), ["--params", "another file"]),
        (("j2", *test, "--strain", "nan"), ["--strain nan"]),
        (("j2", *test, "--strain", "0"), ["cannot be visited"]),
        (("j2", *test, "--steps", "0"), ["take more steps"]),
        (("j2", *test, "--turning-points", "0.1;0.2"), ["--turning-points '0.1;0.2'"]),
        (("j2", *test, "--p0", "-1e5"), ["--p0 -100000", "give it in Pa"]),
        (("j2", *test, "--p0", "nan"), ["--p0 nan"]),
        (("j2", *test, "--p0", "0"), ["--p0 0", "a standard test"]),
        (("j2", *test, "--order", "sideways"), ["sideways"]),
        (("j2", "--control", "simple-shear", "--order", "principal"), ["direction xy"]),
        (("my_cells:hooke", *test, "--order", "plane"), ["--order", "leave it out"]),
        (("j2", *test, "--set", "mine"), ["no parameter set 'mine'"]),
        (("my_cells:hooke", *test, "--set", "mine"), ["--set", "classical"]),
        (("j2", *test, "--set", "a", "--params", "b.json"), ["--set and --params"]),
        (("j2", *test, "--params", "absent.json"), ["absent.json"]),
        (("j2", *test, "--e0", "0.6"), ["--e0", "does not use it"]),
        (("j2", *test, "--e0", "0.6", "--ocr", "2"), ["--e0 and --ocr"]),
        (("csuh", *test, "--e0", "0.6", "--start", "overconsolidation_ratio=2"), ["--e0 and"]),
        (("csuh", *test, "--e0", "0.6", "--start", "initial_void_ratio=1"), ["given twice"]),
        (("j2", *test, "--start", "grading_index"), ["NAME=VALUE"]),
        (("j2", *test, "--start", "grading_index=fine"), ["--start grading_index 'fine'"]),
        (("my_cells:hooke", "--path", "principal.csv"), ["principal.csv", "eps_xx,eps_yy,eps_zz"]),
        (("my_cells:limited", *test, "--p0", "0"), ["--p0 0"]),
        (("j2", *test, "--plot", "a.bmp"), ["a.bmp"]),
        (("j2", *test, "--plot", "/proc/a.png"), ["--plot /proc/a.png", "choose a folder"]),
        (("j2", *test, "--out", "/proc/a.csv"), ["--out /proc/a.csv", "choose a folder"]),
        (("j2", *test, "--out", "path.csv/a.csv"), ["--out path.csv/a.csv", "cannot be written"]),
        (("absent.json", *test), ["no parameter file absent.json"]),
        (("j2", *test, "--tolerance", "0"), ["tolerance=0", "1e-4"]),
        (("csx", *test, "--set", "mine"), ["unknown model 'csx'"]),
    ]
    for words, parts in cases:
        refused(drive(*words, *(() if "--out" in words else ("--out", "out.csv"))), *parts)
    refused(drive("j2", *path, "--out", "out.xlsx"), "out.xlsx", ".csv or .nc")
    refused(drive("j2", *path, "--out", "path.csv"), "path.csv", "--path", "another file")
    assert sorted(tmp_path.iterdir()) == before


def test_a_step_that_the_model_cannot_follow_is_named_and_nothing_is_written(drive, tmp_path):
    (tmp_path / "jump.csv").write_text("eps_11,eps_22,eps_33\n0.01,0,0\n\n0.2,0,0.01\n0.21,0,0\n")
    refused(drive("my_cells:limited", "--path", "jump.csv", "--out", "out.csv"),
            "jump.csv: row 2 (line 4): limited cannot follow", "eps_11 changes by 0.19",
            "gives no stress")  # fmt: skip
    refused(drive("my_cells:limited", "--control", "triaxial-drained", "--steps", "10", "--out",
                  "out.csv"), "triaxial-drained, step 3 of 10, driving strain 0.06")  # fmt: skip
    assert not (tmp_path / "out.csv").exists()


def test_tension_is_refused_where_the_model_has_none(drive, tmp_path):
    (tmp_path / "tension.csv").write_text("eps_11,sig_22,sig_33\n0,1e5,1e5\n0.01,5e4,-2e3\n")
    words = ("--path", "tension.csv", "--out", "out.csv")
    refused(drive("my_cells:limited", *words), "tension.csv: row 2 (line 3), column sig_33",
            "-2000 Pa", "under compression")  # fmt: skip
    # A metal has no objection.
    assert drive("j2", "--path", "tension.csv", "--out", "out.csv")[0] == 0


def test_a_tensile_principal_stress_is_reported(drive, tmp_path):
    words = ["--control", "triaxial-drained", "--p0", "1e5", "--steps", "20", "--out", "out.csv"]
    code, out, _ = drive("modified-cam-clay", *words, "--strain", "-0.1", "--ocr", "8")
    assert code == 0
    with open(tmp_path / "out.csv") as file:
        axial = [float(row["sig_11"]) for row in csv.DictReader(file)]
    first = next(row for row, stress in enumerate(axial, start=1) if stress < 0.0)
    assert f"tensile from row {first} on, at most {-min(axial) / 1e3:.3g} kPa" in out
    code, out, _ = drive("modified-cam-clay", *words, "--strain", "0.1", "--ocr", "8")
    assert (code, "tensile" in out) == (0, False)


def test_a_stress_beyond_the_strength_is_an_error(drive, tmp_path):
    (tmp_path / "strong.csv").write_text("sig_11,sig_22,sig_33\n1e5,1e5,1e5\n4e5,1e5,1e5\n")
    refused(drive("j2", "--path", "strong.csv", "--out", "out.csv"), "row 2 (line 3)", "is missed")
