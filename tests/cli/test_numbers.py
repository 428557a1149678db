"""Every number that an option takes: absurd ones are one sentence before any work."""

from pathlib import Path

import pytest

from granbench.cells.work_budget import WorkExceeded, spend, work_budget
from granbench.cli import main
from granbench.cli.options import core_count
from granbench.element_test.driving import WorkLimitError, drive
from granbench.element_test.prescribed_path import PrescribedPath
from granbench.element_test.start import Start
from granbench.models import MODELS
from granbench.paths.standard_tests import find_test, strain_history

HUGE = "1" + "0" * 30
DRIVE = ("drive", "csuh", "--e0", "0.8", "--control", "triaxial-drained", "--out", "o.csv")
FEM = ("fem", "biaxial", "--cell", "j2", "--mesh", "coarse", "--out", "o.nc")
FIT = ("fit", "j2", "--data", "d.csv", "--out", "o")
TRAIN = ("train", "lstm", "--task", "gp-j2-mini", "--out", "o")
EVALUATE = ("evaluate", "linear-elastic", "--task", "gp-j2-mini", "--out", "o.json")
GENERATE = ("generate", "gp-j2", "--out", "o")


def refused(*words: str) -> bool:
    with pytest.raises(SystemExit) as leaving:
        main(words)
    return leaving.value.code == 2


@pytest.mark.parametrize(
    ("command", "option", "values"),
    [
        (DRIVE, "--p0", ("100", "-1e5", "nan", "inf", "1e300", HUGE, "text")),
        (DRIVE, "--strain", ("30", "nan", "inf", "-1e300", HUGE)),
        (DRIVE, "--turning-points", ("2,1", "nan", "0.1,inf")),
        (DRIVE, "--steps", ("0", "-1", "nan", "1e12", HUGE, "1000000000000")),
        (DRIVE, "--b", ("-1", "nan", "inf", "1e300")),
        (DRIVE, "--ocr", ("0", "-1", "nan", "inf", "1e300")),
        (DRIVE, "--tolerance", ("0", "-1", "nan", "inf", "1e300")),
        (DRIVE, "--patience", ("0", "-1", "nan", "inf", "1e300")),
        (FEM, "--outputs", ("0", "-1", "nan", HUGE)),
        (FEM, "--damping", ("-1", "nan", "inf", "1e300")),
        (FEM, "--time-step", ("0", "-1", "nan", "inf", "1e300", "1e-320")),
        (FEM, "--safety", ("0", "-1", "nan", "inf", "1e300", "1e-320")),
        (FEM, "--modulus", ("0", "-1", "20", "nan", "inf", "1e300")),
        (FIT, "--points", ("0", "-1", HUGE)),
        (FIT, "--starts", ("0", "-1", HUGE)),
        (FIT, "--spread", ("-1", "nan", "inf", "1e300")),
        (FIT, "--seed", ("-1", "nan", HUGE)),
        (FIT, "--iterations", ("0", "-1", HUGE)),
        (FIT, "--bootstrap", ("-1", "5", HUGE)),
        (TRAIN, "--seed", ("-1", "nan", "1e23", HUGE, "9223372036854775808", "text")),
        (TRAIN, "--threads", ("0", "-1", "3000", HUGE)),
        (TRAIN, "--epochs", ("0", "-1", "nan")),
        (TRAIN, "--budget", ("0", "-1", "nan", "inf", "1e308")),
        (TRAIN, "--device", ("meta", "cuda:77", "abacus", "")),
        (EVALUATE, "--seeds", ("-1", "nan", "1e23", HUGE, "0,0", "", "1" * 5000)),
        (GENERATE, "--seed", ("-1", "nan", "1e23", HUGE, "text")),
        (GENERATE, "--workers", ("0", "-1", "nan")),
    ],
)  # fmt: skip
def test_an_absurd_number_is_one_sentence_and_no_work(
    command: tuple[str, ...],
    option: str,
    values: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "d.csv").write_text("eps1 [%],q [kPa],p [kPa]\n0,0,200\n1,100,233\n2,150,250\n")
    for value in values:
        assert refused(*command, option, value), value
        said = capsys.readouterr().err
        assert said.startswith("error: ") and said.count("\n") == 1, said
        assert len(said) < 600
    assert [file.name for file in tmp_path.iterdir()] == ["d.csv"]


def test_threads_are_bounded_by_the_cores(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert refused(*TRAIN[:-1], str(tmp_path / "o"), "--threads", str(core_count() + 1))
    assert f"{core_count()} cores" in capsys.readouterr().err


def test_work_is_limited_only_within_a_budget() -> None:
    for _ in range(1000):
        spend()  # without a budget
    with pytest.raises(WorkExceeded), work_budget(10):
        for _ in range(11):
            spend()


@pytest.mark.parametrize("model", ["csuh", "modified-cam-clay"])
def test_a_run_that_needs_too_many_substeps_ends_with_its_step(model: str) -> None:
    cell = MODELS[model](order="principal")
    programme = find_test("triaxial-drained").programme(1e5, 0.2)
    history = strain_history([0.2], 20)
    course = PrescribedPath.of_test("triaxial-drained", programme, history, "principal")
    state = Start(1e5, {"initial_void_ratio": 0.8}).state(cell)
    with pytest.raises(WorkLimitError, match=r"step \d+ of 20"):
        drive(cell, course, state, configuration={}, work_factor=1e-3)
    assert drive(cell, course, state, configuration={}).records.sizes["step"] == 21


@pytest.mark.parametrize(
    ("words", "kept"),
    [
        (("evaluate", "linear-elastic", "--task", "gp-j2-mini", "--out", "x.json", "--against",
          "x.json"), "x.json"),
        (("drive", "j2", "--path", "p.csv", "--out", "p.csv"), "p.csv"),
        (("fem", "biaxial", "--cell", "j2", "--choose", "load_path=l.nc", "--out", "l.nc"), "l.nc"),
        (("evaluate", "m", "--task", "gp-j2-mini", "--out", "m/model.json"), "m/model.json"),
    ],
)  # fmt: skip
def test_no_command_overwrites_what_it_reads(
    words: tuple[str, ...], kept: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / kept).parent.mkdir(exist_ok=True)
    (tmp_path / kept).write_text("mine")
    assert refused(*words)
    assert (tmp_path / kept).read_text() == "mine"


def test_a_folder_in_the_place_of_a_submission_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    (tmp_path / "x.json").mkdir()
    assert refused(*EVALUATE[:-1], str(tmp_path / "x.json"))
    assert "a folder has this name" in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["x.json"]
