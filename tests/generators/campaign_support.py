"""Campaigns of toy jobs, and checks of their processes, for the tests of the campaign executor."""

import contextlib
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from granbench.generators.assembly import Assembled
from granbench.generators.campaign import CampaignReport, Job, run_campaign
from granbench.generators.generator import Generator

PATIENCE = 90.0


def walks(steps: int = 20) -> list[Job]:
    """Three walks, and one that starts at the sum of the ends of two of them."""
    first = [Job(f"walk/{i}", "toy_jobs:walk", {"steps": steps}, i) for i in range(3)]
    return [
        Job("joined", "toy_jobs:walk", {"steps": steps}, 7, ("walk/0", "walk/2")),
        *first,
    ]


def waiting_jobs(shared: Path, count: int = 3) -> list[Job]:
    """Jobs that write their process id to `shared` and wait for the file `go` there."""
    return [
        Job(f"wait-{i}", "toy_jobs:waits", {"shared": str(shared), "name": f"wait-{i}"}, i)
        for i in range(count)
    ]


class ToyPreset(BaseModel):
    name: str = "smoke"
    version: str = "1.0.0"


def waiting_generator(shared: Path) -> Generator:
    """A generator of one dataset, `waiting`, whose jobs wait for the file `go` in `shared`."""
    return Generator(
        datasets={"waiting": None},
        presets={"smoke": ToyPreset()},
        jobs=lambda dataset, preset, seed: waiting_jobs(shared),
        assemble=lambda dataset, preset, seed, results: waited(sorted(results)),
    )


def waited(names: list[str]) -> Assembled:
    """Records of zeros, one path for each name."""
    zeros = np.zeros((len(names), 2, 3), np.float32)
    return Assembled(
        order="principal",
        series={"strain": zeros, "stress": zeros},
        paths={
            "path_id": names,
            "specimen": names,
            "split": ["train"] * len(names),
            "loading_family": ["none"] * len(names),
            "seed": np.arange(len(names)),
        },
        title="Nothing",
        engine="none",
        engine_version="1",
        thesis_section="none",
        configuration={},
    )


def quiet(jobs: list[Job], folder: Path, **options) -> CampaignReport:
    return run_campaign(jobs, folder, progress="quiet", **options)


def files_of(folder: Path) -> dict[str, bytes]:
    """All files of all results, except job.json, which contains the duration of the job."""
    results = folder / "results"
    return {
        str(file.relative_to(results)): file.read_bytes()
        for file in sorted(results.rglob("*"))
        if file.is_file() and file.name != "job.json"
    }


def wait_until(happened: Callable[[], object]) -> None:
    end = time.monotonic() + PATIENCE
    while not happened():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def processes_named_in(shared: Path) -> list[int]:
    return [int(text) for file in sorted(shared.glob("*.pid")) if (text := file.read_text())]


def is_alive(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state not in "ZX"


@contextlib.contextmanager
def campaign_command(shared: Path, folder: Path, **options) -> Iterator[subprocess.Popen]:
    """Run the waiting jobs in another process."""
    program = f"""
        import signal
        from pathlib import Path
        from campaign_support import quiet, waiting_jobs
        # A shell that runs the tests in the background ignores Ctrl-C in its processes.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        quiet(waiting_jobs(Path({str(shared)!r})), Path({str(folder)!r}), **{options!r})
    """
    command = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(program)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    try:
        yield command
    finally:
        command.kill()
        command.communicate()


def parent_of(process: int) -> int:
    return int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1])
