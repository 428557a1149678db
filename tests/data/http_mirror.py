"""A real HTTP server on this machine that can misbehave like real ones."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


@dataclass
class Mirror:
    """What the server serves and how; `requests` lists the Range header of every request.

    Parameters
    ----------
    content : bytes of the file
    breaks_after : bytes after which each connection is cut, None for never
    ranges : whether it honours Range
    status : HTTP status of every answer instead of the file
    page : an HTML page with status 200 that it sends instead of the file
    length : whether it tells Content-Length
    """

    content: bytes
    breaks_after: int | None = None
    ranges: bool = True
    status: int | None = None
    page: bytes | None = None
    length: bool = True
    address: str = ""
    requests: list[str | None] = field(default_factory=list)


@contextmanager
def serve(mirror: Mirror) -> Iterator[Mirror]:
    """Serve until the block ends; `mirror.address` says where."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            span = self.headers.get("Range")
            mirror.requests.append(span)
            if mirror.status is not None:
                self.send_error(mirror.status)
                return
            body, start = mirror.content, 0
            kind = "application/x-netcdf"
            if mirror.page is not None:
                body, kind = mirror.page, "text/html; charset=utf-8"
            elif span and mirror.ranges:
                start = int(span.removeprefix("bytes=").removesuffix("-"))
            self.send_response(206 if start else 200)
            self.send_header("Content-Type", kind)
            if start:
                self.send_header("Content-Range", f"bytes {start}-{len(body) - 1}/{len(body)}")
            if mirror.length:
                self.send_header("Content-Length", str(len(body) - start))
            self.end_headers()
            self.wfile.write(body[start:][: mirror.breaks_after])

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    mirror.address = f"http://127.0.0.1:{server.server_address[1]}"
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield mirror
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
