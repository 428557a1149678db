"""A path that is not a regular file, or too large a file, is refused before it is opened."""

import os

import pytest

from granbench.errors import ConfigurationError, GranbenchError
from granbench.fem.load_path_file import read_load_path
from granbench.files.input_file import require_file
from granbench.laboratory import read_tests
from granbench.paths.strain_files import read_path


@pytest.mark.parametrize("read", [read_path, read_load_path, read_tests])
@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "sparse", "absent"])
def test_no_reader_of_tables_opens_what_is_no_file(read, kind, tmp_path) -> None:
    path = tmp_path / "x.csv"
    if kind == "pipe":
        os.mkfifo(path)  # to open it would wait without end
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    elif kind == "sparse":
        path.touch()
        os.truncate(path, 2**40)
    with pytest.raises(GranbenchError, match=r"x\.csv"):
        read(path)


def test_a_link_to_a_file_is_a_file(tmp_path) -> None:
    (tmp_path / "a.csv").write_text("12345")
    (tmp_path / "b.csv").symlink_to(tmp_path / "a.csv")
    require_file(tmp_path / "b.csv", ConfigurationError, 5)
    with pytest.raises(ConfigurationError, match="more than"):
        require_file(tmp_path / "b.csv", ConfigurationError, 4)
