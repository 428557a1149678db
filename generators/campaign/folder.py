"""The folder of a campaign: finished results, failures, running attempts, log and lock.

::

    results/<slug>/    one finished job: its files and job.json, which lists them with their
                       SHA-256; appears whole or not at all
    failed/<slug>.json why a job has no result
    attempts/<run>/    files of the jobs that are running; removed at the end of the run
    campaign.log       one line per job
    lock               held by the one process that writes here
"""

import contextlib
import fcntl
import os
import shutil
import socket
import stat
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO

from granbench.errors import ConfigurationError
from granbench.files.whole_file import FULL_DISK, whole_file
from granbench.generators.campaign.sealed_record import (
    FILES,
    damage,
    digests_of,
    read_record,
    sealed,
)

RESULT_FILE = "job.json"
OPEN_FILE = "open"


class CampaignFolder:
    """The folder of one campaign, in which jobs are named by the slug of their key.

    Parameters
    ----------
    root : the campaign's folder; made if it does not exist

    Raises
    ------
    ConfigurationError
        If the folder cannot be made.
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
        """Turn an error of the file system into a ConfigurationError about this folder."""
        try:
            yield
        except BrokenPipeError:  # of the terminal, not of a file
            raise
        except OSError as error:
            remedy = "choose a folder that can be written"
            if error.errno in FULL_DISK:
                remedy = (
                    "free space there or choose another folder, then run the same campaign again"
                )
            raise ConfigurationError(
                f"the campaign folder {self.root} cannot be written: "
                f"{error.strerror or error}; {remedy}"
            ) from error

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes out of the folder; the lock ends with the process that holds it.

        Raises
        ------
        ConfigurationError
            If another process holds the lock.
        """
        with self.explained_errors():
            lock = open(self.root / "lock", "a+", opener=_regular)  # noqa: SIM115
        with lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise ConfigurationError(
                    f"another process is writing to the campaign folder {self.root} "
                    f"({_holder(lock)}); wait for it, stop it, or choose another folder"
                ) from None
            except OSError as error:
                raise ConfigurationError(
                    f"the file system of {self.root} has no file locks ({error.strerror}); "
                    "choose a folder on another file system"
                ) from error
            lock.truncate(0)
            lock.write(f"process {os.getpid()} on {socket.gethostname()}")
            lock.flush()
            yield

    @contextlib.contextmanager
    def open_run(self) -> Iterator[Path]:
        """Make a new folder for the attempts of this run, and close and remove it at the end.

        Attempts that an earlier run left behind are stopped and removed first. An attempt goes on
        only while its run is open (`run_is_open`).
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
            if run.is_dir() and not run.is_symlink():
                close_run(run)
                shutil.rmtree(run, ignore_errors=True)

    def result(self, slug: str) -> dict[str, Any] | None:
        """Return the record of a finished job, or None if it is missing or damaged."""
        return read_record(self.results / slug / RESULT_FILE)

    def damage(self, slug: str, result: dict[str, Any] | None) -> str | None:
        """Return what is wrong with the result of a job, or None if it is whole or absent.

        Parameters
        ----------
        slug : of the job
        result : record of the job, as the method `result` returns it
        """
        folder = self.results / slug
        if not os.path.lexists(folder):
            return None
        if result is None:
            return f"its {RESULT_FILE} is missing or damaged"
        return damage(folder, result)

    def discard(self, slug: str) -> None:
        """Remove a damaged result."""
        _remove(self.results / slug)

    def failure(self, slug: str) -> dict[str, Any] | None:
        """Return the record of a failed job, or None if it is missing or damaged."""
        record = read_record(self.failed / f"{slug}.json")
        return record if record is not None and isinstance(record.get("reason"), str) else None

    def record_failure(self, slug: str, record: dict[str, Any]) -> None:
        """Write why a job failed, in place of an earlier record."""
        self.forget_failure(slug)
        with whole_file(self.failed / f"{slug}.json", ConfigurationError) as draft:
            draft.write_text(sealed(record))

    def forget_failure(self, slug: str) -> None:
        """Remove the record of a failure that no longer holds."""
        _remove(self.failed / f"{slug}.json")

    def log(self, line: str) -> None:
        """Add one line with the time to campaign.log."""
        with open(self.log_path, "a") as log:
            log.write(f"{time.strftime('%Y-%m-%dT%H:%M:%S%z')} {line}\n")


def publish(out: Path, results: Path, slug: str, record: dict[str, Any]) -> None:
    """Move the files of a finished attempt to their final folder in one step.

    Parameters
    ----------
    out : folder with the files of the job; it no longer exists afterwards
    results, slug : the files are moved to ``results/slug``
    record : content of job.json; a result with the same digest that already exists is kept,
        because another attempt at the same job was faster
    """
    (out / RESULT_FILE).write_text(sealed(record | {FILES: digests_of(out)}))
    # A rename may reach the disk before the files themselves: without this, a power cut could
    # leave an empty file in a result that counts as whole.
    for file in out.rglob("*"):
        if file.is_file():
            with open(file, "rb") as written:
                os.fsync(written.fileno())
    final = results / slug
    try:
        os.rename(out, final)
    except OSError:
        present = read_record(final / RESULT_FILE)
        if present is None:
            _remove(final)
            os.rename(out, final)
        elif present["digest"] != record["digest"]:
            raise


def run_is_open(run: Path) -> bool:
    """Whether the run still goes on, so that its attempts should too."""
    return (run / OPEN_FILE).exists()


def close_run(run: Path) -> None:
    """Stop all attempts of a run, on every machine."""
    (run / OPEN_FILE).unlink(missing_ok=True)


def _remove(path: Path) -> None:
    """Remove a file, a link or a folder, if it is there."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _regular(path: str, flags: int) -> int:
    """Open a lock file if it is a regular file, and neither a link nor a device."""
    descriptor = os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK, 0o666)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(f"{path} is not a file")
    return descriptor


def _holder(lock: TextIO) -> str:
    lock.seek(0)
    return lock.read() or "a process that has just started"
