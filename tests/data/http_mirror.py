"""A real HTTP server on this machine that can misbehave like real ones."""

import contextlib
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


@dataclass
class Mirror:
    """Content and behaviour of the server; `requests` lists the Range header of every request.

    Parameters
    ----------
    content : bytes of the file
    breaks_after : bytes after which each connection is cut, None for never
    ranges : whether it honours Range
    status : HTTP status of every answer instead of the file
    page : an HTML page with status 200 that it sends instead of the file
    length : whether it tells Content-Length
    headers : further headers, or other values of Content-Length and Content-Range
    pause : seconds between the single bytes of `drips`
    drips : `headers` or `body`, which it sends byte by byte; None for at once
    """

    content: bytes
    breaks_after: int | None = None
    ranges: bool = True
    status: int | None = None
    page: bytes | None = None
    length: bool = True
    headers: tuple[tuple[str, str], ...] = ()
    pause: float = 0.05
    drips: str | None = None
    address: str = ""
    requests: list[str | None] = field(default_factory=list)


@contextmanager
def serve(mirror: Mirror) -> Iterator[Mirror]:
    """Serve until the block ends; `mirror.address` says where."""

    stopped = threading.Event()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            span = self.headers.get("Range")
            mirror.requests.append(span)
            if mirror.status is not None:
                self.send_response(mirror.status)
                for name, text in mirror.headers:
                    self.send_header(name, text)
                self.end_headers()
                return
            body, start = mirror.content, 0
            kind = "application/x-netcdf"
            if mirror.page is not None:
                body, kind = mirror.page, "text/html; charset=utf-8"
            elif span and mirror.ranges:
                start = int(span.removeprefix("bytes=").removesuffix("-"))
            self.send_response(206 if start else 200)
            self.send_header("Content-Type", kind)
            own = {name for name, _ in mirror.headers}
            if start and "Content-Range" not in own:
                self.send_header("Content-Range", f"bytes {start}-{len(body) - 1}/{len(body)}")
            if mirror.length and "Content-Length" not in own:
                self.send_header("Content-Length", str(len(body) - start))
            for name, text in mirror.headers:
                self.send_header(name, text)
            if mirror.drips == "headers":
                self.drip(b"X-Slow: " + b"x" * 5000)
            self.end_headers()
            sent = body[start:][: mirror.breaks_after]
            self.drip(sent) if mirror.drips == "body" else self.wfile.write(sent)

        def drip(self, content: bytes) -> None:
            self.flush_headers()
            with contextlib.suppress(OSError):
                for place in range(len(content)):
                    if stopped.is_set():
                        return
                    self.wfile.write(content[place : place + 1])
                    self.wfile.flush()
                    time.sleep(mirror.pause)

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    mirror.address = f"http://127.0.0.1:{server.server_address[1]}"
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield mirror
    finally:
        stopped.set()
        server.shutdown()
        server.server_close()
        thread.join()
