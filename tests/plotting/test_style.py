"""The style of figures: each model has one style, readable in grey, files whole or absent."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.colors import to_rgb

from granbench.errors import ConfigurationError
from granbench.plotting.style import (
    MODEL_COLOURS,
    figure_grid,
    model_styles,
    ordered_colours,
    save_figure,
)

BASELINES = ("lstm", "mlstm", "persistence", "linear-elastic", "oracle", "gru", "physics-cell")


def test_a_model_looks_the_same_on_every_page() -> None:
    together = model_styles(BASELINES)
    for name in BASELINES:
        assert model_styles([name])[name] == together[name]


@given(st.lists(st.text(max_size=8), unique=True, max_size=len(MODEL_COLOURS)))
def test_no_two_models_of_a_page_have_the_same_style(names: list[str]) -> None:
    styles = model_styles(names)
    assert len({style.colour for style in styles.values()}) == len(names)
    assert len({str(style.linestyle) for style in styles.values()}) == len(names)


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=20, unique=True))
def test_ordered_colours_grow_lighter_with_the_quantity(values: list[float]) -> None:
    colours, _ = ordered_colours(values)
    # Rec. 601 weights: what a grey printer makes of the colour.
    grey = np.array([to_rgb(colour) for colour in colours]) @ (0.299, 0.587, 0.114)
    assert (np.diff(grey[np.argsort(values)]) >= -2e-3).all()  # 256 colours: half a level


def test_saving_writes_the_whole_picture_and_nothing_else(tmp_path: Path) -> None:
    figure, _ = figure_grid()
    picture = save_figure(figure, tmp_path / "new" / "empty.png")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert [file.name for file in picture.parent.iterdir()] == ["empty.png"]


@pytest.mark.parametrize(
    ("name", "begins"), [("a.png", b"\x89PNG"), ("a.pdf", b"%PDF"), ("a.SVG", b"<?xml")]
)
def test_the_name_decides_the_format_and_the_bytes_are_always_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, begins: bytes
) -> None:
    files = []
    for folder, seconds in (("one", "0"), ("two", "1000000000")):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", seconds)  # matplotlib's clock
        figure, axes = figure_grid()
        axes[0].plot([0.0, 1.0], label="line")
        axes[0].legend()
        files.append(save_figure(figure, tmp_path / folder / name).read_bytes())
    assert files[0].startswith(begins)
    assert files[0] == files[1]


@pytest.mark.parametrize("name", ["a.xyz", "a.jpg", "a", ".png"])
def test_a_name_without_a_known_format_is_refused(tmp_path: Path, name: str) -> None:
    figure, _ = figure_grid()
    with pytest.raises(ConfigurationError, match=r"a figure is a \.png, \.pdf or \.svg file"):
        save_figure(figure, tmp_path / "new" / name)
    assert not list(tmp_path.iterdir())


def test_an_unwritable_folder_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    figure, _ = figure_grid()
    with pytest.raises(ConfigurationError, match="choose a folder"):
        save_figure(figure, tmp_path / "file" / "empty.png")


def test_drawing_never_touches_pyplot() -> None:
    code = (
        "import sys, granbench.plotting.style as style; style.figure_grid(2, 2); "
        "sys.exit('matplotlib.pyplot' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
