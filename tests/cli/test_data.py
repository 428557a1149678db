"""`granbench data`, as a user types it."""

import json

import netCDF4
import pytest
import yaml

from granbench.cli import main
from granbench.records import write_records


@pytest.fixture
def granbench(capsys, monkeypatch):
    """Run a command; gives exit code, standard output and standard error."""
    monkeypatch.setenv("COLUMNS", "200")

    def run(*words):
        capsys.readouterr()
        with pytest.raises(SystemExit) as left:
            main([str(word) for word in words])
        captured = capsys.readouterr()
        return left.value.code, captured.out, captured.err

    return run


def assert_one_sentence(result, *parts):
    code, out, err = result
    assert code == 2
    assert out == ""
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    for part in parts:
        assert part in err


def test_list_shows_all_datasets_and_their_places(granbench, shelf, records):
    entry = shelf.publish(records)
    code, out, _ = granbench("data", "list")
    assert code == 0
    assert "synthetic" in out
    assert "1.0.0" in out
    code, out, _ = granbench("data", "list", "--json")
    (row,) = json.loads(out)
    assert row["sha256"] == entry.sha256
    assert row["local_file"] is None
    shelf.use_mirror(shelf.mirror)
    granbench("data", "fetch", "synthetic")
    (row,) = json.loads(granbench("data", "list", "--json")[1])
    assert row["local_file"] == str(shelf.cache / entry.file)


def test_info_prints_the_floor_between_packings(granbench, shelf, records_file):
    code, out, _ = granbench("data", "info", records_file)
    assert code == 0
    assert "Replicate scatter (10 pairs of paths, 2 packings prepared again)" in out
    assert "ood-psd" in out
    assert "constant-sigma3 (10)" in out
    assert "0.1, 0.5, 1, 2, 4 MPa" in out
    summary = json.loads(granbench("data", "info", records_file, "--json")[1])
    assert summary["replicate_scatter"]["pairs"] == 10
    assert summary["splits"]["validation"] == {"paths": 5, "specimens": 1}
    assert summary["quality"]["min_box_edge_ratio"] > 3


def test_info_lists_the_paths(granbench, shelf, records, records_file):
    rows = json.loads(granbench("data", "info", records_file, "--paths", "--json")[1])
    assert [row["path_id"] for row in rows] == records["path_id"].values.tolist()
    lines = granbench("data", "info", records_file, "--paths")[1].splitlines()
    assert len(lines) == records.sizes["path"]


def test_fetch_into_a_folder_works_offline_from_the_checkout(granbench, shelf, records, tmp_path):
    entry = shelf.publish(records)
    (shelf.mirror / entry.file).rename(shelf.checkout / entry.file)
    code, out, err = granbench("data", "fetch", "synthetic", "--dest", tmp_path / "mine")
    assert (code, err) == (0, "")
    assert out.strip() == str(tmp_path / "mine" / entry.file)
    assert (tmp_path / "mine" / entry.file).stat().st_size == entry.bytes
    assert granbench("data", "fetch", "synthetic", "--quiet") == (0, "", "")


def test_verify_names_the_variable(granbench, shelf, records, records_file):
    code, out, _ = granbench("data", "verify", records_file)
    assert code == 0
    assert "every variable agrees" in out
    _overwrite_one_value(records_file, "coordination_number")
    result = granbench("data", "verify", records_file)
    assert_one_sentence(result, "synthetic.nc", "variable coordination_number differ", "fetch")


def _overwrite_one_value(file, name):
    from netCDF4 import Dataset

    with Dataset(file, "a") as handle:
        handle[name][3, 5] += 1e-6 * handle[name][3, 5]


def test_verify_reports_the_registered_name(granbench, shelf, records):
    entry = shelf.publish(records)
    words = ("data", "verify", shelf.mirror / entry.file, "--json")
    assert json.loads(granbench(*words)[1])["registered"] == "synthetic@1.0.0"


def test_plot_writes_a_picture(granbench, shelf, records_file, tmp_path):
    picture = tmp_path / "a.png"
    code, out, _ = granbench("data", "plot", records_file, "--out", picture)
    assert code == 0
    assert out.strip() == str(picture)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_figure_of_an_unknown_format_is_refused_before_anything_is_fetched(
    granbench, shelf, records, tmp_path
):
    shelf.publish(records)  # there is no mirror: to fetch it would be another error
    result = granbench("data", "plot", "synthetic", "--out", tmp_path / "p.xyz")
    assert_one_sentence(result, "p.xyz", ".png, .pdf or .svg")


def test_user_errors_are_one_sentence(granbench, shelf, records, tmp_path):
    shelf.publish(records)
    (tmp_path / "page.nc").write_text("<html>Not found</html>")
    (tmp_path / "in-the-way").write_text("")
    file = write_records(records, tmp_path / "a.nc")
    assert_one_sentence(granbench("data", "info", "syntetic"), "'synthetic'")
    assert_one_sentence(granbench("data", "info", "none.nc"), "none.nc", "no such file")
    assert_one_sentence(granbench("data", "verify", tmp_path / "page.nc"), "not a netCDF file")
    assert_one_sentence(granbench("data", "fetch", "synthetic"), "could not be fetched")
    shelf.use_mirror(shelf.mirror)
    words = ("data", "fetch", "synthetic", "--dest", tmp_path / "in-the-way")
    assert_one_sentence(granbench(*words), "cannot be written", "--dest")
    words = ("data", "plot", file, "--path", "nothing", "--out", tmp_path / "a.png")
    assert_one_sentence(granbench(*words), "no path 'nothing'")
    (tmp_path / "folder.png").mkdir()
    words = ("data", "plot", file, "--out", tmp_path / "folder.png")
    assert_one_sentence(granbench(*words), "folder.png", "cannot be written", "choose another")
    assert_one_sentence(granbench("data", "list", "--jsn"), "--jsn")


def test_list_and_fetch_name_datasets_that_can_be_made(granbench, shelf, records):
    for version, seconds in (("1.0.0", None), ("1.1.0", 5.0), ("1.2.0", 200.0)):
        entry = shelf.publish(records, version)
        file = shelf.mirror.parent / "registry" / f"synthetic-{version}.yaml"
        fields = entry.model_dump(mode="json") | {"generator_seconds": seconds}
        fields["generator"] = "granbench generate synthetic --out DIR"
        file.write_text(yaml.safe_dump(fields))
    rows = granbench("data", "list")[1].splitlines()
    places = {row.split("│")[2].strip(): row.split("│")[5].strip() for row in rows if "│" in row}
    assert places == {"1.2.0": "made by `fetch --make`", "1.1.0": "made in seconds", "1.0.0": "no"}
    assert_one_sentence(granbench("data", "fetch", "synthetic"), "--make", "about 3 minutes")
    assert_one_sentence(granbench("data", "fetch", "synthetic@1.0.0"), "granbench-data")


def test_maintainers_register_a_file_and_its_mini_tier(granbench, shelf, records_file, tmp_path):
    words = ("--id", "synthetic", "--title", "Made up", "--command", "none")
    code, out, _ = granbench("data", "register", records_file, *words)
    assert code == 0
    assert "registered synthetic 1.0.0" in out
    code, out, _ = granbench("data", "mini", records_file)
    assert code == 0
    assert [row["id"] for row in json.loads(granbench("data", "list", "--json")[1])] == [
        "synthetic",
        "synthetic-mini",
    ]
    assert_one_sentence(
        granbench("data", "register", records_file, *words, "--tier", "huge"), "tier"
    )


def test_a_file_that_differs_from_its_hash_is_neither_described_nor_drawn(
    granbench, records_file, tmp_path
):
    changed = tmp_path / "changed.nc"
    changed.write_bytes(records_file.read_bytes())
    with netCDF4.Dataset(changed, "a") as file:
        file["void_ratio"][3, 5] += 0.01
    picture = tmp_path / "picture.png"
    assert_one_sentence(granbench("data", "info", changed), "changed.nc", "void_ratio")
    assert_one_sentence(granbench("data", "plot", changed, "--out", picture), "void_ratio")
    assert not picture.exists()


def test_random_paths_are_described_verified_and_drawn(granbench, tmp_path):
    code, out, _ = granbench("data", "info", "gp-j2-mini")
    assert code == 0
    assert "plane components" in out
    assert "median |Δε|" in out
    assert "No specimen, preparation or path is in two splits" in out
    code, out, _ = granbench("data", "verify", "gp-j2-mini")
    assert code == 0
    assert "is gp-j2-mini 1.0.0 of the registry" in out
    picture = tmp_path / "paths.png"
    code, out, _ = granbench("data", "plot", "gp-j2-mini", "--out", picture)
    assert (code, out.strip()) == (0, str(picture))
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_text_of_a_file_gives_no_orders_to_the_terminal(granbench, records, tmp_path):
    records.attrs |= {"licence": "MIT \x1b[2J", "generator": "\x1b]0;owned\x07", "engine": "a\rb"}
    records["path_id"].values[0] = "p\x9b31m"
    file = write_records(records, tmp_path / "a.nc")
    for words in (("info",), ("info", "--json"), ("info", "--paths"), ("verify",)):
        code, out, err = granbench("data", words[0], file, *words[1:])
        assert code == 0
        assert not set(out + err) & set("\x1b\x07\r\x9b")
    summary = json.loads(granbench("data", "info", file, "--json")[1])
    assert summary["licence"] == "MIT \x1b[2J"
    result = granbench("data", "info", tmp_path / "a\x1b.nc")
    assert_one_sentence(result)
    assert "\x1b" not in result[2]


def test_a_dataset_that_declares_terabytes_is_refused_by_every_command(granbench, records_file):
    with netCDF4.Dataset(records_file, "a") as file:
        file.createDimension("wide", 10**6)
        file.createVariable("extra", "f4", ("wide", "wide"))
    for command in ("verify", "info", "plot"):
        assert_one_sentence(granbench("data", command, records_file), "synthetic.nc", "declares")


def test_verify_reports_what_it_cannot_check(granbench, shelf, records_file):
    out = granbench("data", "verify", records_file)[1]
    assert "not registered" in out and "ground truth" in out
