"""Reading of files from outside in a child process with bounds on memory and time.

A damaged or hostile file can make a library allocate memory without limit, loop forever or crash.
That cannot be checked beforehand, so such a file is opened in a process that the operating system
ends at the bound; the parent process continues and reports what happened.

One server process is started when first needed. It forks for every file, so that a read costs
milliseconds, and it ends with the process that started it.
"""

import atexit
import contextlib
import importlib
import json
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from granbench.errors import GranbenchError

LONGEST_READ = 60.0
"""Largest wall-clock time for reading a small file, seconds."""
LONGEST_COMPUTATION = 8.0
"""Largest processor time for reading a small file, seconds."""
SECONDS_PER_BYTE = 1e-5
"""Increase of both with the size of the file: 10 s per megabyte, far more than needed."""
MOST_MEMORY = 3 * 2**29
"""Memory in bytes that the process may allocate for one file, beyond that at its start; in total it
stays below 2 GB."""

P = ParamSpec("P")
T = TypeVar("T")

_BOOT = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from granbench.files.bounded_reading import serve; serve()"
)
_preparations: list[Callable[[], object]] = []
_lock = threading.Lock()
_server: tuple[int, "subprocess.Popen[bytes]"] | None = None
"""Number of the process that started the server (a fork must not share it), and the server."""


def prepare_server(function: Callable[[], object]) -> None:
    """Register a function that the server calls once, after importing the registering module.

    Modules that a library loads at its first use would otherwise be loaded again for every file.
    """
    _preparations.append(function)


def read_bounded(
    source: Path | str,
    error: type[GranbenchError],
    function: Callable[P, T],
    *arguments: P.args,
    **options: P.kwargs,
) -> T:
    """Call a function that reads a file in a child process with bounds on time and memory.

    The bounds are `LONGEST_READ` and `LONGEST_COMPUTATION`, both extended with the size of the file
    by `SECONDS_PER_BYTE`, and `MOST_MEMORY`.

    Parameters
    ----------
    source : the file, as errors name it; relative paths, here and among the arguments, begin at
        the working folder of this process
    error : type of the error for a file that exceeds a bound or makes the reader fail
    function : function at the top level of a module; the server imports the module once, so it
        should not need torch
    arguments, options : of the function; they and its result must be picklable

    Returns
    -------
    What the function returns

    Raises
    ------
    GranbenchError
        That of the function, of the same type and text; otherwise `error`, naming the source, if
        the function raises another exception, exceeds a bound or crashes.
    """
    request = pickle.dumps((function.__module__, function.__qualname__, arguments, options))
    handle, answer_file = tempfile.mkstemp(prefix="granbench-read-")
    os.close(handle)
    try:
        with _lock:
            outcome = _ask(answer_file, request, _size(source) * SECONDS_PER_BYTE)
        if outcome == "answered":
            with open(answer_file, "rb") as file:
                kind, answer = pickle.load(file)
            if kind == "returned":
                return answer
            if kind == "refused":
                raise answer
            outcome = answer
    finally:
        with contextlib.suppress(OSError):
            os.unlink(answer_file)
    raise error(f"{source}: cannot be read: {outcome}")


def _size(source: Path | str) -> int:
    try:
        return os.stat(source).st_size
    except (OSError, ValueError):
        return 0


def _ask(answer_file: str, request: bytes, extra: float) -> str:
    """Send one request to the server; returns ``answered``, or why there is no answer."""
    bounds = LONGEST_READ + extra, LONGEST_COMPUTATION + extra, MOST_MEMORY
    head = json.dumps([answer_file, len(request), os.getcwd(), *bounds]).encode()
    for attempt in (0, 1):
        server = _running_server()
        assert server.stdin is not None and server.stdout is not None
        try:
            server.stdin.write(head + b"\n" + request)
            server.stdin.flush()
            if line := server.stdout.readline():
                return json.loads(line)
        except BrokenPipeError:
            pass
        _stop()
        if attempt:
            break
    return "the process that reads files has ended twice; check the machine's memory and try again"


def _running_server() -> "subprocess.Popen[bytes]":
    global _server
    if _server is not None and _server[0] == os.getpid() and _server[1].poll() is None:
        return _server[1]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    process = subprocess.Popen(
        [sys.executable, "-c", _BOOT, json.dumps([entry or os.getcwd() for entry in sys.path])],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
        start_new_session=True,  # Ctrl-C goes to the parent process; its end closes the pipe
    )
    _server = os.getpid(), process
    return process


def _stop() -> None:
    global _server
    if _server is not None and _server[0] == os.getpid():
        process = _server[1]
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        process.kill()
        process.wait()
    _server = None


atexit.register(_stop)


def serve() -> None:
    """Answer requests on standard input until it closes: the main loop of the server."""
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    # Output of a library must not be mistaken for an answer.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    while line := requests.readline():
        answer_file, length, folder, *bounds = json.loads(line)
        with contextlib.suppress(OSError):
            os.chdir(folder)
        outcome = _serve_one(requests.read(length), answer_file, *bounds)
        answers.write(json.dumps(outcome).encode() + b"\n")
        answers.flush()


def _serve_one(
    request: bytes, answer_file: str, seconds: float, computation: float, memory: int
) -> str:
    with contextlib.suppress(Exception):
        # Imported before the fork, so that the libraries are loaded for the next file.
        importlib.import_module(pickle.loads(request)[0])
        while _preparations:
            _preparations.pop()()
    if not hasattr(os, "fork"):
        _answer(request, answer_file)
        return "answered"
    child = os.fork()
    if not child:
        code = 1
        try:
            signal.setitimer(signal.ITIMER_REAL, seconds)
            signal.setitimer(signal.ITIMER_PROF, computation)
            _bound_memory(memory)
            _answer(request, answer_file)
            code = 0
        finally:
            os._exit(code)
    status = os.waitpid(child, 0)[1]
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        if number == signal.SIGALRM:
            return f"it takes longer than {seconds:.3g} s; the file is damaged or too large"
        if number == signal.SIGPROF:
            return (
                f"it takes longer than {computation:.3g} s of computation; the file is damaged or "
                "too large"
            )
        name = signal.Signals(number).name
        return f"it ends the process that reads it ({name}); the file is damaged or too large"
    return "answered" if os.WEXITSTATUS(status) == 0 else _too_large(memory)


def _bound_memory(memory: int) -> None:
    import resource

    with contextlib.suppress(OSError, ValueError):
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        bound = pages * os.sysconf("SC_PAGE_SIZE") + memory
        resource.setrlimit(resource.RLIMIT_AS, (bound, bound))


def _answer(request: bytes, answer_file: str) -> None:
    """Call the requested function and write its result or error to the answer file."""
    module, name, arguments, options = pickle.loads(request)
    try:
        function: Any = importlib.import_module(module)
        for part in name.split("."):
            function = getattr(function, part)
        answer: tuple[str, Any] = "returned", function(*arguments, **options)
    except GranbenchError as refusal:
        answer = "refused", type(refusal)(str(refusal))
    except MemoryError:
        answer = "failed", _too_large(MOST_MEMORY)
    except Exception as problem:
        text = " ".join(str(problem).split())[:300]
        answer = (
            "failed",
            f"{type(problem).__name__}{f' ({text})' if text else ''}; the file is damaged or of "
            "another kind than its name",
        )
    try:
        _write(answer, answer_file)
    except MemoryError:
        _write(("failed", _too_large(MOST_MEMORY)), answer_file)


def _write(answer: tuple[str, Any], answer_file: str) -> None:
    with open(answer_file, "wb") as file:
        pickle.dump(answer, file, protocol=pickle.HIGHEST_PROTOCOL)


def _too_large(memory: int) -> str:
    return f"it needs more than {memory / 2**30:g} GiB of memory; the file is damaged or too large"
