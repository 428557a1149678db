"""The page on finite elements: its tables are made here, its examples run."""

import re
import runpy
from pathlib import Path

import fem_network
import fem_page
import numpy as np
import pytest
from fem_network import EXHIBITS
from page_parts import markers, write_picture
from test_pages import ROOT, blocks, printed, run_command

from granbench.fem import PROBLEMS, run
from granbench.plotting.problem import problem_figure

PAGE = "docs/fem.md"
EXAMPLE = "docs/examples/footing_on_a_model.py"
PICTURE_BYTES = 90_000


def written(part: str) -> str:
    begin, end = markers(part)
    text = (ROOT / PAGE).read_text(encoding="utf-8")
    return text.split(begin)[1].split(end)[0].strip()


@pytest.mark.parametrize("part", ["problems", "choices"])
def test_tables_of_problems_are_what_the_code_makes(part: str) -> None:
    """`make docs` writes them."""
    assert fem_page.cheap_parts()[part] == written(part)


@pytest.mark.slow
@pytest.mark.parametrize("part", ["limits", "speeds"])
def test_tables_of_results_are_what_the_code_makes(part: str) -> None:
    assert fem_page.analysed_parts()[part] == written(part)


CHAOTIC = ("network-fem-ime",)
"""Where networks lose the truth so far that rounding decides what they do."""

FOLLOWS = 5.0
"""Per cent of the reaction within which a network follows; beyond, rounding decides the rest."""


def followed(cell: str) -> str | None:
    """A cell of the table where the network follows the truth; None where it has lost it."""
    number = re.match(r"([\d.]+) %", cell)
    return cell if number and float(number[1]) <= FOLLOWS else None


@pytest.mark.slow
@pytest.mark.parametrize("part", EXHIBITS)
def test_the_table_of_networks_is_what_the_boards_networks_do(part: str) -> None:
    exhibit = EXHIBITS[part]
    found = fem_network.network_part(exhibit, fem_network.analyses(exhibit))
    if part not in CHAOTIC:
        assert found == written(part)
        return
    for again, row in zip(found.splitlines(), written(part).splitlines(), strict=True):
        cells = [[cell.strip() for cell in line.split("|")] for line in (again, row)]
        assert cells[0][:4] == cells[1][:4]  # problem, solver and the truth
        assert list(map(followed, cells[0][4:])) == list(map(followed, cells[1][4:]))


@pytest.mark.parametrize("part", EXHIBITS)
def test_networks_on_the_page_are_those_of_the_board(part: str) -> None:
    assert list(EXHIBITS[part].networks()) == ["0", "1", "2"]
    header = written(part).splitlines()[0]
    assert all(f"seed {seed}" in header for seed in (0, 1, 2))


def test_every_problem_is_drawn_with_what_holds_and_moves_it(tmp_path: Path) -> None:
    figure = problem_figure([kind() for kind in PROBLEMS.values()])
    titles = [axis.get_title() for axis in figure.axes]
    assert titles[: len(PROBLEMS)] == [kind.title for kind in PROBLEMS.values()]
    for axis in figure.axes[: len(PROBLEMS)]:
        assert axis.lines  # supports
        assert len(axis.collections) >= 3  # the mesh, what moves, what presses
    picture = write_picture(figure, tmp_path / "problems.png")
    assert picture.stat().st_size <= PICTURE_BYTES


def test_python_on_the_page_runs() -> None:
    (example,) = blocks(PAGE, "python")
    assert printed(example).endswith(" kN/m")


def test_a_user_model_of_ten_lines_carries_the_footing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    source = (ROOT / EXAMPLE).read_text(encoding="utf-8")
    model = source.split("class ")[1].split("\n\n\n")[0]
    assert len([line for line in model.splitlines() if line.strip()]) <= 10
    runpy.run_path(str(ROOT / EXAMPLE), run_name="__main__")
    assert capsys.readouterr().out.startswith("half of the footing carries ")
    assert Path("footing.nc").is_file() and Path("footing.png").is_file()
    monkeypatch.syspath_prepend(str((ROOT / EXAMPLE).parent))
    words = "fem strip-footing --cell footing_on_a_model:cell --mesh coarse --outputs 2 --quiet"
    run_command([*words.split(), "--choose", "end_strain=0.001", "--out", "own.nc"])
    assert Path("own.nc").is_file()


def test_results_show_every_body_at_its_end() -> None:
    found = {
        name: run(kind(end_strain=0.001), fem_page.MODELS["j2"](), solver="implicit", mesh="coarse")
        for name, kind in PROBLEMS.items()
    }
    figure = fem_page.results_figure({name: one.check() for name, one in found.items()})
    curves, *_ = figure.axes
    assert [line.get_label() for line in curves.lines] == list(PROBLEMS)
    assert all(np.isfinite(line.get_ydata()).all() for line in curves.lines)
