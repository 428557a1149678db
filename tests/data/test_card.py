"""The dataset card: everything on it is computed from the file."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
import xarray as xr

from granbench.data.card import FIGURES, write_card
from granbench.data.card_text import card_text
from granbench.errors import GranbenchError
from granbench.records import seal
from granbench.records.observations import select


def test_card_shows_every_figure_and_nothing_is_left_half_written(
    records: xr.Dataset, tmp_path: Path
) -> None:
    page = write_card(seal(records), tmp_path)
    addresses = re.findall(r"!\[\]\((.*?)\)", page.read_text())
    assert len(addresses) == len(FIGURES)
    assert all((tmp_path / address).read_bytes().startswith(b"\x89PNG") for address in addresses)
    assert {file.name for file in tmp_path.iterdir()} == {page.name, page.stem}


def test_card_states_hash_units_and_configuration(records: xr.Dataset) -> None:
    sealed = seal(records)
    text = card_text(sealed, {})
    assert sealed.attrs["content_sha256"] in text
    assert "| `stress` | path, step, component | Pa |" in text
    assert '"n_specimens": 8' in text


def test_counts_on_the_card_add_up_to_the_paths(records: xr.Dataset) -> None:
    text = card_text(records, {})
    table = text.split("Tests by family and pressure:")[1].split("Monotonic")[0]
    totals = [int(row.rstrip("| ").split("|")[-1]) for row in table.splitlines() if "| con" in row]
    families = records["loading_family"].values.astype(str)
    assert sorted(totals) == sorted(
        (families == family).sum() for family in ("constant-p", "constant-sigma3")
    )


def test_a_figure_without_its_tests_is_named_with_the_reason(
    records: xr.Dataset, tmp_path: Path
) -> None:
    monotonic = select(records, loading_family=("constant-p", "constant-sigma3"))
    text = write_card(seal(monotonic), tmp_path).read_text()
    assert "*cyclic* is left out: synthetic has no cyclic tests" in text


def test_a_leak_is_reported(records: xr.Dataset) -> None:
    leaking = records.copy(deep=True)
    split = leaking["split"].values.astype(object)
    split[0] = "test"
    leaking["split"] = ("path", split)
    assert "**Splits share**" in card_text(leaking, {})


def test_the_same_file_gives_the_same_page(records: xr.Dataset, tmp_path: Path) -> None:
    sealed = seal(records)
    first = write_card(sealed, tmp_path / "first")
    second = write_card(sealed, tmp_path / "second")
    assert first.read_text() == second.read_text()
    for figure in (tmp_path / "first" / first.stem).iterdir():
        again = tmp_path / "second" / first.stem / figure.name
        assert figure.read_bytes() == again.read_bytes()


def test_an_unwritable_folder_is_one_sentence(records: xr.Dataset, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(GranbenchError, match="choose a folder"):
        write_card(seal(records), tmp_path / "file")


def test_the_command_refuses_what_is_no_dataset(tmp_path: Path) -> None:
    (tmp_path / "page.nc").write_text("<html>")
    done = subprocess.run(
        [sys.executable, "-m", "granbench.data.card", tmp_path / "page.nc", "--out", tmp_path],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.startswith("error: ")
    assert "not a netCDF file" in done.stderr
