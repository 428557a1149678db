"""Laws of fetching: whole and right under the final name, or not there at all."""

import errno
import os
import threading
from pathlib import Path

import pytest
from http_mirror import Mirror, serve

from granbench.data.fetch import fetch
from granbench.data.store import file_of
from granbench.errors import DatasetError, DownloadError


@pytest.fixture
def published(shelf, records):
    return shelf.publish(records)


@pytest.fixture
def content(shelf, published):
    return (shelf.mirror / published.file).read_bytes()


def names(folder):
    return sorted(os.listdir(folder)) if folder.exists() else []


def test_the_checkout_comes_first_and_works_offline(shelf, published, content, tmp_path):
    (shelf.checkout / published.file).write_bytes(content)
    with serve(Mirror(content)) as mirror:
        shelf.use_mirror(mirror.address)
        file = fetch(published, tmp_path / "dest")
    assert file.read_bytes() == content
    assert mirror.requests == []


def test_a_wrong_file_in_the_checkout_is_skipped_for_the_next_mirror(
    shelf, published, content, tmp_path
):
    (shelf.checkout / published.file).write_bytes(content[:-1] + b"?")
    shelf.use_mirror(shelf.mirror)
    assert fetch(published, tmp_path / "dest").read_bytes() == content


def test_the_registered_mirrors_come_last(shelf, records, tmp_path):
    with serve(Mirror(b"")) as mirror:
        entry = shelf.publish(records, mirrors=[mirror.address])
        mirror.content = (shelf.mirror / entry.file).read_bytes()
        assert fetch(entry, tmp_path / "dest").read_bytes() == mirror.content


def test_a_file_that_is_there_is_not_fetched_again(shelf, published, content, tmp_path):
    with serve(Mirror(content)) as mirror:
        shelf.use_mirror(mirror.address)
        fetch(published, tmp_path / "dest")
        fetch(published, tmp_path / "dest")
    assert len(mirror.requests) == 1


def test_progress_reaches_the_whole(shelf, published, content, tmp_path):
    seen = []
    with serve(Mirror(content)) as mirror:
        shelf.use_mirror(mirror.address)
        fetch(published, tmp_path / "dest", lambda done, total: seen.append((done, total)))
    assert seen == sorted(seen)
    assert seen[-1] == (published.bytes, published.bytes)


@pytest.mark.parametrize("length", [True, False])
def test_a_connection_that_breaks_is_resumed_by_range(shelf, published, content, tmp_path, length):
    with serve(Mirror(content, breaks_after=50_000, length=length)) as mirror:
        shelf.use_mirror(mirror.address)
        file = fetch(published, tmp_path / "dest")
    assert file.read_bytes() == content
    assert mirror.requests[:2] == [None, "bytes=50000-"]
    assert names(tmp_path / "dest") == [published.file]


def test_a_later_fetch_continues_what_an_earlier_one_left(shelf, published, content, tmp_path):
    (tmp_path / f"{published.file}.part").write_bytes(content[:123_456])
    with serve(Mirror(content)) as mirror:
        shelf.use_mirror(mirror.address)
        assert fetch(published, tmp_path).read_bytes() == content
    assert mirror.requests == ["bytes=123456-"]


def test_a_server_without_ranges_sends_all_again(shelf, published, content, tmp_path):
    (tmp_path / f"{published.file}.part").write_bytes(content[:1000])
    with serve(Mirror(content, ranges=False)) as mirror:
        shelf.use_mirror(mirror.address)
        assert fetch(published, tmp_path).read_bytes() == content


@pytest.mark.parametrize("left_over", [b"rubbish", b"rubbish" * 100_000])
def test_a_left_over_of_something_else_is_thrown_away(
    shelf, published, content, tmp_path, left_over
):
    (tmp_path / f"{published.file}.part").write_bytes(left_over)
    with serve(Mirror(content)) as mirror:
        shelf.use_mirror(mirror.address)
        assert fetch(published, tmp_path).read_bytes() == content


def test_a_server_that_dies_keeps_what_came_for_the_next_time(shelf, published, content, tmp_path):
    with serve(Mirror(content, breaks_after=60_000, ranges=False)) as mirror:
        shelf.use_mirror(mirror.address)
        with pytest.raises(DownloadError, match="60000 of .* fetch again to continue"):
            fetch(published, tmp_path / "dest")
        assert names(tmp_path / "dest") == [f"{published.file}.part"]
        mirror.ranges, mirror.breaks_after = True, None
        assert fetch(published, tmp_path / "dest").read_bytes() == content


def flipped(content):
    return content[:-1000] + bytes([content[-1000] ^ 0xFF]) + content[-999:]


FAULTS = {
    "SHA-256 is .* instead of the registered": lambda content: Mirror(flipped(content)),
    "file has 5000 bytes instead of": lambda content: Mirror(content[:5000]),
    "more than": lambda content: Mirror(content + b"more", length=False),
    "sent a web page": lambda content: Mirror(content, page=b"<html>Sorry</html>"),
    "not a netCDF file": lambda content: Mirror(b"x" * len(content)),
    "HTTP status 404": lambda content: Mirror(content, status=404),
    "HTTP status 503": lambda content: Mirror(content, status=503),
}


@pytest.mark.parametrize("sentence", FAULTS)
def test_a_wrong_answer_is_one_sentence_and_no_file(shelf, published, content, tmp_path, sentence):
    with serve(FAULTS[sentence](content)) as mirror:
        shelf.use_mirror(mirror.address)
        with pytest.raises(DownloadError, match=f"{mirror.address}: .*{sentence}"):
            fetch(published, tmp_path / "dest")
    assert published.file not in names(tmp_path / "dest")


def test_a_web_page_does_not_cost_what_was_kept(shelf, published, content, tmp_path):
    part = tmp_path / f"{published.file}.part"
    part.write_bytes(content[:1000])
    with serve(Mirror(content, page=b"<html>Sign in</html>")) as mirror:
        shelf.use_mirror(mirror.address)
        with pytest.raises(DownloadError, match="web page"):
            fetch(published, tmp_path)
    assert part.read_bytes() == content[:1000]


def test_every_mirror_is_named_when_none_helps(shelf, published, tmp_path):
    shelf.use_mirror("ftp://example.org")
    with pytest.raises(DownloadError) as caught:
        fetch(published, tmp_path)
    assert str(shelf.checkout) in str(caught.value)
    assert "ftp://example.org: only folders and http" in str(caught.value)


def test_an_address_without_a_server(shelf, published, tmp_path):
    shelf.use_mirror("http://127.0.0.1:9")
    with pytest.raises(DownloadError, match="refused"):
        fetch(published, tmp_path)


def test_a_full_disk_is_reported_and_leaves_no_file(shelf, published, content, tiny_disk):
    shelf.use_mirror(shelf.mirror)
    with pytest.raises(DownloadError, match="the disk is full"):
        fetch(published, tiny_disk)
    assert names(tiny_disk) == []
    with serve(Mirror(content)) as mirror:
        shelf.use_mirror(mirror.address)
        with pytest.raises(DownloadError, match="the disk is full"):
            fetch(published, tiny_disk)
    assert names(tiny_disk) == []


def test_a_full_disk_without_root(shelf, published, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    shelf.use_mirror(shelf.mirror)
    monkeypatch.setattr("granbench.data.fetch.shutil.copyfileobj", full)
    with pytest.raises(DownloadError, match="the disk is full; .*folder"):
        fetch(published, tmp_path / "dest")
    assert names(tmp_path / "dest") == []


def test_a_place_that_cannot_be_written(shelf, published, tmp_path):
    (tmp_path / "file").write_text("in the way")
    shelf.use_mirror(shelf.mirror)
    with pytest.raises(DownloadError, match="cannot be written .*folder"):
        fetch(published, tmp_path / "file")


def test_two_at_once_fetch_it_once(shelf, published, content, tmp_path):
    with serve(Mirror(content)) as mirror:
        shelf.use_mirror(mirror.address)
        workers = [threading.Thread(target=fetch, args=(published, tmp_path)) for _ in range(4)]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
    assert len(mirror.requests) == 1
    assert (tmp_path / published.file).read_bytes() == content


def test_a_folder_of_the_same_name_does_not_hide_a_dataset(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("gp-j2-mini", "mine"):
        (tmp_path / name).mkdir()
    assert file_of("gp-j2-mini").suffix == ".nc"
    with pytest.raises(DatasetError, match="is a folder"):
        file_of("mine")
