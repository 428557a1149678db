"""The campaign executor on a real dask.distributed scheduler with real workers."""

import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from campaign_support import (
    PATIENCE,
    campaign_command,
    files_of,
    is_alive,
    parent_of,
    processes_named_in,
    quiet,
    wait_until,
    waiting_jobs,
    walks,
)

from granbench.errors import ConfigurationError, EngineError
from granbench.generators.campaign import Job, workers

pytestmark = [pytest.mark.usefixtures("toy_jobs"), pytest.mark.cluster]


class Cluster:
    """A scheduler and workers with one thread each, all in separate processes."""

    def __init__(self, folder: Path, workers: int) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        self.log = open(folder / "dask.log", "wb")  # noqa: SIM115
        self.folder = folder
        self.scheduler = self._start(
            "scheduler",
            "--port",
            self.address.rpartition(":")[2],
            "--host",
            "127.0.0.1",
            "--no-dashboard",
        )
        self.workers = [
            self._start(
                "worker",
                self.address,
                "--nthreads",
                "1",
                "--no-nanny",
                "--local-directory",
                str(folder / f"worker-{i}"),
            )
            for i in range(workers)
        ]

    def _start(self, *arguments: str) -> subprocess.Popen:
        return subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments, "--no-dashboard"],
            stdout=self.log,
            stderr=self.log,
            cwd=self.folder,
        )

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()
        self.log.close()


@pytest.fixture
def cluster(toy_jobs: None, tmp_path: Path) -> Iterator[Cluster]:
    running = Cluster(tmp_path, workers=2)
    yield running
    running.close()


def test_the_job_of_a_killed_dask_worker_ends_and_nothing_is_lost(
    tmp_path, shared, undisturbed, cluster, capfd
):
    stopped: list[bool] = []

    def kill_a_worker() -> None:
        try:
            wait_until(lambda: len(processes_named_in(shared)) == 2)
            first = processes_named_in(shared)[0]
            worker = next(w for w in cluster.workers if w.pid == parent_of(first))
            worker.send_signal(signal.SIGKILL)
            wait_until(lambda: not is_alive(first))
            stopped.append(True)
        finally:
            (shared / "go").touch()  # so that the jobs end in any case

    killer = threading.Thread(target=kill_a_worker)
    killer.start()
    report = quiet(waiting_jobs(shared), tmp_path / "campaign", scheduler=cluster.address)
    killer.join()
    assert stopped
    assert report.failed == {}
    assert files_of(tmp_path / "campaign") == undisturbed
    assert capfd.readouterr() == ("", "")

    # The same cluster continues with dependent and with failing jobs.
    failing = Job("bad", "toy_jobs:ends_like_an_engine", {}, 0)
    more = quiet([failing, *walks()], tmp_path / "walks", scheduler=cluster.address)
    assert more.failed == {"bad": "ERROR: Unknown fix style (line 7)"}
    quiet(walks(), tmp_path / "walks-here")
    assert files_of(tmp_path / "walks") == files_of(tmp_path / "walks-here")


def test_ctrl_c_stops_the_jobs_on_the_cluster_and_the_campaign_resumes(
    tmp_path, shared, undisturbed, cluster
):
    with campaign_command(shared, tmp_path / "campaign", scheduler=cluster.address) as command:
        wait_until(lambda: len(processes_named_in(shared)) == 2)
        jobs = processes_named_in(shared)
        command.send_signal(signal.SIGINT)
        _, errors = command.communicate(timeout=PATIENCE)
    assert errors.decode().rstrip().endswith("KeyboardInterrupt")
    wait_until(lambda: not any(map(is_alive, jobs)))
    (shared / "go").touch()
    report = quiet(waiting_jobs(shared), tmp_path / "campaign", scheduler=cluster.address)
    assert report.failed == {}
    assert files_of(tmp_path / "campaign") == undisturbed


def test_a_lost_scheduler_is_a_clear_error_and_the_campaign_resumes(
    tmp_path, shared, undisturbed, cluster, capfd
):
    def kill_the_scheduler() -> None:
        try:
            wait_until(lambda: len(processes_named_in(shared)) == 2)
        finally:
            cluster.scheduler.kill()

    killer = threading.Thread(target=kill_the_scheduler)
    killer.start()
    with pytest.raises(EngineError, match=re.escape(cluster.address)):
        quiet(waiting_jobs(shared), tmp_path / "campaign", scheduler=cluster.address)
    killer.join()
    wait_until(lambda: not any(map(is_alive, processes_named_in(shared))))
    (shared / "go").touch()
    quiet(waiting_jobs(shared), tmp_path / "campaign")
    assert files_of(tmp_path / "campaign") == undisturbed
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:nowhere", "nowhere"])
def test_an_invalid_address_is_refused(tmp_path, address):
    with pytest.raises(ConfigurationError, match=address):
        quiet(walks(), tmp_path / "new" / "campaign", scheduler=address)
    assert list(tmp_path.iterdir()) == []


def test_a_finished_campaign_needs_no_scheduler(tmp_path):
    nobody = "tcp://127.0.0.1:nowhere"
    done = quiet(walks(), tmp_path).done
    assert quiet(walks(), tmp_path, scheduler=nobody).done == done
    shutil.rmtree(done["walk/1"])
    with pytest.raises(ConfigurationError, match=nobody):
        quiet(walks(), tmp_path, scheduler=nobody)


def test_a_service_that_is_not_a_scheduler_is_soon_refused(tmp_path, monkeypatch):
    assert workers.CONNECT_TIME < 10.0
    monkeypatch.setattr(workers, "CONNECT_TIME", 0.5)
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        began = time.monotonic()
        with pytest.raises(ConfigurationError, match="127.0.0.1"):
            quiet(walks(), tmp_path, scheduler=f"tcp://127.0.0.1:{silent.getsockname()[1]}")
    assert time.monotonic() - began < 5.0
