"""The page on random paths: its numbers and its figure are made here, its example runs."""

from pathlib import Path

import numpy as np
import pytest
import random_paths_page
import xarray as xr
from page_parts import write_picture
from PIL import Image
from test_pages import blocks, commands, printed, run_command

from granbench.errors import DatasetError
from granbench.plotting.random_paths import random_path_figure
from granbench.tensors import frobenius_norm

PAGE = "docs/random_paths.md"
PICTURE_BYTES = 90_000


@pytest.fixture(scope="module")
def paths() -> xr.Dataset:
    return random_paths_page.drawn()


def test_generated_parts_are_what_the_code_makes(paths: xr.Dataset) -> None:
    """`make docs` writes them."""
    assert random_paths_page.page(paths) == random_paths_page.PAGE.read_text(encoding="utf-8")


def test_the_thesis_median_increment_is_met(paths: xr.Dataset) -> None:
    """1.3e-3; the median over 1000 paths of one seed scatters by some 2 %."""
    strain = paths["strain"].values[paths["split"].values == "train"]
    norms = frobenius_norm(np.diff(strain, axis=1), "plane")
    assert np.median(norms) == pytest.approx(1.3e-3, rel=0.05)


def test_the_figure_shows_paths_and_all_increments(paths: xr.Dataset, tmp_path: Path) -> None:
    shown = random_paths_page.SHOWN
    figure = random_path_figure(paths, shown)
    *drawn, histogram = figure.axes
    assert [axis.get_title() for axis in drawn] == list(shown)
    first = 100.0 * paths["strain"].values[0]
    np.testing.assert_array_equal(np.stack([line.get_ydata() for line in drawn[0].lines], 1), first)
    # Fewer than one in a hundred increments, at turning points, is beyond the edges.
    areas = [outline.get_data().values.sum() for outline in histogram.patches]
    assert len(areas) == len(set(paths["split"].values)) and min(areas) > 99.0
    assert all(axis.get_ylabel().endswith("]") and axis.get_xlabel() for axis in figure.axes)
    picture = write_picture(figure, tmp_path / "paths.png")
    assert picture.stat().st_size <= PICTURE_BYTES
    with Image.open(picture) as new, Image.open(random_paths_page.PICTURE) as committed:
        assert new.size == committed.size


def test_a_path_that_is_not_there_is_named(paths: xr.Dataset) -> None:
    with pytest.raises(DatasetError, match="no path 'train/9999'"):
        random_path_figure(paths, ["train/9999"])


def test_the_example_prints_the_median() -> None:
    (example,) = blocks(PAGE, "python")
    assert printed(example) == "(500, 201, 3), median increment 1.30e-03"


def test_the_command_makes_a_dataset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    words = next(words for words in commands(PAGE) if "--preset" in words)
    run_command([*words, "--quiet"])
    assert list((tmp_path / "DIR").rglob("*.nc"))
