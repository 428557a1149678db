"""A campaign with damaged files is continued to the same results."""

import json
import os
import re
import shutil
from pathlib import Path

import pytest
from campaign_support import files_of, quiet, walks

from granbench.errors import ConfigurationError
from granbench.generators.campaign import Job
from granbench.generators.campaign.sealed_record import SEAL, read_record

pytestmark = pytest.mark.usefixtures("toy_jobs")


def truncate(file: Path) -> None:
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


def flip_a_bit(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)


def make_a_folder(file: Path) -> None:
    file.unlink()
    file.mkdir()
    (file / "foreign").write_text("something else")


def make_a_fifo(file: Path) -> None:
    file.unlink()
    os.mkfifo(file)


def make_a_link(file: Path) -> None:
    file.rename(file.with_name("elsewhere"))
    file.symlink_to("/dev/zero")


DAMAGES = {
    "lost": Path.unlink,
    "empty": lambda file: file.write_bytes(b""),
    "truncated": truncate,
    "one bit": flip_a_bit,
    "longer": lambda file: file.write_bytes(file.read_bytes() + b"\0"),
    "not text": lambda file: file.write_bytes(b"\xff\xfe\x00"),
    "null": lambda file: file.write_text("null"),
    "list": lambda file: file.write_text("[1, 2]"),
    "nested": lambda file: file.write_text("[" * 100_000),
    "huge number": lambda file: file.write_text('{"seed": ' + "9" * 6000 + "}"),
    "folder": make_a_folder,
    "fifo": make_a_fifo,
    "link": make_a_link,
}
FILES = ["job.json", "walk.txt", "notes/order.txt"]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished")
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[1]))
        assert not quiet(walks(), folder).failed
    return folder


@pytest.fixture
def own(finished: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished, tmp_path / "own"))


@pytest.mark.parametrize("kind", DAMAGES)
def test_only_jobs_with_damaged_results_run_again(own, finished, kind):
    for slug, name in zip(("walk__0", "walk__1", "joined"), FILES, strict=True):
        DAMAGES[kind](own / "results" / slug / name)
    report = quiet(walks(), own, workers=2)
    assert set(report.damaged) == {"walk/0", "walk/1", "joined"}
    assert report.skipped == ("walk/2",) and not report.failed
    assert files_of(own) == files_of(finished)
    assert (own / "campaign.log").read_text().count(" damaged ") == 3
    assert not quiet(walks(), own).damaged


@pytest.mark.parametrize("change", [{"digest": 5}, {"seed": "7"}, {"files": None}, {"needs": {}}])
def test_a_record_with_values_of_other_types_is_damaged(own, finished, change):
    file = own / "results" / "joined" / "job.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    assert list(quiet(walks(), own).damaged) == ["joined"]
    assert files_of(own) == files_of(finished)


def test_foreign_files_and_empty_job_folders_are_not_results(own, finished):
    shutil.rmtree(own / "results" / "walk__1")
    (own / "results" / "walk__1").mkdir()
    shutil.rmtree(own / "results" / "joined")
    (own / "results" / "joined").write_text("a file where a folder should be")
    (own / "attempts" / "foreign").write_text("")
    (own / "attempts" / "link").symlink_to(finished)
    (own / "results" / "notes.txt").write_text("mine")
    report = quiet(walks(), own)
    assert set(report.damaged) == {"walk/1", "joined"}
    (own / "results" / "notes.txt").unlink()
    assert files_of(own) == files_of(finished)


@pytest.mark.parametrize("kind", DAMAGES)
def test_a_damaged_failure_record_does_not_stop_the_job_from_being_tried(tmp_path, kind):
    repair = tmp_path / "repair"
    job = Job("bad", "toy_jobs:rejected", {"repair": str(repair)}, 0)
    assert quiet([job], tmp_path / "campaign").permanent == {"bad"}
    repair.touch()
    DAMAGES[kind](tmp_path / "campaign" / "failed" / "bad.json")
    assert quiet([job], tmp_path / "campaign").failed == {}
    assert not os.path.lexists(tmp_path / "campaign" / "failed" / "bad.json")


def test_results_of_an_earlier_version_without_a_hash_are_accepted(own, finished):
    for slug in ("walk__0", "walk__1", "walk__2", "joined"):
        file = own / "results" / slug / "job.json"
        record = json.loads(file.read_text())
        del record[SEAL], record["files"]
        file.write_text(json.dumps(record))
        assert read_record(file) is not None
    assert len(quiet(walks(), own).skipped) == 4
    assert files_of(own) == files_of(finished)


@pytest.mark.parametrize("kind", ["folder", "fifo", "link"])
def test_a_lock_that_is_not_a_file_is_refused(own, kind):
    DAMAGES[kind](own / "lock")
    with pytest.raises(ConfigurationError, match=re.escape(str(own))):
        quiet(walks(), own)
