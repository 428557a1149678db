"""`granbench fit`: from a laboratory file to parameters that the other commands take."""

import json
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

from granbench.cli import main
from granbench.data.store import load

sys.path.append(str(Path(__file__).parents[1] / "laboratory"))
from laboratory_files import drained_curve, write_csv

HEADERS = ["eps1 [%]", "epsv [%]", "q [kPa]", "p [kPa]", "e"]
QUICK = ("--starts", "2", "--points", "12", "--iterations", "25", "--quiet")


def run(*words: object) -> int:
    with pytest.raises(SystemExit) as exit_:
        main([str(word) for word in words])
    return int(exit_.value.code or 0)


def answer_of(parameters: Path, out: Path, pressure: float = 1e5) -> np.ndarray:
    words = ("--control", "triaxial-drained", "--p0", pressure, "--strain", "0.05", "--steps", "20")
    assert run("drive", "j2-hardening", "--params", parameters, *words, "--out", out, "-q") == 0
    return np.genfromtxt(out, delimiter=",", names=True)


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drained test of J2 with hardening, written as a laboratory would: % and kPa."""
    folder = tmp_path_factory.mktemp("laboratory")
    true = folder / "true.json"
    true.write_text(
        json.dumps(
            {
                "model": "j2-hardening",
                "parameter_set": "guan2023-sec6.6",
                "parameters": {"bulk_modulus": 9e5, "shear_modulus": 6e5},
            }
        )
    )
    test = answer_of(true, folder / "test.csv")
    # The driven strain is logarithmic; a laboratory divides by the first height.
    axial = 100.0 * -np.expm1(-test["eps_11"])
    volume = 100.0 * -np.expm1(-(test["eps_11"] + test["eps_22"] + test["eps_33"]))
    q = (test["sig_11"] - test["sig_33"]) / 1e3
    p = (test["sig_11"] + test["sig_22"] + test["sig_33"]) / 3e3
    return write_csv(folder / "cd.csv", HEADERS[:4], [axial, volume, q, p])


def test_fitted_parameters_are_recovered_and_drive_the_same_curve(
    laboratory: Path, tmp_path: Path
) -> None:
    out = tmp_path / "fit"
    assert run("fit", "j2-hardening", "--data", laboratory, "--out", out, *QUICK) == 0
    report = json.loads((out / "fit.json").read_text())
    found = json.loads((out / "parameters.json").read_text())["parameters"]
    # The file keeps twelve digits; the elastic moduli act on every point.
    assert found["bulk_modulus"] == pytest.approx(9e5, rel=1e-4)
    assert found["shear_modulus"] == pytest.approx(6e5, rel=1e-4)
    assert report["error"] < 1e-5
    assert (out / "fit.png").stat().st_size > 10_000
    fitted = answer_of(out / "parameters.json", tmp_path / "again.csv")
    truth = np.genfromtxt(laboratory.parent / "test.csv", delimiter=",", names=True)
    np.testing.assert_allclose(fitted["sig_11"], truth["sig_11"], rtol=1e-5)


def test_a_fitted_cell_is_scored_like_any_model(laboratory: Path, tmp_path: Path) -> None:
    out, card = tmp_path / "fit", tmp_path / "card.json"
    assert run("fit", "j2", "--data", laboratory, "--out", out, *QUICK) == 0
    task = ("--task", "gp-j2-mini", "--axis", "rollout", "--seeds", "0")
    assert run("evaluate", out / "parameters.json", *task, "--out", card, "--quiet") == 0
    submission = json.loads(card.read_text())
    # Every fit gives its file the same name; the folder identifies it.
    assert submission["name"] == "j2-fit"
    scores = submission["scores"]
    found = [s for s in scores if s["metric"] == "stress_mse_mean" and s["status"] == "scored"]
    assert found
    assert all(score["value"] > 0.0 for score in found)


def test_a_test_that_is_left_out_is_predicted_and_printed(
    laboratory: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "other.csv"
    other.write_text(laboratory.read_text())
    words = ("fit", "j2", "--data", laboratory, "--leave-out", other, "--out", tmp_path / "fit")
    assert run(*words, *QUICK[:-1]) == 0
    assert "left out" in capsys.readouterr().out
    errors = json.loads((tmp_path / "fit" / "fit.json").read_text())["errors"]
    assert [error["role"] for error in errors] == ["fitted", "left out"]
    # It is a copy of the fitted one: predicted as well as that, to the last digit.
    assert errors[0]["error"] == errors[1]["error"]


@pytest.mark.parametrize("before", [[], ["fit.json", "mine.txt"]], ids=["no folder", "a folder"])
@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_fit_that_is_stopped_leaves_the_folder_as_it_was(
    number: signal.Signals, code: int, before: list[str], laboratory: Path, tmp_path: Path,
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    out = tmp_path / "deep" / "fit"
    if before:
        out.mkdir(parents=True)
        for name in before:
            (out / name).write_text("old")

    def stopped(*_: object, **__: object) -> None:
        signal.raise_signal(number)

    monkeypatch.setattr("granbench.fitting.fit", stopped)
    assert run("fit", "j2", "--data", laboratory, "--out", out) == code
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.startswith(("terminated", "interrupted"))
    assert [file.name for file in tmp_path.iterdir()] == (["deep"] if before else [])
    assert sorted(file.name for file in out.glob("*")) == before
    assert all((out / name).read_text() == "old" for name in before)


def test_isotropic_compression_determines_only_the_bulk_modulus(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    volume = np.linspace(0.0, 2.0, 12)
    columns = [volume / 3.0, volume, 0.0 * volume, 100.0 + 25.0 * volume]
    data = write_csv(tmp_path / "iso.csv", HEADERS[:4], columns)
    words = ("fit", "j2", "--data", data, "--out", tmp_path / "fit", *QUICK[:-1])
    assert run(*words, "--free", "bulk_modulus", "--strain-measure", "logarithmic") == 0
    out = capsys.readouterr().out
    assert "note: no shear in iso" in out
    assert "note: j2 was fitted in three dimensions" in out
    assert "fixed" not in out and out.count(" held") == 2  # what --free left out
    found = json.loads((tmp_path / "fit" / "parameters.json").read_text())["parameters"]
    # 25 kPa for each per cent.
    assert found["bulk_modulus"] == pytest.approx(2.5e6, rel=1e-6)


def test_a_fit_does_not_overwrite_the_records_that_it_reads(
    laboratory: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "fit"
    assert run("fit", "j2", "--data", laboratory, "--out", out, *QUICK) == 0
    records = out / "tests.nc"
    assert run("fit", "j2", "--data", records, "--out", out, *QUICK) == 2
    assert "would be overwritten" in capsys.readouterr().err
    # Without the volume no records can be made: those of the other tests go.
    columns = np.genfromtxt(laboratory, delimiter=",", skip_header=1).T
    bare = write_csv(tmp_path / "bare.csv", [HEADERS[0], *HEADERS[2:4]], [columns[0], *columns[2:]])
    assert run("fit", "j2", "--data", bare, "--out", out, "--free", "yield_stress", *QUICK) == 0
    assert not records.exists() and (out / "parameters.json").exists()


@pytest.mark.parametrize(
    ("change", "words", "named"),
    [
        ({"q [kPa]": lambda q: 1e6 * q}, (), ["q", "kPa"]),
        ({"q [kPa]": lambda q: np.where(q > 100.0, np.nan, q)}, (), ["q [kPa]", "row"]),
        ({}, ("--free", "stiffness"), ["stiffness", "shear_modulus"]),
        ({}, ("--leave-out", "nothing.csv"), ["--leave-out 'nothing.csv'", "--data", "cd"]),
        ({}, ("--weight", "colour=2"), ["--weight colour"]),
        ({"q [kPa]": lambda q: 0.0 * q + 0.2}, (), ["cd.csv", "no shear", "--free", "bulk_mod"]),
        ({}, ("--control", "stress"), ["--control 'stress'", "mixed"]),
        ({}, ("--points", "3"), ["'--points'", "5"]),
        ({}, ("--bootstrap", "5"), ["bootstrap = 5", "20"]),
        ({}, ("--out", "/proc/fit"), ["/proc/fit", "choose a folder"]),
    ],
    ids=["wrong unit", "not a number", "unknown parameter", "no file", "unknown quantity",
         "no shear", "unknown control", "few points", "few samples", "unwritable"],
)  # fmt: skip
def test_a_mistake_gives_one_sentence_and_writes_nothing(
    change: dict, words: tuple, named: list[str], tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    columns = dict(zip(HEADERS, drained_curve().values(), strict=True))
    for header, spoil in change.items():
        columns[header] = spoil(columns[header])
    data = write_csv(tmp_path / "cd.csv", HEADERS, list(columns.values()))
    out = tmp_path / "fit"
    assert run("fit", "j2", "--data", data, "--out", out, *QUICK, *words) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert all(word in said for word in named), said
    assert not out.exists()


def test_an_unknown_model_and_four_points_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    curve = [column[:4] for column in drained_curve().values()]
    data = write_csv(tmp_path / "cd.csv", HEADERS, curve)
    assert run("fit", "j3", "--data", data, "--out", tmp_path / "fit") == 2
    assert "j2" in capsys.readouterr().err
    assert run("fit", "j2", "--data", data, "--out", tmp_path / "fit") == 2
    assert "4 rows" in capsys.readouterr().err


def test_the_mini_tier_is_there_to_be_scored_on() -> None:
    assert load("gp-j2-mini").sizes["path"] > 0
