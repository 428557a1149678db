"""Workers that run campaign jobs, each in a process of its own: here, or on a dask cluster."""

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
from granbench.generators.attempt import Outcome, Request, run_attempt
from granbench.generators.campaign_folder import close_run

STOP_TIME = 5.0
CONNECT_TIME = 8.0


class Handed(Protocol):
    """A future, of `concurrent.futures` or of dask."""

    def add_done_callback(self, fn: Any) -> Any:
        """Call `fn(future)` when the attempt has ended."""

    def result(self) -> Any:
        """Return its outcome."""


class LocalWorkers:
    """`count` workers on this machine; a thread of this process watches over each job's process.

    Parameters
    ----------
    count : how many jobs run at a time
    run : folder of the campaign's run
    """

    def __init__(self, count: int, run: Path) -> None:
        self.capacity = count
        self._run = run
        self._threads = ThreadPoolExecutor(count, thread_name_prefix="campaign")

    def submit(self, request: Request, priority: int) -> Handed:
        """Start an attempt."""
        return self._threads.submit(run_attempt, request)

    def outcome(self, handed: Handed) -> Outcome:
        """Return how a finished attempt ended."""
        return handed.result()

    def close(self) -> None:
        """Stop every attempt and wait until its processes are gone."""
        close_run(self._run)
        self._threads.shutdown(wait=True, cancel_futures=True)


class DaskWorkers:
    """The workers of a running dask.distributed cluster, which share the campaign's folder.

    Parameters
    ----------
    address : of the scheduler, such as ``tcp://host:8786``
    run : folder of the campaign's run

    Raises
    ------
    ConfigurationError : dask is not installed, or no scheduler answers at the address
    """

    capacity = sys.maxsize

    def __init__(self, address: str, run: Path) -> None:
        # Asked first: a Client that cannot connect may hang, and complains when it is freed.
        find_scheduler(address)
        import distributed

        self.address = address
        self._run = run
        self._handed: dict[int, Any] = {}
        with contextlib.ExitStack() as quiet:
            quiet.enter_context(_silence())
            self._client = distributed.Client(
                address, timeout=CONNECT_TIME, set_as_default=False, name="granbench"
            )
            self._quiet = quiet.pop_all()

    def submit(self, request: Request, priority: int) -> Handed:
        """Hand an attempt to the cluster; lower `priority` goes first."""
        future = self._client.submit(
            run_attempt,
            request,
            key=f"granbench-{request.slug}-{uuid.uuid4().hex[:8]}",
            priority=-priority,
            pure=False,
        )
        self._handed[id(future)] = future
        return future

    def outcome(self, handed: Handed) -> Outcome:
        """Return how a finished attempt ended.

        Raises
        ------
        EngineError : the scheduler was lost
        ConfigurationError : the workers have no usable granbench
        """
        from distributed import KilledWorker

        self._handed.pop(id(handed), None)
        try:
            return handed.result()
        except KilledWorker:
            return Outcome("killed", "every dask worker that took it died")
        except (CancelledError, asyncio.CancelledError, OSError) as error:
            raise EngineError(
                f"the dask scheduler at {self.address} was lost; start it again and run the same "
                "command to continue"
            ) from error
        except Exception as error:
            raise ConfigurationError(
                f"a worker of {self.address} cannot run jobs ({type(error).__name__}: {error}); "
                "install the same granbench there"
            ) from error

    def close(self) -> None:
        """Stop every attempt, give the workers a moment to end its processes, and disconnect."""
        import distributed

        close_run(self._run)
        if self._client.status == "running" and self._handed:
            with contextlib.suppress(Exception):
                distributed.wait(list(self._handed.values()), timeout=STOP_TIME)
        with contextlib.suppress(Exception):
            self._client.close(timeout=STOP_TIME)
        self._quiet.close()


def find_scheduler(address: str) -> None:
    """Make sure that a dask scheduler answers.

    Parameters
    ----------
    address : such as ``tcp://host:8786``

    Raises
    ------
    ConfigurationError : dask is not installed, or no scheduler answers at the address
    """
    try:
        import distributed  # noqa: F401
    except ImportError as missing:
        raise ConfigurationError(
            "--scheduler needs dask.distributed: pip install 'granbench[generate]'"
        ) from missing
    # In a thread of its own: the caller's may have an event loop already.
    with _silence(), ThreadPoolExecutor(1) as asking:
        asking.submit(asyncio.run, _ask_scheduler(address)).result()


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
        reason = f"a {identity.get('type', 'stranger')} does"
    if identity.get("type") != "Scheduler":
        raise ConfigurationError(
            f"no dask scheduler answers at {address} ({reason}); start one with `dask scheduler` "
            "and workers with `dask worker ADDRESS`, then give that address to --scheduler"
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
