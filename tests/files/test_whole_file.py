"""A file appears whole or not at all, whatever happens while it is written."""

import errno
from pathlib import Path

import pytest

from granbench.errors import DatasetError
from granbench.files.whole_file import cannot_write, whole_file, whole_folder


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


def test_an_unwritable_folder_is_an_error_that_asks_for_another():
    with (
        pytest.raises(
            DatasetError, match=r"^/proc/file\.txt: cannot be written \([\w ]+\); "
        ) as said,
        whole_file(Path("/proc/file.txt"), DatasetError) as partial,
    ):
        partial.write_text("never")
    assert str(said.value).endswith("; choose a folder that can be written")


def test_a_folder_of_the_same_name_is_distinguished_from_an_unwritable_one(tmp_path):
    (tmp_path / "file.txt").mkdir()
    with (
        pytest.raises(DatasetError, match="a folder has this name, choose another$"),
        whole_file(tmp_path / "file.txt", DatasetError) as partial,
    ):
        partial.write_text("never")


@pytest.mark.parametrize(
    ("problem", "size"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), 0),
        (OSError(errno.EDQUOT, "Disk quota exceeded"), 0),
        (RuntimeError("HDF error"), 1 << 62),  # more bytes than any disk has
    ],
)
def test_a_full_disk_is_an_error_that_asks_for_space(tmp_path, problem, size):
    said = cannot_write(tmp_path / "file.txt", problem, size)
    assert said.endswith("; free some space or choose another folder")


def test_a_file_in_the_place_of_the_folder_is_one_clear_sentence(tmp_path):
    (tmp_path / "taken").write_text("")
    with (
        pytest.raises(DatasetError, match="cannot be written .*choose a folder"),
        whole_file(tmp_path / "taken" / "file.txt", DatasetError) as partial,
    ):
        partial.write_text("never")


def test_a_folder_gets_its_name_only_when_it_is_complete(tmp_path):
    path = tmp_path / "new" / "folder"
    with whole_folder(path, DatasetError) as partial:
        (partial / "a.txt").write_text("a")
        assert not path.exists()
    assert [file.name for file in path.parent.iterdir()] == ["folder"]
    with whole_folder(path, DatasetError) as partial:
        (partial / "b.txt").write_text("b")
    assert sorted(file.name for file in path.iterdir()) == ["a.txt", "b.txt"]


def test_a_failure_leaves_the_old_folder_or_none(tmp_path):
    for path, left in ((tmp_path / "new" / "folder", []), (tmp_path, ["old.txt"])):
        with pytest.raises(KeyboardInterrupt), whole_folder(path, DatasetError) as partial:
            (partial / "half.txt").write_text("half")
            raise KeyboardInterrupt
        assert [file.name for file in tmp_path.iterdir()] == left
        (tmp_path / "old.txt").write_text("old")


def test_an_unwritable_folder_is_reported_before_the_work_begins():
    with (
        pytest.raises(DatasetError, match=r"^/proc/folder: cannot be written .* choose a folder"),
        whole_folder(Path("/proc/folder"), DatasetError),
    ):
        pytest.fail("the block began")
