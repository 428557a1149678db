"""The process of one campaign job: ``python -m granbench.generators.campaign.job_process``.

It reads one line of JSON from its standard input, calls the job's function and writes the outcome
to ``outcome.json``. The standard input stays open: it closes when the parent process dies, even by
SIGKILL, and this process then ends together with all processes that it has started.
"""

import errno
import importlib
import json
import os
import signal
import sys
import threading
import traceback
from pathlib import Path
from typing import Any

from granbench.errors import GranbenchError

EXCEPTION_EXIT = 3
FULL_DISK = (errno.ENOSPC, errno.EDQUOT)


def one_sentence(error: BaseException) -> str:
    """Return the text of an exception on one line, with its type unless it is GranBench's own."""
    text = " ".join(str(error).split())
    if isinstance(error, GranbenchError) and text:
        return text
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def main() -> int:
    """Run the requested job and return the exit status of this process."""
    request, parent_pipe = _read_request()
    threading.Thread(target=_end_with_parent, args=(parent_pipe,), daemon=True).start()
    outcome: dict[str, Any] = {"error": None}
    cause = "code"
    try:
        module, _, name = request["function"].partition(":")
        job_module = importlib.import_module(module)
        function = getattr(job_module, name)
        cause = "job"
        if request["explain"]:
            failure_reason = getattr(job_module, "failure_reason", lambda out: None)
            outcome["explanation"] = failure_reason(Path(request["out"]))
        else:
            inputs = {key: Path(folder) for key, folder in request["inputs"].items()}
            function(request["configuration"], request["seed"], inputs, Path(request["out"]))
    except Exception as error:
        if isinstance(error, MemoryError):
            cause = "memory"
        elif isinstance(error, OSError) and error.errno in FULL_DISK:
            cause = "disk"
        elif isinstance(error, OSError) and cause == "job":
            cause = "system"
        elif cause == "job" and isinstance(error, getattr(job_module, "PERMANENT_FAILURES", ())):
            cause = "permanent"
        outcome = {"error": one_sentence(error), "cause": cause}
        traceback.print_exc()
    Path(request["outcome"]).write_text(json.dumps(outcome))
    return 0 if outcome["error"] is None else EXCEPTION_EXIT


def _read_request() -> tuple[dict[str, Any], int]:
    # The pipe leaves descriptor 0, so that no program which the job starts reads from it.
    parent_pipe = os.dup(0)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    line = b""
    while not line.endswith(b"\n"):
        piece = os.read(parent_pipe, 1 << 16)
        if not piece:
            sys.exit("the process that started this job has ended")
        line += piece
    return json.loads(line), parent_pipe


def _end_with_parent(parent_pipe: int) -> None:
    os.read(parent_pipe, 1)
    # The workers start this process as the leader of its own process group (a new session).
    os.killpg(os.getpid(), signal.SIGKILL)


if __name__ == "__main__":
    sys.exit(main())
