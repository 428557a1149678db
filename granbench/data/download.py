"""Download of one file over HTTP: resumed, bounded in time and size, and checked.

The answers of a server are not trusted: lengths, ranges and redirections are compared with the
registry, and a server that is too slow is given up.
"""

import contextlib
import http.client
import queue
import re
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import tenacity

from granbench.data.partial_file import discard, open_partial, partial_size

CHUNK = 1 << 18
TIMEOUT = 30.0
"""Seconds without a byte after which a connection counts as lost."""
ATTEMPTS = 4
"""Connections in a row without new bytes after which a mirror is given up."""
CONNECTIONS = 100
"""Connections in total, for a server that sends a few bytes in each."""
PAUSE = 0.5
"""Seconds before the second connection; the pause doubles with each further one."""
SLOW_WINDOW = 30.0
"""Seconds over which the rate is measured, including the time to connect."""
SLOWEST_RATE = 1000.0
"""Bytes a second below which a mirror is given up."""
WORDS = 160
"""Largest number of characters quoted from a server in an error."""
NETCDF4_SIGNATURE = b"\x89HDF\r\n\x1a\n"

OnBytes = Callable[[int, int], None]
"""Called with the bytes so far and the bytes in total."""
Check = Callable[[Path], str | None]
"""Returns what is wrong with a complete file; None if nothing is."""


class MirrorFailure(Exception):
    """This mirror cannot provide the file; another one may."""


class _ConnectionLost(Exception):
    """The network failed while reading; kept apart from failures to write on this machine."""


def download(
    address: str, size: int, partial: Path, why_not: Check, progress: OnBytes | None
) -> None:
    """Continue `partial` until it is the complete file.

    Parameters
    ----------
    address : http or https
    size : bytes of the whole file
    partial : the `.part` file
    why_not : returns what is wrong with a complete file
    progress : called after every piece

    Raises
    ------
    MirrorFailure
        If this server does not provide the file; the bytes so far are kept if they may be right.
    OSError
        If the file cannot be written.
    """
    resumed = partial_size(partial) > 0
    _download_all(address, size, partial, progress)
    reason = why_not(partial)
    if reason and resumed:
        # The bytes from before may belong to another file: once more from the beginning.
        discard(partial)
        _download_all(address, size, partial, progress)
        reason = why_not(partial)
    if reason:
        discard(partial)
        raise MirrorFailure(reason)


def _download_all(address: str, size: int, partial: Path, progress: OnBytes | None) -> None:
    """Connect again and again until `partial` is complete, or no connection adds to it."""
    rate, stalls = _Rate(), _Stalls(partial)
    retrying = tenacity.Retrying(
        retry=tenacity.retry_if_exception_type(_ConnectionLost),
        after=stalls.count,
        wait=stalls.pause,
        stop=lambda state: stalls.are_too_many or state.attempt_number >= CONNECTIONS,
        reraise=True,
    )
    try:
        retrying(_continue, address, size, partial, rate, progress)
    except _ConnectionLost as lost:
        gave_up = f"{CONNECTIONS} connections broke"
        reason = lost if stalls.are_too_many else gave_up
        raise MirrorFailure(f"{reason} {_kept(partial, size)}") from lost


class _Stalls:
    """Counts the connections in a row that added nothing to the `.part` file."""

    def __init__(self, partial: Path) -> None:
        self._partial = partial
        self._size = partial_size(partial)
        self._count = 0

    def count(self, _: object) -> None:
        """Take a broken connection into account."""
        size = partial_size(self._partial)
        self._count = 0 if size > self._size else self._count + 1
        self._size = size

    def pause(self, _: object) -> float:
        """Seconds before the next connection."""
        return PAUSE * 2 ** (self._count - 1) if self._count else 0.0

    @property
    def are_too_many(self) -> bool:
        """Whether the mirror is given up."""
        return self._count >= ATTEMPTS


def _kept(partial: Path, size: int) -> str:
    return f"after {partial_size(partial)} of {size} bytes, which are kept: fetch again to continue"


class _Rate:
    """Bytes received in windows of time, over all connections to a mirror."""

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._received = 0

    def add(self, count: int) -> None:
        self._received += count

    def left(self) -> float:
        """Seconds until the rate is judged; a new window begins after one that was fast enough."""
        left = self._began + SLOW_WINDOW - time.monotonic()
        if left <= 0 and self._received >= SLOWEST_RATE * SLOW_WINDOW:
            self.__init__()  # type: ignore[misc]
            return SLOW_WINDOW
        return left


def _continue(
    address: str, size: int, partial: Path, rate: _Rate, progress: OnBytes | None
) -> None:
    """One connection: append what the server sends to `partial`; _ConnectionLost if it breaks."""
    start = partial_size(partial)
    if start >= size:
        return
    with contextlib.closing(_pieces(address, size, start, partial, rate)) as pieces:
        start = next(pieces)
        piece = next(pieces, b"")
        if not start and not piece.startswith(NETCDF4_SIGNATURE[: len(piece)]):
            raise MirrorFailure("the server sent something that is not a netCDF file")
        if not piece:
            raise _ConnectionLost("the connection ended early")
        # Opened only now: an answer that is not a file must not destroy the bytes so far.
        with open_partial(partial, keep=start > 0) as file:
            while piece:
                start += len(piece)
                if start > size:
                    raise MirrorFailure(f"the server's file has more than {size} bytes")
                file.write(piece)
                if progress:
                    progress(start, size)
                piece = next(pieces, b"")
    if start < size:
        raise _ConnectionLost("the connection ended early")


def _pieces(
    address: str, size: int, start: int, partial: Path, rate: _Rate
) -> Generator[Any, None, None]:
    """The byte that the server starts from, then the content, piece by piece.

    The connection runs in a thread: a server may send its headers slowly, byte by byte, and a name
    server may be slow as well, and no time limit of a socket covers that.
    """
    received: queue.Queue[object] = queue.Queue(maxsize=4)
    given_up = threading.Event()
    threading.Thread(
        target=_receive, args=(address, size, start, received, given_up), daemon=True
    ).start()
    try:
        while True:
            left = rate.left()
            if left <= 0:
                raise MirrorFailure(
                    f"the server sent less than {SLOWEST_RATE:g} bytes a second for "
                    f"{SLOW_WINDOW:g} s {_kept(partial, size)}"
                )
            try:
                item = received.get(timeout=left)
            except queue.Empty:
                continue
            if item is None:
                return
            if isinstance(item, Exception):
                raise item
            if isinstance(item, bytes):
                rate.add(len(item))
            yield item
    finally:
        given_up.set()


def _receive(
    address: str, size: int, start: int, received: queue.Queue, given_up: threading.Event
) -> None:
    """Put the results of a connection into a queue: first byte, pieces, and None or an error."""

    def hand_over(item: object) -> bool:
        while not given_up.is_set():
            with contextlib.suppress(queue.Full):
                received.put(item, timeout=0.2)
                return True
        return False

    try:
        with _connect(address, start) as response:
            place = start if response.status == 206 else 0
            _check_answer(response, size, place)
            going = hand_over(place)
            while going and (piece := response.read1(CHUNK)):
                going = hand_over(piece)
        hand_over(None)
    except MirrorFailure as failure:
        hand_over(failure)
    except urllib.error.HTTPError as error:
        with error:
            reason = f"HTTP status {error.code} {plain(error.reason)}".rstrip()
        temporary = error.code >= 500 or error.code in (408, 429)
        hand_over(_ConnectionLost(reason) if temporary else MirrorFailure(reason))
    except (http.client.InvalidURL, ValueError) as error:
        # For an address such as http://[::1, of the server or of a redirection.
        hand_over(MirrorFailure(f"not an address of a file ({plain(error)})"))
    except (OSError, http.client.HTTPException) as error:
        text = getattr(error, "reason", None) or getattr(error, "strerror", None) or error
        hand_over(_ConnectionLost(plain(text) or type(error).__name__))
    except Exception as error:  # any other error that an answer causes is the mirror's fault
        hand_over(MirrorFailure(plain(f"{type(error).__name__}: {error}")))


class _WebRedirects(urllib.request.HTTPRedirectHandler):
    """Allows redirections to web addresses only: urllib itself would follow one to ftp."""

    def redirect_request(self, req, fp, code, msg, headers, newurl):
        if not newurl.lower().startswith(("http://", "https://")):
            raise MirrorFailure(f"the server redirects to {plain(newurl)}, which is no web page")
        return super().redirect_request(req, fp, code, msg, headers, newurl)


def _connect(address: str, start: int) -> http.client.HTTPResponse:
    request = urllib.request.Request(address, headers={"User-Agent": "granbench"})
    if start:
        request.add_header("Range", f"bytes={start}-")
    return urllib.request.build_opener(_WebRedirects).open(request, timeout=TIMEOUT)


def _check_answer(response: http.client.HTTPResponse, size: int, start: int) -> None:
    """Compare the announced file with the requested one before anything is read."""
    if response.status not in (200, 206):
        raise MirrorFailure(f"HTTP status {response.status} {plain(response.reason)}".rstrip())
    if response.headers.get_content_type() == "text/html":
        raise MirrorFailure("the server sent a web page instead of the file")
    if response.status == 206:
        span = ", ".join(response.headers.get_all("Content-Range", []))
        wanted = rf"bytes {start}-{size - 1}/({size}|\*)"
        if not re.fullmatch(wanted, span.strip()):
            raise MirrorFailure(
                f"the server sends the range {plain(span)!r} instead of bytes {start} to "
                f"{size - 1} of {size}"
            )
    if "chunked" in response.headers.get("Transfer-Encoding", "").lower():
        return  # a length header has no meaning then
    lengths = {length.strip() for length in response.headers.get_all("Content-Length", [])}
    if not lengths:
        return
    length = lengths.pop()
    if lengths or not re.fullmatch(r"[0-9]{1,18}", length):
        announced = ", ".join(sorted({length, *lengths}))
        raise MirrorFailure(f"the server gives {plain(announced)!r} as the length of the file")
    if start + int(length) != size:
        raise MirrorFailure(f"the server's file has {start + int(length)} bytes instead of {size}")


def plain(words: object) -> str:
    """Text from outside for an error: one line, printable, and short."""
    text = "".join(character if character.isprintable() else " " for character in str(words))
    text = " ".join(text.split())
    return text if len(text) <= WORDS else text[:WORDS] + "..."
