"""From a mirror to this machine: resumed where it broke off, checked, and renamed when whole."""

import contextlib
import errno
import http.client
import os
import shutil
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NoReturn

import pooch

from granbench.data.registry import RegistryEntry
from granbench.errors import DownloadError

MINI_FOLDER = Path(__file__).parent / "mini"
"""The mini tier, inside the wheel."""
MIRROR_VARIABLE = "GRANBENCH_MIRROR"
CHUNK = 1 << 18
TIMEOUT = 30.0
"""Seconds without a byte after which a connection counts as lost."""
ATTEMPTS = 4
"""Connections that may break in a row before a mirror is given up."""
PAUSE = 0.5
"""Seconds before the second connection; each further one waits twice as long."""
NETCDF4_SIGNATURE = b"\x89HDF\r\n\x1a\n"

Progress = Callable[[int, int], None]
"""Called with the bytes so far and the bytes in all."""


class _MirrorFailure(Exception):
    """This mirror cannot give the file; another one may."""


def checkout_datasets() -> Path | None:
    """The `datasets` folder of the checkout that this package runs from, if it is one."""
    root = Path(__file__).resolve().parents[2]
    # Beside an installed wheel a folder `datasets` is somebody else's package.
    is_checkout = (root / "pyproject.toml").is_file() and (root / "datasets").is_dir()
    return root / "datasets" if is_checkout else None


def folders_of(entry: RegistryEntry) -> list[Path]:
    """Folders of this installation that may hold the file: checkout, and wheel for `mini`."""
    found = [MINI_FOLDER] if entry.tier == "mini" else []
    return [*found, folder] if (folder := checkout_datasets()) else found


def mirrors_of(entry: RegistryEntry) -> list[str]:
    """Folders and addresses that may hold the file, in the order in which they are tried."""
    found = [str(folder) for folder in folders_of(entry)]
    if chosen := os.environ.get(MIRROR_VARIABLE):
        found.append(chosen)
    return [*found, *entry.mirrors]


def why_not(path: Path, entry: RegistryEntry) -> str | None:
    """What is wrong with a file that should be the entry's; None if nothing is."""
    if not path.is_file():
        return "the file is not there"
    if (size := path.stat().st_size) != entry.bytes:
        return f"the file has {size} bytes instead of {entry.bytes}"
    if (digest := pooch.file_hash(str(path), alg="sha256")) != entry.sha256:
        return f"its SHA-256 is {digest[:12]}... instead of the registered {entry.sha256[:12]}..."
    return None


def fetch(
    entry: RegistryEntry,
    folder: Path,
    progress: Progress | None = None,
    also_in: Iterable[Path] = (),
) -> Path:
    """Bring a dataset's file into a folder, unless it is there already.

    The bytes go to a `.part` file, which a later call continues, and get the final name only
    when size and SHA-256 agree with the registry.

    Parameters
    ----------
    entry : the dataset
    folder : where to put it; made when missing
    progress : called after every piece
    also_in : folders that may already hold it, such as the cache

    Returns
    -------
    path of the file

    Raises
    ------
    DownloadError
        If the folder cannot be written or is full, or no mirror gives the registered file; the
        text says what each of them gave.
    """
    target = folder / entry.file
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with _one_at_a_time(folder):
            if why_not(target, entry) is None:
                return target
            held = [str(f) for f in also_in if why_not(f / entry.file, entry) is None]
            _fetch_from_any([*held, *mirrors_of(entry)], entry, target, progress)
    except OSError as error:
        _local_failure(target, error)
    return target


def _fetch_from_any(
    mirrors: list[str], entry: RegistryEntry, target: Path, progress: Progress | None
) -> None:
    partial = target.with_name(target.name + ".part")
    failures = []
    for mirror in mirrors:
        try:
            if mirror.startswith(("http://", "https://")):
                _download(f"{mirror.rstrip('/')}/{entry.file}", entry, partial, progress)
            elif "://" in mirror:
                raise _MirrorFailure("only folders and http(s) addresses can be mirrors")
            else:
                _copy(Path(mirror).expanduser() / entry.file, entry, partial, progress)
        except _MirrorFailure as failure:
            failures.append(f"{mirror}: {failure}")
            continue
        os.replace(partial, target)
        return
    tried = "; ".join(failures) or "there is no mirror to ask"
    raise DownloadError(
        f"{entry.file} could not be fetched ({tried}); set {MIRROR_VARIABLE} to a folder or "
        "address that holds it, or try again later"
    )


@contextlib.contextmanager
def _one_at_a_time(folder: Path) -> Iterator[None]:
    """Keep two processes from writing one `.part` file, where the system has locks."""
    try:
        import fcntl
    except ImportError:  # Windows
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):  # a network folder may know no locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _local_failure(path: Path, error: OSError) -> NoReturn:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        path.with_name(path.name + ".part").unlink(missing_ok=True)
        raise DownloadError(
            f"{path}: the disk is full; free some space or choose another folder with --dest"
        ) from error
    raise DownloadError(
        f"{path}: cannot be written ({error.strerror or error}); choose a folder that is "
        "writable with --dest, or set GRANBENCH_CACHE to one"
    ) from error


def _copy(source: Path, entry: RegistryEntry, partial: Path, progress: Progress | None) -> None:
    # Checked before it is copied: a wrong file in the checkout costs no disk space.
    if reason := why_not(source, entry):
        raise _MirrorFailure(reason)
    try:
        shutil.copyfile(source, partial)
    except OSError:
        partial.unlink(missing_ok=True)
        raise
    if progress:
        progress(entry.bytes, entry.bytes)


def _download(address: str, entry: RegistryEntry, partial: Path, progress: Progress | None) -> None:
    """Continue `partial` until it is the entry's file, or raise `_MirrorFailure`."""
    resumed = partial.exists()
    _download_all(address, entry, partial, progress)
    reason = why_not(partial, entry)
    if reason and resumed:
        # What was left over may be of another mirror's making: once more from the beginning.
        partial.unlink()
        _download_all(address, entry, partial, progress)
        reason = why_not(partial, entry)
    if reason:
        partial.unlink()
        raise _MirrorFailure(reason)


def _download_all(
    address: str, entry: RegistryEntry, partial: Path, progress: Progress | None
) -> None:
    broken = 0
    while (done := _size(partial)) < entry.bytes:
        try:
            _continue(address, entry, partial, progress)
            reason = "the connection ended early"
        except urllib.error.HTTPError as error:
            with error:
                if error.code < 500 and error.code not in (408, 429):
                    raise _MirrorFailure(f"HTTP status {error.code} {error.reason}") from error
            reason = f"HTTP status {error.code} {error.reason}"
        except (urllib.error.URLError, http.client.HTTPException, _ConnectionLost) as error:
            reason = str(getattr(error, "reason", error))
        broken = 0 if _size(partial) > done else broken + 1
        if broken == ATTEMPTS:
            raise _MirrorFailure(
                f"{reason} after {_size(partial)} of {entry.bytes} bytes, which are kept: fetch "
                "again to continue"
            )
        if broken:
            time.sleep(PAUSE * 2 ** (broken - 1))


class _ConnectionLost(Exception):
    """The network failed while reading; kept apart from failures to write on this machine."""


def _size(partial: Path) -> int:
    return partial.stat().st_size if partial.exists() else 0


def _continue(address: str, entry: RegistryEntry, partial: Path, progress: Progress | None) -> None:
    """One connection: append what the server sends to `partial`."""
    start = _size(partial)
    request = urllib.request.Request(address, headers={"User-Agent": "granbench"})
    if start:
        request.add_header("Range", f"bytes={start}-")
    with _connect(request) as response:
        if start and response.status != 206:
            start = 0  # the server knows no ranges and sends the whole file again
        _check_answer(response, entry, start)
        piece = _receive(response)
        if not start and not piece.startswith(NETCDF4_SIGNATURE[: len(piece)]):
            raise _MirrorFailure("the server sent something that is not a netCDF file")
        # Opened only now: what was kept is not given up for an answer that is no file.
        with partial.open("ab" if start else "wb") as file:
            while piece:
                start += len(piece)
                if start > entry.bytes:
                    raise _MirrorFailure(f"the server's file has more than {entry.bytes} bytes")
                file.write(piece)
                if progress:
                    progress(start, entry.bytes)
                piece = _receive(response)


def _connect(request: urllib.request.Request) -> http.client.HTTPResponse:
    try:
        return urllib.request.urlopen(request, timeout=TIMEOUT)
    except urllib.error.URLError:
        raise
    except OSError as error:
        raise _ConnectionLost(error.strerror or str(error)) from error


def _receive(response: http.client.HTTPResponse) -> bytes:
    try:
        return response.read1(CHUNK)
    except OSError as error:
        raise _ConnectionLost(error.strerror or str(error)) from error


def _check_answer(response: http.client.HTTPResponse, entry: RegistryEntry, start: int) -> None:
    if response.headers.get_content_type() == "text/html":
        raise _MirrorFailure("the server sent a web page instead of the file")
    span = response.headers.get("Content-Range", "")
    if start and not span.startswith(f"bytes {start}-"):
        raise _MirrorFailure(f"the server continued at {span!r} instead of byte {start}")
    length = response.headers.get("Content-Length")
    if length is not None and start + int(length) != entry.bytes:
        raise _MirrorFailure(
            f"the server's file has {start + int(length)} bytes instead of {entry.bytes}"
        )
