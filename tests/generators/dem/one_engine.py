"""Calls in new processes, because LIGGGHTS can be started only once in a process."""

import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor

_CONTEXT = multiprocessing.get_context("forkserver")
_CONTEXT.set_forkserver_preload(["granbench.generators.dem.preparation"])


def isolated(function: Callable, *arguments, **named):
    """Return the result of a function of a module in a new process; its end is an error."""
    with ProcessPoolExecutor(1, mp_context=_CONTEXT) as executor:
        return executor.submit(function, *arguments, **named).result()
