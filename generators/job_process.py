"""The process of one campaign job: ``python -m granbench.generators.job_process``.

It takes one line of JSON on its standard input, calls the job's function and writes how that
went to ``outcome.json``. The input stays open as a lifeline: when the process that started this
one dies, by SIGKILL too, it closes, and this process ends with all that it has started.
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
    """Return an exception's text on one line, with its type unless the text is for users."""
    text = " ".join(str(error).split())
    if isinstance(error, GranbenchError) and text:
        return text
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def main() -> int:
    """Run the requested job and return the exit status of this process."""
    request, lifeline = _read_request()
    threading.Thread(target=_end_with_parent, args=(lifeline,), daemon=True).start()
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
        elif cause == "job" and isinstance(error, getattr(job_module, "PHYSICAL_FAILURES", ())):
            cause = "physics"
        outcome = {"error": one_sentence(error), "cause": cause}
        traceback.print_exc()
    Path(request["outcome"]).write_text(json.dumps(outcome))
    return 0 if outcome["error"] is None else EXCEPTION_EXIT


def _read_request() -> tuple[dict[str, Any], int]:
    # The lifeline leaves descriptor 0, so that no program which the job starts reads from it.
    lifeline = os.dup(0)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    line = b""
    while not line.endswith(b"\n"):
        piece = os.read(lifeline, 1 << 16)
        if not piece:
            sys.exit("the process that started this job has ended")
        line += piece
    return json.loads(line), lifeline


def _end_with_parent(lifeline: int) -> None:
    os.read(lifeline, 1)
    # The workers start this process as the head of its own group (a new session).
    os.killpg(os.getpid(), signal.SIGKILL)


if __name__ == "__main__":
    sys.exit(main())
