"""Pictures: drawn whatever the environment says, and never at the price of results."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from granbench.cli import main
from granbench.plotting.style import figure_grid, house_style, save_figure

LABORATORY = "eps1 [%],q [kPa],p [kPa]\n0,0,200\n.5,60,220\n1,100,233\n1.5,130,243\n2,150,250\n"
DRIVE = ("drive", "j2", "--control", "triaxial-drained", "--strain", "0.02", "--steps", "20")


def run(*words: object) -> int:
    with pytest.raises(SystemExit) as leaving:
        main([str(word) for word in words])
    return leaving.value.code or 0


@pytest.mark.parametrize(
    "backend", ["module://matplotlib_inline.backend_inline", "no such backend", "TkAgg"]
)
def test_a_picture_is_drawn_with_any_backend_in_the_environment(
    backend: str, tmp_path: Path
) -> None:
    environment = {name: text for name, text in os.environ.items() if name != "DISPLAY"}
    command = [sys.executable, "-m", "granbench", *DRIVE, "--out", "o.csv", "--plot", "o.png"]
    done = subprocess.run(
        command,
        cwd=tmp_path,
        env=environment | {"MPLBACKEND": backend},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "o.png").stat().st_size > 1000


def test_a_known_backend_stays_chosen_for_the_rest_of_the_process() -> None:
    code = (
        "import granbench.plotting, matplotlib, os\n"
        "print(matplotlib.rcParams['backend'], os.environ['MPLBACKEND'])"
    )
    environment = os.environ | {"MPLBACKEND": "svg"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["svg", "svg"]


@pytest.fixture
def broken_drawing(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> None:
        raise RuntimeError("no fonts")

    monkeypatch.setattr(Figure, "savefig", fails)


@pytest.mark.usefixtures("broken_drawing")
def test_results_of_drive_outlive_their_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    out, picture = tmp_path / "o.csv", tmp_path / "o.png"
    assert run(*DRIVE, "--out", out, "--plot", picture) == 0
    assert "note: the picture" in capsys.readouterr().err
    assert out.exists() and not picture.exists()


@pytest.mark.usefixtures("broken_drawing")
def test_results_of_fit_outlive_their_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    data, out = tmp_path / "d.csv", tmp_path / "o"
    data.write_text(LABORATORY)
    words = ("fit", "j2", "--data", data, "--starts", 1, "--iterations", 2, "--out", out)
    assert run(*words) == 0
    captured = capsys.readouterr()
    assert "note: the picture" in captured.err and "no fonts" in captured.err
    assert (out / "parameters.json").exists() and not (out / "fit.png").exists()


@pytest.mark.usefixtures("broken_drawing")
def test_a_trained_model_outlives_its_picture(
    records_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    out = tmp_path / "m"
    assert run("train", "lstm", "--task", records_file, "--out", out, "--epochs", 1) == 0
    assert "note: the picture" in capsys.readouterr().err
    assert (out / "model.json").exists()


@pytest.mark.usefixtures("broken_drawing")
def test_a_command_that_only_draws_fails_with_its_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert run("data", "plot", "gp-j2-mini", "--out", tmp_path / "o.png") == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("error: the picture") and captured.err.count("\n") == 1


@pytest.mark.parametrize(
    "name", [r"$\foo$", "$_", r"a$b$c$\frac$", "\udcff\x00\x1b[31m", "$$", "_x"]
)
@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_no_name_from_a_file_ends_the_drawing(name: str, ending: str, tmp_path: Path) -> None:
    @house_style
    def drawn() -> Figure:
        figure, (axis,) = figure_grid()
        axis.plot([0.0, 1.0], label=name)
        axis.set(title=f"{name}, constant $p$", xlabel=name)
        axis.legend(title=name)
        figure.suptitle(name)
        return figure

    assert save_figure(drawn(), tmp_path / f"picture.{ending}").stat().st_size > 500


def test_a_laboratory_file_may_have_any_name(tmp_path: Path) -> None:
    data, out = tmp_path / r"$\foo$.csv", tmp_path / "o"
    data.write_text(LABORATORY)
    words = ("fit", "j2", "--data", data, "--starts", 1, "--iterations", 2, "--out", out)
    assert run(*words) == 0
    assert (out / "fit.png").exists()
