"""The pages of the classical models: made by code that runs here, and true."""

import csv
from functools import cache
from pathlib import Path

import model_pages
import numpy as np
import pytest
from model_curves import EVIDENCE, Evidence
from page_parts import write_picture
from PIL import Image
from test_pages import ROOT, blocks, commands, printed, run_command

from granbench.models import MODELS
from granbench.models.substepping import Substepping
from granbench.plotting.model import QUANTITIES, Panel, model_figure

NAMES = list(MODELS)
PICTURE_BYTES = 90_000
"""Largest size of a figure, bytes: pages are read on slow connections too."""

CURVES = {
    "j2.csv": ("j2", 0, "biaxial, in the plane"),
    "plane-strain.csv": ("j2", 0, "biaxial, plane strain"),
    "dp.csv": ("drucker-prager", 0, "$p_0$ = 100 kPa"),
    "loop.csv": ("j2-hardening", 2, "biaxial"),
    "ime.csv": ("ime", 0, "tab7.1"),
    "softening.csv": ("enhanced-ime", 2, "$p_0$ = 100 kPa"),
}
"""File of a command on a page -> model, panel and label of the curve that it ends on."""

UNDRAINED = {"csuh": "$e_0$ = 0.833", "modified-cam-clay": "OCR = 8"}
"""Curve of the fourth panel that the first command of a page makes."""


@cache
def evidence(name: str) -> Evidence:
    """The tests of a model's page, run once for all of this file."""
    return EVIDENCE[name]()


def page(name: str) -> str:
    return f"docs/models/{name}.md"


@pytest.fixture(params=NAMES)
def name(request: pytest.FixtureRequest) -> str:
    return request.param


def test_every_model_has_a_page_and_curves() -> None:
    assert list(EVIDENCE) == list(model_pages.SUMMARIES)
    assert set(EVIDENCE) == set(NAMES)
    assert all((ROOT / page(name)).is_file() for name in NAMES)


def test_generated_parts_are_what_the_code_makes(name: str) -> None:
    """`make docs` writes them."""
    written = (ROOT / page(name)).read_text(encoding="utf-8")
    assert model_pages.model_page(name, evidence(name)) == written


def test_the_index_of_models_is_what_the_code_makes() -> None:
    written = (ROOT / "docs/models/README.md").read_text(encoding="utf-8")
    assert model_pages.models_index() == written


def test_curves_agree_with_their_closed_forms(name: str) -> None:
    for one in evidence(name).comparisons:
        assert one.difference <= one.tolerance, one


def test_dots_lie_on_the_curves(name: str) -> None:
    """Within a fiftieth of the panel, the radius of a dot."""
    for panel in evidence(name).panels:
        curves = list(panel.curves().values())
        everything = np.concatenate([np.stack(curve, axis=1) for curve in curves])
        span = np.ptp(everything, axis=0)
        for dots in dots_of(panel):
            distances = [distance(dots / span, np.stack(c, axis=1) / span) for c in curves]
            assert np.min(distances, axis=0).max() < 0.02, (panel.title, dots)


def dots_of(panel: Panel) -> list[np.ndarray]:
    """Points (point, 2) of the closed forms that are drawn as dots, in the units of the axes."""
    scale = QUANTITIES[panel.abscissa].scale, QUANTITIES[panel.ordinate].scale
    return [
        np.stack([np.asarray(form.x), np.asarray(form.y)], axis=1) * np.array(scale)
        for form in panel.closed_forms
        if not form.line
    ]


def distance(points: np.ndarray, curve: np.ndarray) -> np.ndarray:
    """Distance (point,) of points to a polygon."""
    start, along = curve[:-1], np.diff(curve, axis=0)
    offset = points[:, None] - start
    length = np.maximum((along**2).sum(axis=1), 1e-30)
    share = np.clip((offset * along).sum(axis=2) / length, 0.0, 1.0)
    return np.linalg.norm(offset - share[..., None] * along, axis=2).min(axis=1)


def test_the_figure_draws_every_curve_to_its_end(name: str, tmp_path: Path) -> None:
    panels = evidence(name).panels
    figure = model_figure(panels)
    assert len(figure.axes) == len(panels)
    for axis, panel in zip(figure.axes, panels, strict=True):
        assert axis.get_xlabel().endswith("]") and axis.get_ylabel().endswith("]")
        drawn = [line.get_xydata() for line in axis.lines]
        for line, (x, y) in zip(drawn, panel.curves().values(), strict=False):
            np.testing.assert_array_equal(line, np.stack([x, y], axis=1))
    committed = ROOT / "docs/models" / f"{name}.png"
    first = write_picture(figure, tmp_path / "first.png")
    second = write_picture(model_figure(panels), tmp_path / "second.png")
    assert first.read_bytes() == second.read_bytes()
    assert max(first.stat().st_size, committed.stat().st_size) <= PICTURE_BYTES
    with Image.open(first) as new, Image.open(committed) as old:
        assert new.size == old.size


def test_commands_of_a_page_make_its_curves(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shown = [words for words in commands(page(name)) if words[0] == "drive"]
    assert shown
    for words in shown:
        run_command([*words, "--quiet"])
        file = words[words.index("--out") + 1]
        if file in CURVES:
            model, number, label = CURVES[file]
            assert model == name
            known = evidence(name).panels[number].curves()[label][1][-1]
            # Other steps to the same end: the models without pieces of their own are of first
            # order in the step where the flow turns, as in plane strain.
            assert stress_difference(tmp_path / file)[-1] == pytest.approx(known, rel=1e-4)


@pytest.mark.parametrize("name", list(UNDRAINED))
def test_the_undrained_command_ends_where_the_figure_does(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    run_command([*next(iter(commands(page(name)))), "--quiet"])
    known = evidence(name).panels[3].curves()[UNDRAINED[name]][1][-1]
    # The error control of the pieces, 3e-4 each.
    assert stress_difference(tmp_path / "undrained.csv")[-1] == pytest.approx(known, rel=1e-3)


def stress_difference(file: Path) -> np.ndarray:
    """Axial minus lateral stress of an answer, (row,), kPa."""
    with file.open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    axial, lateral = ("sig_yy", "sig_xx") if "sig_yy" in rows[0] else ("sig_11", "sig_33")
    return np.array([float(row[axial]) - float(row[lateral]) for row in rows]) / 1e3


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("j2", "25000 Pa, 3 x 3"),
        ("drucker-prager", "K_p = 3.000"),
        ("j2-hardening", "q = 247.19 kPa, law 247.19 kPa"),
        ("ime", "q = 201.3 kPa, d ln q / d ln A = 0.981"),
        ("enhanced-ime", "True"),
        ("csuh", "[2988, 962, 185]"),
        ("modified-cam-clay", "0.135\n0.040"),
    ],
)
def test_the_example_of_a_page_prints_the_stated_output(name: str, expected: str) -> None:
    (example,) = blocks(page(name), "python")
    assert printed(example) == expected


def test_a_model_of_ones_own_fits_on_a_page_and_is_driven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its small triaxial test has Young's modulus of 100 kPa, and gradients reach K_r."""
    (example,) = blocks("docs/models/README.md", "python")
    (tmp_path / "my_soil.py").write_text(example)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    words = next(words for words in commands("docs/models/README.md") if "my_soil:cell" in words)
    run_command([*words, "--quiet"])
    young = 3.0 * (1.0 - 2.0 * 0.2) * 6e7
    stress = 1e3 * stress_difference(tmp_path / "answer.csv")
    # The first of 200 steps to 0.2 %: the stiffness has grown by (dp/p)/2, some 0.1 %.
    assert stress[1] / (0.002 / 200) == pytest.approx(young, rel=2e-3)
    assert len([line for line in example.splitlines() if line.strip()]) < 25


def test_the_page_on_csuh_states_the_error_control_of_the_code() -> None:
    text, settings = (ROOT / page("csuh")).read_text(encoding="utf-8"), Substepping()
    mantissa, exponent = f"{settings.tolerance:.0e}".split("e")
    assert rf"${mantissa}\cdot10^{{{int(exponent)}}}$" in text
    assert f"more than {settings.most} attempts" in text


def test_a_symbol_becomes_mathematics() -> None:
    symbols = {
        "sigma_Y": r"$\sigma_{Y}$",
        "eps_0p": r"$\varepsilon_{0p}$",
        "OCR": r"$\mathrm{OCR}$",
    }
    assert {symbol: model_pages.mathematics(symbol) for symbol in symbols} == symbols
