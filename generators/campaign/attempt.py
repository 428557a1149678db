"""One attempt at one campaign job: its process, how it ended, and its files."""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import uuid
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from granbench.generators.campaign.folder import publish, run_is_open

CHECK_INTERVAL = 0.2
EXPLAIN_TIME = 60.0
MESSAGE_LENGTH = 2000
LEAST_FREE_BYTES = 1 << 20


@dataclass(frozen=True)
class Request:
    """One attempt at one job, as a worker receives it.

    Parameters
    ----------
    key, slug, digest : name of the job, its name as a folder, and the hash of its settings
    job : `function`, `configuration`, `seed` of the job, plain JSON values
    inputs : result folder of each job that this one needs, by key
    run : folder of the run; the attempt stops when the run is closed
    results : folder into which the result is moved
    """

    key: str
    slug: str
    digest: str
    job: dict[str, Any]
    inputs: dict[str, str]
    run: Path
    results: Path


@dataclass(frozen=True)
class Outcome:
    """How an attempt ended.

    Parameters
    ----------
    kind : `done`; `failed`: the job's function raised an exception; `killed`: its process ended
        without a reason given by the job itself, so that another attempt may succeed; `closed`:
        the worker does not see the run's folder, or the run was closed; `blocked`: the machine
        cannot go on, for example because its disk is full
    reason : one sentence, empty when done
    seconds : wall-clock time of the attempt
    messages : the end of what the job's process wrote to its standard output and error
    permanent : whether the job itself declared its failure, so that every further attempt would
        fail in the same way
    """

    kind: Literal["done", "failed", "killed", "closed", "blocked"]
    reason: str = ""
    seconds: float = 0.0
    messages: str = ""
    permanent: bool = False


def run_attempt(request: Request) -> Outcome:
    """Run one job in a new process, and publish its files when it succeeds.

    This function runs on the worker. It returns when the job has ended, or soon after the run was
    closed; no process of the job is left then.

    Parameters
    ----------
    request : the job and its folders
    """
    started = time.perf_counter()
    # Every attempt has its own name: two workers may run the same job for a while when the
    # scheduler has lost the connection to one of them.
    attempt = request.run / f"{request.slug}.{uuid.uuid4().hex[:8]}"
    try:
        if not run_is_open(request.run):
            return Outcome("closed", f"the worker does not see {request.run}")
        (attempt / "out").mkdir(parents=True)
        status = _run_process(request, attempt, explain=False)
        seconds = time.perf_counter() - started
        if not run_is_open(request.run):
            return Outcome("closed", "the campaign was stopped")
        outcome = _judge(request, attempt, status, seconds)
        if outcome.kind == "done":
            record = {
                "key": request.key,
                "digest": request.digest,
                "needs": sorted(request.inputs),
                "seconds": round(seconds, 3),
                "messages": outcome.messages,
                **request.job,
            }
            publish(attempt / "out", request.results, request.slug, record)
        return outcome
    except OSError as error:
        return Outcome("blocked", f"{error.strerror or error} ({error.filename or attempt})")
    finally:
        shutil.rmtree(attempt, ignore_errors=True)


def _judge(request: Request, attempt: Path, status: int, seconds: float) -> Outcome:
    written = _read_outcome(attempt)
    messages = _last_messages(attempt / "stderr.txt")
    if status == 0 and written is not None:
        return Outcome("done", seconds=seconds, messages=messages)
    full = shutil.disk_usage(request.run).free < LEAST_FREE_BYTES
    if full or (written is not None and written.get("cause") == "disk"):
        return Outcome("blocked", f"no space is left on the disk of {request.run}")
    if status < 0:
        reason = f"its process was ended by {_signal_name(-status)}"
        return Outcome("killed", reason, seconds, messages)
    if written is not None and written["error"] is not None:
        return _judge_exception(request, written, seconds, messages)
    # The process ended without an exception. Either a library ended it and gives the reason in its
    # log, or the cause is outside, such as a helper process that was killed.
    _run_process(request, attempt, explain=True)
    explained = _read_outcome(attempt) or {}
    if explained.get("explanation"):
        reason = " ".join(explained["explanation"].split())
        return Outcome("failed", reason, seconds, messages, permanent=True)
    reason = explained.get("error") or (
        f"its process ended with exit code {status} before the job was finished"
    )
    return Outcome("killed", reason, seconds, messages)


def _judge_exception(
    request: Request, written: dict[str, Any], seconds: float, messages: str
) -> Outcome:
    reason, cause = written["error"], written["cause"]
    if cause == "code":
        return Outcome("blocked", f"{reason} (in {request.job['function']})")
    if cause in ("memory", "system"):
        return Outcome("killed", reason, seconds, messages)
    return Outcome("failed", reason, seconds, messages, permanent=cause == "permanent")


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # real-time signals have no names of their own
        return f"signal {number}"


def _run_process(request: Request, attempt: Path, *, explain: bool) -> int:
    """Return the exit status of the job's process, negative for a signal."""
    line = json.dumps(
        {
            **request.job,
            "inputs": request.inputs,
            "out": os.fspath(attempt / "out"),
            "outcome": os.fspath(attempt / "outcome.json"),
            "explain": explain,
        }
    )
    # One thread per job, because the workers share the cores; a fixed hash seed, because a result
    # must not depend on the order of a set.
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}
    if "PYTHONPATH" in environment:
        # The process starts in the attempt's folder, so that stray files of a library stay there.
        entries = environment["PYTHONPATH"].split(os.pathsep)
        environment["PYTHONPATH"] = os.pathsep.join(map(os.path.abspath, entries))
    with open(attempt / "stderr.txt", "ab") as messages:
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "granbench.generators.campaign.job_process"],
            stdin=subprocess.PIPE,
            stdout=messages,
            stderr=messages,
            cwd=attempt,
            env=environment,
            start_new_session=True,
        )
    assert process.stdin is not None
    deadline = time.monotonic() + EXPLAIN_TIME if explain else float("inf")
    try:
        with contextlib.suppress(BrokenPipeError):
            process.stdin.write(line.encode() + b"\n")
            process.stdin.flush()
        while run_is_open(request.run) and time.monotonic() < deadline:
            with contextlib.suppress(subprocess.TimeoutExpired):
                return process.wait(CHECK_INTERVAL)
    finally:
        # The whole process group, which includes processes that the job has started.
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        with contextlib.suppress(BrokenPipeError):
            process.stdin.close()
    return process.returncode


def _read_outcome(attempt: Path) -> dict[str, Any] | None:
    try:
        return json.loads((attempt / "outcome.json").read_text())
    except (OSError, ValueError):
        return None


def _last_messages(path: Path) -> str:
    with open(path, "rb") as messages:
        messages.seek(0, os.SEEK_END)
        messages.seek(max(0, messages.tell() - MESSAGE_LENGTH))
        return messages.read().decode(errors="replace")
