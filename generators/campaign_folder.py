"""The folder of a campaign: finished results, failures, attempts under way, log and lock.

::

    results/<slug>/    one finished job: its files and job.json; appears whole or not at all
    failed/<slug>.json why a job has no result
    attempts/<run>/    what the running command works on; worth nothing after it
    campaign.log       one line a job
    lock               held by the one command that writes here
"""

import contextlib
import fcntl
import json
import os
import shutil
import socket
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO

from granbench.errors import ConfigurationError
from granbench.whole_file import FULL_DISK

RESULT_FILE = "job.json"
OPEN_FILE = "open"


class CampaignFolder:
    """Where one campaign keeps everything; jobs go by the slug of their key here.

    Parameters
    ----------
    root : the campaign's folder; made when it is absent

    Raises
    ------
    ConfigurationError : the folder cannot be made
    """

    def __init__(self, root: Path) -> None:
        self.root = Path(root).resolve()
        self.results = self.root / "results"
        self.failed = self.root / "failed"
        self.attempts = self.root / "attempts"
        self.log_path = self.root / "campaign.log"
        with self.explained_errors():
            for part in (self.results, self.failed, self.attempts):
                part.mkdir(parents=True, exist_ok=True)

    @contextlib.contextmanager
    def explained_errors(self) -> Iterator[None]:
        """Turn an error of the file system into a sentence about this folder."""
        try:
            yield
        except BrokenPipeError:  # a screen that is gone, not a file
            raise
        except OSError as error:
            remedy = "with --out, name a folder that can be written"
            if error.errno in FULL_DISK:
                remedy = (
                    "free space there or name another folder with --out, then run the same "
                    "command again"
                )
            raise ConfigurationError(
                f"the campaign folder {self.root} cannot be written: "
                f"{error.strerror or error}; {remedy}"
            ) from error

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other commands out of the folder; the lock falls with the process that holds it.

        Raises
        ------
        ConfigurationError : another command holds the folder
        """
        with self.explained_errors():
            lock = open(self.root / "lock", "a+")  # noqa: SIM115
        with lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise ConfigurationError(
                    f"another command is writing to the campaign folder {self.root} "
                    f"({_holder(lock)}); wait for it, stop it, or name another folder with --out"
                ) from None
            except OSError as error:
                raise ConfigurationError(
                    f"the file system of {self.root} has no file locks ({error.strerror}); "
                    "name a folder on another one with --out"
                ) from error
            lock.truncate(0)
            lock.write(f"process {os.getpid()} on {socket.gethostname()}")
            lock.flush()
            yield

    @contextlib.contextmanager
    def open_run(self) -> Iterator[Path]:
        """Give a fresh folder for the attempts of this command, and close it in the end.

        Attempts that an earlier command left behind are closed and removed first. An attempt
        lives only as long as its run is open (`run_is_open`).
        """
        self._close_runs()
        run = self.attempts / uuid.uuid4().hex[:12]
        run.mkdir()
        (run / OPEN_FILE).touch()
        try:
            yield run
        finally:
            self._close_runs()

    def _close_runs(self) -> None:
        for run in self.attempts.iterdir():
            close_run(run)
            shutil.rmtree(run, ignore_errors=True)

    def result(self, slug: str) -> dict[str, Any] | None:
        """Return the job.json of a finished job, or None when there is no whole result."""
        return _read(self.results / slug / RESULT_FILE)

    def failure(self, slug: str) -> dict[str, Any] | None:
        """Return the record of a failed job, or None."""
        return _read(self.failed / f"{slug}.json")

    def record_failure(self, slug: str, record: dict[str, Any]) -> None:
        """Write why a job failed, in place of what was known before."""
        draft = self.failed / f"{slug}.json.part"
        draft.write_text(json.dumps(record, indent=1, sort_keys=True) + "\n")
        os.replace(draft, self.failed / f"{slug}.json")

    def forget_failure(self, slug: str) -> None:
        """Remove the record of a failure that no longer holds."""
        (self.failed / f"{slug}.json").unlink(missing_ok=True)

    def log(self, line: str) -> None:
        """Add one line with the time to campaign.log."""
        with open(self.log_path, "a") as log:
            log.write(f"{time.strftime('%Y-%m-%dT%H:%M:%S%z')} {line}\n")


def publish(out: Path, results: Path, slug: str, record: dict[str, Any]) -> None:
    """Give a finished attempt's files their final name in one step.

    Parameters
    ----------
    out : folder with the files of the job; it is gone afterwards
    results, slug : where the result goes
    record : content of job.json; where a result with the same digest is there already (another
        attempt at the same job was faster) that one stays
    """
    (out / RESULT_FILE).write_text(json.dumps(record, indent=1, sort_keys=True) + "\n")
    # A rename may reach the disk before what it names: without this, a power cut could leave
    # an empty file in a result that counts as whole.
    for file in out.rglob("*"):
        if file.is_file():
            with open(file, "rb") as written:
                os.fsync(written.fileno())
    final = results / slug
    try:
        os.rename(out, final)
    except OSError:
        present = _read(final / RESULT_FILE)
        if present is None:
            shutil.rmtree(final)
            os.rename(out, final)
        elif present["digest"] != record["digest"]:
            raise


def run_is_open(run: Path) -> bool:
    """Whether the command that opened this run still wants its attempts."""
    return (run / OPEN_FILE).exists()


def close_run(run: Path) -> None:
    """Tell all attempts of a run, on every machine, to stop."""
    (run / OPEN_FILE).unlink(missing_ok=True)


def _read(path: Path) -> dict[str, Any] | None:
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError):
        return None


def _holder(lock: TextIO) -> str:
    lock.seek(0)
    return lock.read() or "a process that has just started"
