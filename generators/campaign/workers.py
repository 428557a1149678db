"""Workers that run campaign jobs in separate processes, on this machine or on a dask cluster."""

import asyncio
import contextlib
import logging
import sys
import uuid
import warnings
from collections.abc import Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from pathlib import Path
from typing import Any, Protocol

from granbench.errors import ConfigurationError, EngineError
from granbench.generators.campaign.attempt import Outcome, Request, run_attempt
from granbench.generators.campaign.folder import close_run

STOP_TIME = 5.0
CONNECT_TIME = 8.0


class Future(Protocol):
    """A running attempt: a future of `concurrent.futures` or of dask."""

    def add_done_callback(self, fn: Any) -> Any:
        """Call `fn(future)` when the attempt has ended."""

    def result(self) -> Any:
        """Return the outcome of the attempt."""


class LocalWorkers:
    """Workers on this machine; one thread of this process waits for each job's process.

    Parameters
    ----------
    count : number of jobs that run at the same time
    run : folder of the run
    """

    def __init__(self, count: int, run: Path) -> None:
        self.capacity = count
        self._run = run
        self._threads = ThreadPoolExecutor(count, thread_name_prefix="campaign")

    def submit(self, request: Request, priority: int) -> Future:
        """Start an attempt."""
        return self._threads.submit(run_attempt, request)

    def outcome(self, future: Future) -> Outcome:
        """Return how a finished attempt ended."""
        return future.result()

    def close(self) -> None:
        """Stop every attempt and wait until its processes are gone."""
        close_run(self._run)
        self._threads.shutdown(wait=True, cancel_futures=True)


class DaskWorkers:
    """The workers of a running dask.distributed cluster, which share the campaign's folder.

    Parameters
    ----------
    address : of the scheduler, such as ``tcp://host:8786``
    run : folder of the run

    Raises
    ------
    ConfigurationError
        If dask is not installed, or no scheduler answers at the address.
    """

    capacity = sys.maxsize

    def __init__(self, address: str, run: Path) -> None:
        # Checked first, because a Client that cannot connect may hang and logs errors later.
        find_scheduler(address)
        import distributed

        self.address = address
        self._run = run
        self._futures: dict[int, Any] = {}
        with contextlib.ExitStack() as quiet:
            quiet.enter_context(_silence())
            self._client = distributed.Client(
                address, timeout=CONNECT_TIME, set_as_default=False, name="granbench"
            )
            self._quiet = quiet.pop_all()

    def submit(self, request: Request, priority: int) -> Future:
        """Submit an attempt to the cluster; a lower `priority` runs first."""
        future = self._client.submit(
            run_attempt,
            request,
            key=f"granbench-{request.slug}-{uuid.uuid4().hex[:8]}",
            priority=-priority,
            pure=False,
        )
        self._futures[id(future)] = future
        return future

    def outcome(self, future: Future) -> Outcome:
        """Return how a finished attempt ended.

        Raises
        ------
        EngineError
            If the connection to the scheduler was lost.
        ConfigurationError
            If the workers have no usable granbench.
        """
        from distributed import KilledWorker

        self._futures.pop(id(future), None)
        try:
            return future.result()
        except KilledWorker:
            return Outcome("killed", "every dask worker that ran it died")
        except (CancelledError, asyncio.CancelledError, OSError) as error:
            raise EngineError(
                f"the connection to the dask scheduler at {self.address} was lost; start it again "
                "and run the same campaign to continue"
            ) from error
        except Exception as error:
            raise ConfigurationError(
                f"a worker of {self.address} cannot run jobs ({type(error).__name__}: {error}); "
                "install the same granbench there"
            ) from error

    def close(self) -> None:
        """Stop every attempt, wait shortly for its processes to end, and disconnect."""
        import distributed

        close_run(self._run)
        if self._client.status == "running" and self._futures:
            with contextlib.suppress(Exception):
                distributed.wait(list(self._futures.values()), timeout=STOP_TIME)
        with contextlib.suppress(Exception):
            self._client.close(timeout=STOP_TIME)
        self._quiet.close()


def find_scheduler(address: str) -> None:
    """Check that a dask scheduler answers.

    Parameters
    ----------
    address : such as ``tcp://host:8786``

    Raises
    ------
    ConfigurationError
        If dask is not installed, or no scheduler answers at the address.
    """
    try:
        import distributed  # noqa: F401
    except ImportError as missing:
        raise ConfigurationError(
            "a scheduler needs dask.distributed: pip install 'granbench[generate]'"
        ) from missing
    # In a new thread, because the caller's may have an event loop already.
    with _silence(), ThreadPoolExecutor(1) as thread:
        thread.submit(asyncio.run, _ask_scheduler(address)).result()


async def _ask_scheduler(address: str) -> None:
    """Raise ConfigurationError unless a dask scheduler answers at the address in time."""
    from distributed import Security
    from distributed.core import rpc

    identity: dict[str, Any] = {}
    try:
        security = Security().get_connection_args("client")
        async with rpc(address, connection_args=security) as service:
            identity = await asyncio.wait_for(service.identity(), CONNECT_TIME)
    except (OSError, ValueError, RuntimeError, ImportError, TimeoutError) as error:
        reason = type(error).__name__ if isinstance(error, TimeoutError) else str(error)
    else:
        reason = f"found there: {identity.get('type', 'another service')}"
    if identity.get("type") != "Scheduler":
        raise ConfigurationError(
            f"no dask scheduler answers at {address} ({reason}); start one with `dask scheduler` "
            "and workers with `dask worker ADDRESS`, and give that address as scheduler"
        )


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Keep dask's own log lines and version warnings off the screen."""
    families = ("distributed", "tornado", "asyncio")
    names = [n for n in logging.root.manager.loggerDict if n.split(".")[0] in families]
    before = {name: logging.getLogger(name).level for name in {*names, *families}}
    for name in before:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="distributed")
        try:
            yield
        finally:
            for name, level in before.items():
                logging.getLogger(name).setLevel(level)
