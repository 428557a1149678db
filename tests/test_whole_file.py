"""A file appears whole or not at all, whatever happens while it is written."""

import pytest

from granbench.errors import DatasetError
from granbench.whole_file import whole_file


def test_a_file_gets_its_name_only_when_it_is_complete(tmp_path):
    path = tmp_path / "new" / "file.txt"
    with whole_file(path, DatasetError) as partial:
        partial.write_text("half")
        assert not path.exists()
    assert path.read_text() == "half"
    assert [file.name for file in path.parent.iterdir()] == ["file.txt"]


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "file.txt"
    path.write_text("old")
    with pytest.raises(ZeroDivisionError), whole_file(path, DatasetError) as partial:
        partial.write_text("new")
        raise ZeroDivisionError
    assert path.read_text() == "old" and len(list(tmp_path.iterdir())) == 1


def test_a_library_that_cannot_write_is_quoted_with_the_file(tmp_path):
    with (
        pytest.raises(DatasetError, match=r"file\.nc: cannot be written \(HDF error\)"),
        whole_file(tmp_path / "file.nc", DatasetError, RuntimeError),
    ):
        raise RuntimeError("HDF error")


def test_a_file_in_the_place_of_the_folder_is_one_clear_sentence(tmp_path):
    (tmp_path / "taken").write_text("")
    with (
        pytest.raises(DatasetError, match="cannot be written .*choose a folder"),
        whole_file(tmp_path / "taken" / "file.txt", DatasetError) as partial,
    ):
        partial.write_text("never")
