"""Standard streams that never end a command: closed, full, broken or with a narrow encoding.

Cron jobs, daemons and pythonw run without streams; Windows gives pipes the encoding cp1252; a
reader such as ``head`` closes the pipe early. None of this ends a command before its files are
written.
"""

import io
import os
import select
import sys
from typing import Any, TextIO

STANDARD_STREAMS = ("stdin", "stdout", "stderr")


class _NeverFailing(io.RawIOBase):
    """Writes to a file descriptor; from its first failure on, everything is discarded.

    Attributes
    ----------
    failure : the system's first error, or None
    """

    def __init__(self, descriptor: int) -> None:
        super().__init__()
        self._descriptor = descriptor
        self.failure: OSError | None = None

    def writable(self) -> bool:
        """See `io.RawIOBase.writable`."""
        return True

    def fileno(self) -> int:
        """See `io.IOBase.fileno`."""
        return self._descriptor

    def isatty(self) -> bool:
        """See `io.IOBase.isatty`."""
        return os.isatty(self._descriptor)

    def write(self, written: Any) -> int:
        """See `io.RawIOBase.write`; never raises OSError."""
        block = bytes(written)
        while self.failure is None:
            try:
                return os.write(self._descriptor, block)
            except BlockingIOError:
                select.select([], [self._descriptor], [])
            except OSError as error:
                self.failure = error
        return len(block)


def prepare_streams() -> None:
    """Make the process's own standard streams safe to write to; replaced streams are left alone.

    A descriptor that is closed is opened on the null device: the next file that a command writes
    would get its number, and output printed by a library would go into that file.
    """
    for number, name in enumerate(STANDARD_STREAMS):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest free number, which is this one
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            # No context: the stream lives as long as the process.
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8", errors="replace"))  # noqa: SIM115
    for name in STANDARD_STREAMS[1:]:
        stream = getattr(sys, name)
        if stream is getattr(sys, f"__{name}__") and isinstance(stream, io.TextIOWrapper):
            setattr(sys, name, _safe(stream))


def _safe(stream: io.TextIOWrapper) -> TextIO:
    """A stream to the same place that replaces what it cannot encode and never raises."""
    stream.flush()
    raw = getattr(stream.buffer, "raw", stream.buffer)  # the buffer itself under `python -u`
    if type(raw) is not io.FileIO:  # a console of Windows, which takes every character
        stream.reconfigure(errors="replace")
        return stream
    return io.TextIOWrapper(
        io.BufferedWriter(_NeverFailing(raw.fileno())),
        encoding=stream.encoding,
        errors="replace",
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )


def flush_streams() -> OSError | None:
    """Write out what is buffered.

    Returns
    -------
    The error with which output was lost, or None. If a reader such as ``head -1`` closes the pipe
    early, this is not an error.
    """
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    failure = raw.failure if isinstance(raw, _NeverFailing) else None
    return None if isinstance(failure, BrokenPipeError) else failure


def shows_unicode(stream: TextIO | None = None) -> bool:
    """Whether a stream, by default standard output, can show every character."""
    encoding = getattr(stream or sys.stdout, "encoding", None) or "utf-8"
    return encoding.lower().replace("-", "").replace("_", "") in ("utf8", "utf16", "utf32")
