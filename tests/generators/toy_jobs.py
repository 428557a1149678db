"""Jobs for the tests of the campaign executor: small and deterministic, or faulty on purpose."""

import builtins
import ctypes
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from granbench.errors import EngineError

Configuration = Mapping[str, Any]
Inputs = Mapping[str, Path]


def walk(configuration: Configuration, seed: int, inputs: Inputs, out: Path) -> None:
    """Write a random walk that starts from the sum of the ends of the needed walks."""
    place = sum(float(walk_of(inputs[key])[-1]) for key in sorted(inputs))
    rng = random.Random(seed)
    print("output that must not reach the terminal")
    print("a warning that must not reach the terminal", file=sys.stderr)
    places = []
    for _ in range(configuration["steps"]):
        place += rng.gauss(0.0, 1.0)
        places.append(place)
    (out / "walk.txt").write_text("\n".join(map(repr, places)))
    (out / "notes").mkdir()
    (out / "notes" / "order.txt").write_text(" ".join({"a", "b", "c", "d"}))


def walk_of(result: Path) -> list[float]:
    """Return the positions of a finished walk."""
    return [float(line) for line in (result / "walk.txt").read_text().splitlines()]


PERMANENT_FAILURES = (EngineError,)


def _called_too_early(configuration: Configuration) -> bool:
    """Whether this is one of the first `times` calls, as counted in a file."""
    count = Path(configuration["count"])
    calls = int(count.read_text()) if count.exists() else 0
    count.write_text(str(calls + 1))
    return calls < configuration["times"]


def killed_at_first(configuration: Configuration, seed: int, inputs: Inputs, out: Path) -> None:
    """Kill its own process with the named signal, the first `times` times."""
    if _called_too_early(configuration):
        (out / "half.txt").write_text("half")
        os.kill(os.getpid(), getattr(signal, configuration["signal"]))
        time.sleep(10.0)
    (out / "whole.txt").write_text("whole")


def loses_its_helper(configuration: Configuration, seed: int, inputs: Inputs, out: Path) -> None:
    """Start a helper process, and end without an exception when it dies, as MPI does."""
    early = _called_too_early(configuration)
    helper = subprocess.Popen(["sleep", "60" if early else "0"])
    if early:
        (out / "half.txt").write_text("half")
        helper.kill()
    if helper.wait():
        ctypes.CDLL(None).exit(1)
    (out / "whole.txt").write_text("whole")


def raises_at_first(configuration: Configuration, seed: int, inputs: Inputs, out: Path) -> None:
    """Raise the named built-in exception, the first `times` times."""
    if _called_too_early(configuration):
        raise getattr(builtins, configuration["error"])("input/output error")
    (out / "whole.txt").write_text("whole")


def rejected(configuration: Configuration, seed: int, inputs: Inputs, out: Path) -> None:
    """Raise an error, unless the file `repair` of the configuration exists."""
    if not Path(configuration["repair"]).exists():
        raise EngineError("out of range:\n 3 of 400")
    (out / "whole.txt").write_text("whole")


def ends_like_an_engine(configuration: Configuration, seed: int, inputs: Inputs, out: Path) -> None:
    """Write a log and end the process from C, as some libraries do on an error."""
    (out / "engine.log").write_text("setting up\nERROR: Unknown fix style (line 7)\n")
    ctypes.CDLL(None).exit(1)


def failure_reason(out: Path) -> str | None:
    """Return the last error line of the log."""
    log = out / "engine.log"
    if not log.exists():
        return None
    return [line for line in log.read_text().splitlines() if line.startswith("ERROR")][-1]


def leaves_silently(configuration: Configuration, seed: int, inputs: Inputs, out: Path) -> None:
    """End the process with exit code 0 before the job is done."""
    os._exit(0)


def waits(configuration: Configuration, seed: int, inputs: Inputs, out: Path) -> None:
    """Write the process id to a shared folder, and wait until the file `go` is there."""
    shared = Path(configuration["shared"])
    (shared / f"{configuration['name']}-{time.time_ns()}.pid").write_text(str(os.getpid()))
    while not (shared / "go").exists():
        time.sleep(0.02)
    (out / "waited.txt").write_text(str(random.Random(seed).random()))


def fills_the_disk(configuration: Configuration, seed: int, inputs: Inputs, out: Path) -> None:
    """Write to a device that is always full."""
    with open("/dev/full", "w") as full:
        full.write("one byte too many")
