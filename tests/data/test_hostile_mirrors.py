"""Whatever a server, a mirror's name or the `.part` file's place is: one sentence, or the file."""

import hashlib
import os
import time

import pytest
from http_mirror import Mirror, serve

from granbench.data import download
from granbench.data.fetch import fetch
from granbench.data.registry import RegistryEntry
from granbench.data.store import cache_folder, dataset_file, load
from granbench.errors import ConfigurationError, DownloadError


@pytest.fixture
def content():
    """Bytes that look like a netCDF file until the hash is compared."""
    return b"\x89HDF\r\n\x1a\n" + bytes(range(256)) * 800


@pytest.fixture
def published(shelf, content):
    shelf.mirror.mkdir()
    (shelf.mirror / "made-up.nc").write_bytes(content)
    return RegistryEntry(
        id="made-up", version="1.0.0", title="", tier="core", licence="", thesis_section="",
        file="made-up.nc", bytes=len(content), sha256=hashlib.sha256(content).hexdigest(),
        content_sha256="0" * 64, attributes_sha256="0" * 64, split_sha256="0" * 64,
        generator="none",
    )  # fmt: skip


def headers(*pairs, **mirror):
    return lambda content: Mirror(content, headers=pairs, **mirror)


ANSWERS = {
    "length that is no number": (headers(("Content-Length", "abc")), "'abc' as the length"),
    "negative length": (headers(("Content-Length", "-5")), "'-5' as the length"),
    "huge length": (headers(("Content-Length", "9" * 5000)), "as the length"),
    "two lengths": (headers(("Content-Length", "5"), ("Content-Length", "6")), "'5, 6' as the"),
    "listed lengths": (headers(("Content-Length", "5, 6")), "'5, 6' as the length"),
    "superscript": (headers(("Content-Length", "\xb2")), "as the length"),
    "no content": (lambda content: Mirror(content, status=204), "HTTP status 204"),
    "to a file": (headers(("Location", "file:///etc/passwd"), status=302), "is not allowed"),
    "to ftp": (headers(("Location", "ftp://127.0.0.1:9/x"), status=301), "redirects to ftp:"),
    "to no host": (headers(("Location", "http://[::1"), status=307), "not an address"),
    "to itself": (headers(("Location", "/again"), status=302), "HTTP status 302"),
    "zipped": (lambda content: Mirror(b"\x1f\x8b" + content[2:]), "not a netCDF file"),
    "escapes": (
        headers(("Location", "gopher://x/\x1b[31m" + "x" * 3000), status=302),
        "HTTP status 302",
    ),
}


@pytest.mark.parametrize("kind", ANSWERS)
def test_a_false_answer_is_one_short_error_and_no_file(shelf, published, content, kind):
    answer, sentence = ANSWERS[kind]
    with serve(answer(content)) as mirror:
        shelf.use_mirror(mirror.address)
        with pytest.raises(DownloadError, match=sentence) as caught:
            fetch(published, shelf.cache)
    assert str(caught.value).isprintable() and len(str(caught.value)) < 1000
    assert os.listdir(shelf.cache) == []


@pytest.mark.parametrize(
    "span", ["bytes 0-99/100", "bytes 1000-5/9", "bytes 1000-", "lines 1000-2000/*", "\xb2", ""]
)
def test_a_range_that_was_not_requested_is_not_appended(shelf, published, content, span):
    shelf.cache.mkdir()
    part = shelf.cache / f"{published.file}.part"
    part.write_bytes(content[:1000])
    with serve(Mirror(content, headers=(("Content-Range", span),))) as mirror:
        shelf.use_mirror(mirror.address)
        with pytest.raises(DownloadError, match="sends the range"):
            fetch(published, shelf.cache)
    assert part.read_bytes() == content[:1000]


@pytest.mark.parametrize("drips", ["headers", "body"])
def test_a_server_that_sends_byte_by_byte_is_given_up_and_resumed(
    shelf, published, content, drips, monkeypatch
):
    monkeypatch.setattr(download, "SLOW_WINDOW", 1.0)
    with serve(Mirror(content, drips=drips)) as mirror:
        shelf.use_mirror(mirror.address)
        began = time.monotonic()
        with pytest.raises(DownloadError, match="less than 1000 bytes a second.*fetch again"):
            fetch(published, shelf.cache)
        assert time.monotonic() - began < 10.0
        mirror.drips = None
        assert fetch(published, shelf.cache).read_bytes() == content
    assert drips == "headers" or mirror.requests[-1].startswith("bytes=")


def test_a_server_that_sends_a_byte_in_each_connection_is_given_up(
    shelf, published, content, monkeypatch
):
    monkeypatch.setattr(download, "CONNECTIONS", 8)
    with serve(Mirror(content, breaks_after=1)) as mirror:
        shelf.use_mirror(mirror.address)
        with pytest.raises(DownloadError, match="8 connections broke after 8 of"):
            fetch(published, shelf.cache)


@pytest.mark.parametrize(
    "name",
    [
        "http://[::1", "http://127.0.0.1:99999999/x", "http://127.0.0.1:abc/", "http://", "http:///x",
        "http://a b/", "http://exämple.invalid:1/ü", "~nobody-at-all", "ftp://x", "file:///etc",
        "HTTP://[", "/dev/null", "/proc/self/mem/x", "x" * 5000, "a\nb",
    ],
)  # fmt: skip
def test_an_invalid_mirror_is_one_error_and_the_next_is_tried(shelf, published, name, monkeypatch):
    monkeypatch.setattr(download, "TIMEOUT", 2.0)
    shelf.use_mirror(name)
    with pytest.raises(DownloadError, match="could not be fetched") as caught:
        fetch(published, shelf.cache)
    assert str(caught.value).isprintable()
    entry = published.model_copy(update={"mirrors": (str(shelf.mirror),)})
    assert fetch(entry, shelf.cache).stat().st_size == entry.bytes


def put_symbolic_link(part, victim):
    part.symlink_to(victim)


def put_hard_link(part, victim):
    part.hardlink_to(victim)


def put_fifo(part, victim):
    os.mkfifo(part)


def put_dangling_link(part, victim):
    part.symlink_to(victim.with_name("not-there"))


def put_folder(part, victim):
    part.mkdir()


@pytest.mark.parametrize("way", ["http", "folder"])
@pytest.mark.parametrize(
    "put", [put_symbolic_link, put_hard_link, put_fifo, put_dangling_link, put_folder]
)
def test_what_is_in_the_place_of_the_part_file_is_neither_followed_nor_waited_for(
    shelf, published, content, tmp_path, put, way
):
    victim = tmp_path / "victim"
    victim.write_bytes(b"precious")
    shelf.cache.mkdir()
    put(shelf.cache / f"{published.file}.part", victim)
    with serve(Mirror(content)) as mirror:
        shelf.use_mirror(mirror.address if way == "http" else shelf.mirror)
        assert fetch(published, shelf.cache).read_bytes() == content
    assert victim.read_bytes() == b"precious"
    assert sorted(os.listdir(shelf.cache)) == [published.file]
    assert not (tmp_path / "not-there").exists()


def test_a_link_in_the_place_of_the_file_itself_is_replaced(shelf, published, content, tmp_path):
    victim = tmp_path / "victim"
    victim.write_bytes(b"precious")
    shelf.cache.mkdir()
    (shelf.cache / published.file).symlink_to(victim)
    shelf.use_mirror(shelf.mirror)
    assert fetch(published, shelf.cache).read_bytes() == content
    assert victim.read_bytes() == b"precious"


@pytest.mark.parametrize("kind", ["file", "nobody", "too long", "below a file"])
def test_a_cache_variable_that_names_no_folder_is_one_sentence(
    shelf, records, tmp_path, monkeypatch, kind
):
    (tmp_path / "file").write_text("")
    names = {
        "file": tmp_path / "file",
        "nobody": "~nobody-at-all/x",
        "too long": "/tmp/" + "x" * 5000,
        "below a file": tmp_path / "file" / "x",
    }
    shelf.publish(records)
    monkeypatch.setenv("GRANBENCH_CACHE", str(names[kind]))
    shelf.use_mirror(shelf.mirror)
    with pytest.raises((ConfigurationError, DownloadError), match="GRANBENCH_CACHE"):
        dataset_file("synthetic")
    if kind in ("file", "nobody"):
        with pytest.raises(ConfigurationError, match="GRANBENCH_CACHE=.*cannot hold datasets"):
            cache_folder()


def test_the_package_with_the_data_is_found_where_it_is_installed(
    shelf, records, tmp_path, monkeypatch
):
    published = shelf.publish(records)
    content = (shelf.mirror / published.file).read_bytes()
    with pytest.raises(DownloadError, match="install the package granbench-data"):
        load("synthetic")
    package = tmp_path / "site" / "granbench_data"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / published.file).write_bytes(content[:-1] + b"?")
    monkeypatch.syspath_prepend(tmp_path / "site")
    with pytest.raises(DownloadError, match="granbench_data: its SHA-256 is"):
        load("synthetic")
    (package / published.file).write_bytes(content)
    with load("synthetic") as ds:
        assert ds.encoding["source"] == str(package / published.file)
