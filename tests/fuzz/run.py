"""The mutation fuzzer: ``python tests/fuzz/run.py --seconds 3600``, or ``make fuzz``.

Valid files are changed at random, and GranBench reads them. A case fails if reading raises anything
but a `GranbenchError`, takes more than `LONGEST` seconds of processor time (or `LONGEST_WAIT` of
waiting), or needs more than `MOST_MEMORY`. Each failing input is kept with the command that repeats
it. The same seed gives the same cases.
"""

import argparse
import contextlib
import json
import os
import queue
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
TESTS = HERE.parent
LONGEST = 10.0
"""Seconds of processor time that a case may take in the process that reads."""
LONGEST_WAIT = 120.0
"""Seconds of wall clock after which a case counts as hanging, also on a busy machine."""
MOST_MEMORY = 2 * 10**9
"""Bytes that a process may use at most."""


@dataclass
class Outcome:
    """The results of the cases of one kind.

    Parameters
    ----------
    counts : cases by outcome: accepted, refused, failed
    failures : for each failing case its name, folder and error
    """

    counts: Counter[str] = field(default_factory=Counter)
    failures: list[dict[str, Any]] = field(default_factory=list)


class Worker:
    """A process that reads one case after the other, and is replaced when it dies."""

    def __init__(self, seeds: Path) -> None:
        self._seeds = seeds
        self._process: subprocess.Popen[str] | None = None

    def read(self, kind: str, case: str, folder: Path) -> dict[str, Any]:
        """The outcome of a case, whose changed input is then in `folder`."""
        if self._process is None or self._process.poll() is not None:
            words = [sys.executable, str(HERE / "run.py"), "--work", str(self._seeds)]
            self._process = subprocess.Popen(
                words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
            )
        process = self._process
        assert process.stdin is not None and process.stdout is not None
        process.stdin.write(json.dumps([kind, case, str(folder)]) + "\n")
        process.stdin.flush()
        answers: queue.Queue[str] = queue.Queue()
        reader = threading.Thread(target=lambda: answers.put(process.stdout.readline()))  # type: ignore[union-attr]
        reader.daemon = True
        reader.start()
        try:
            line = answers.get(timeout=LONGEST_WAIT)
        except queue.Empty:
            self.close()
            return {"outcome": "failed", "error": "hang", "text": f"over {LONGEST_WAIT:g} s"}
        if line:
            return json.loads(line)
        code = process.wait()
        self._process = None
        if code == -signal.SIGPROF:
            text = f"over {LONGEST:g} s of processor time"
            return {"outcome": "failed", "error": "hang", "text": text}
        return {"outcome": "failed", "error": "crash", "text": f"exit code {code}"}

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None


def fuzz(
    kinds: list[str], *, seed: int, cases: int | None, seconds: float | None, out: Path
) -> dict[str, Outcome]:
    """Try cases of some kinds in turn.

    Parameters
    ----------
    kinds : keys of `kinds.KINDS`
    seed : what all changes follow from
    cases : of each kind; None for as many as there is time for
    seconds : after which no further case is begun; None for no limit
    out : where failing inputs are kept
    """
    outcomes = {kind: Outcome() for kind in kinds}
    began, number = time.monotonic(), 0
    with tempfile.TemporaryDirectory(prefix="granbench-fuzz-") as scratch:
        seeds = Path(scratch) / "seeds"
        worker = Worker(seeds)
        try:
            while cases is None or number < cases:
                for kind in kinds:
                    if seconds is not None and time.monotonic() - began > seconds:
                        return outcomes
                    case, folder = f"{seed}/{kind}/{number}", Path(scratch) / "case"
                    shutil.rmtree(folder, ignore_errors=True)
                    found = worker.read(kind, case, folder)
                    outcomes[kind].counts[found["outcome"]] += 1
                    if found["outcome"] == "failed":
                        outcomes[kind].failures.append(found | {"case": case})
                        _keep(folder, case, found, out)
                number += 1
        finally:
            worker.close()
    return outcomes


def _keep(folder: Path, case: str, found: dict[str, Any], out: Path) -> None:
    kept = out / case.replace("/", "-")
    shutil.rmtree(kept, ignore_errors=True)
    kept.parent.mkdir(parents=True, exist_ok=True)
    if folder.exists():
        shutil.copytree(folder, kept)
    kept.mkdir(exist_ok=True)
    (kept / "failure.txt").write_text(
        f"{json.dumps(found, indent=1)}\nrepeat: python tests/fuzz/run.py --case {case}\n"
    )


def work(seeds: Path) -> None:
    """Read cases from standard input until it closes: the main loop of a worker."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(1, 2)
    _prepare()
    from kinds import KINDS, described

    for line in sys.stdin:
        kind, case, folder = json.loads(line)
        try:
            if not (seeds / kind).exists():
                KINDS[kind].seeds(seeds / kind)
            outcome = try_case(kind, case, seeds / kind, Path(folder))
        except Exception as error:  # of the fuzzer itself: a valid file cannot be made
            outcome = {"outcome": "failed", **described(error)}
        answers.write(json.dumps(outcome) + "\n")
        answers.flush()


def try_case(kind: str, case: str, seeds: Path, folder: Path) -> dict[str, Any]:
    """Make a case and read it in this process, which is ended if that takes too long."""
    from kinds import KINDS, described, make_case

    from granbench.errors import GranbenchError

    make_case(kind, seeds, case, folder)
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    try:
        _injected_fault()
        KINDS[kind].read(folder)
        outcome: dict[str, Any] = {"outcome": "accepted"}
    except GranbenchError as error:
        outcome = {"outcome": "refused", **described(error)}
    except (Exception, SystemExit) as error:
        outcome = {"outcome": "failed", **described(error)}
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    return outcome


def _injected_fault() -> None:
    """The failure that a test of the fuzzer itself asks for."""
    fault = os.environ.get("GRANBENCH_FUZZ_FAULT")
    if fault == "raises":
        raise KeyError("no such column")
    if fault == "allocates":
        bytearray(2 * MOST_MEMORY)
    if fault == "ends":
        os.kill(os.getpid(), signal.SIGSEGV)
    if fault == "waits":
        signal.setitimer(signal.ITIMER_PROF, 0.2)
        while True:
            pass


def _prepare() -> None:
    """The folders that the kinds import from, a bound on memory, and libraries that are quiet."""
    sys.path[:0] = [str(HERE), str(TESTS)]
    warnings.simplefilter("ignore")
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    import kinds  # noqa: F401 (the libraries first: they count as what the process starts with)

    with contextlib.suppress(OSError, ValueError):
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        bound = pages * os.sysconf("SC_PAGE_SIZE") + MOST_MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (bound, bound))


def report(outcomes: dict[str, Outcome]) -> str:
    """A line a kind, then a line for each place where reading failed."""
    lines = []
    for kind, outcome in outcomes.items():
        counts = ", ".join(
            f"{outcome.counts[name]} {name}" for name in ("accepted", "refused", "failed")
        )
        lines.append(f"{kind}: {outcome.counts.total()} cases, {counts}")
        places = Counter(
            (failure["error"], failure.get("place", ""), failure["text"][:120])
            for failure in outcome.failures
        )
        first = {
            (f["error"], f.get("place", ""), f["text"][:120]): f["case"]
            for f in reversed(outcome.failures)
        }
        for place, times in places.most_common():
            lines.append(f"  {times} x {' '.join(place)} (first: {first[place]})")
    return "\n".join(lines)


def main() -> int:
    """Run the fuzzer; 1 where a case failed."""
    names = (
        "dataset", "predictions", "submission", "model", "laboratory", "path", "load-path", "mesh",
    )  # fmt: skip
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, help="for how long; no limit by default")
    parser.add_argument("--cases", type=int, help="of each kind")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", action="append", choices=names, help="these only")
    parser.add_argument("--out", type=Path, default=Path("fuzz-failures"))
    parser.add_argument("--case", help="repeat one case, as SEED/KIND/NUMBER, in this process")
    parser.add_argument("--work", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work is not None:
        work(options.work)
        return 0
    if options.case is not None:
        return _repeat(options.case)
    outcomes = fuzz(
        options.kind or list(names),
        seed=options.seed,
        cases=options.cases,
        seconds=options.seconds,
        out=options.out,
    )
    print(report(outcomes))
    failed = sum(len(outcome.failures) for outcome in outcomes.values())
    if failed:
        print(f"{failed} failing inputs are in {options.out}")
    return int(bool(failed))


def _repeat(case: str) -> int:
    import traceback

    _prepare()
    from kinds import KINDS, make_case

    kind = case.split("/")[1]
    with tempfile.TemporaryDirectory() as scratch:
        KINDS[kind].seeds(Path(scratch) / "seeds")
        folder = make_case(kind, Path(scratch) / "seeds", case, Path(scratch) / "case")
        try:
            KINDS[kind].read(folder)
        except Exception:
            traceback.print_exc()
            return 1
    print("accepted")
    return 0


if __name__ == "__main__":
    sys.exit(main())
