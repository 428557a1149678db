"""LIGGGHTS in a process of its own for every call, as it can be started once in a process."""

import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor

_CONTEXT = multiprocessing.get_context("forkserver")
_CONTEXT.set_forkserver_preload(["granbench.generators.dem.preparation"])


def isolated(function: Callable, *arguments, **named):
    """What a function of a module gives in a fresh process; an end of that process is an error."""
    with ProcessPoolExecutor(1, mp_context=_CONTEXT) as executor:
        return executor.submit(function, *arguments, **named).result()
