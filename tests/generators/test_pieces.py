"""A campaign that is carried to another machine goes on where it was."""

import pytest
from campaign_support import files_of, quiet, walks

from granbench.errors import ConfigurationError
from granbench.generators.pieces import pack, unpack

pytestmark = pytest.mark.usefixtures("toy_jobs")


def test_a_packed_campaign_continues_elsewhere_without_its_bulky_results(tmp_path):
    jobs = walks()
    quiet(jobs, tmp_path / "here")
    assert pack(tmp_path / "here", tmp_path / "part.zip") == 2  # joined and walk/1
    assert unpack(tmp_path / "part.zip", tmp_path / "there") == 2
    report = quiet(jobs, tmp_path / "there")
    assert set(report.skipped) == {"joined", "walk/1"}
    assert set(report.spared) == {"walk/0", "walk/2"}
    here, there = files_of(tmp_path / "here"), files_of(tmp_path / "there")
    assert there == {name: here[name] for name in there}


def test_packing_twice_gives_the_same_bytes(tmp_path):
    quiet(walks(), tmp_path / "here")
    pack(tmp_path / "here", tmp_path / "one.zip")
    pack(tmp_path / "here", tmp_path / "two.zip")
    assert (tmp_path / "one.zip").read_bytes() == (tmp_path / "two.zip").read_bytes()


def test_nothing_is_taken_from_a_damaged_archive(tmp_path):
    quiet(walks(), tmp_path / "here")
    pack(tmp_path / "here", tmp_path / "part.zip")
    content = bytearray((tmp_path / "part.zip").read_bytes())
    content[len(content) // 3] ^= 0xFF
    (tmp_path / "part.zip").write_bytes(content)
    with pytest.raises(ConfigurationError, match=r"part\.zip"):
        unpack(tmp_path / "part.zip", tmp_path / "there")
    assert not (tmp_path / "there" / "results").exists()
