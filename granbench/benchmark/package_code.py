"""Calls of code that another package brings: its exceptions are reported in one sentence."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout

from granbench.benchmark.metric import NotApplicable
from granbench.errors import ConfigurationError, GranbenchError


@contextmanager
def package_code(what: str, package: str | None) -> Iterator[None]:
    """Report an exception in the code of another package, with the line of its file.

    What the code prints goes to standard error, so that it does not mix with a command's output.

    Parameters
    ----------
    what : the object that the package registers, such as ``axis 'rest'``
    package : its name; None for GranBench itself, whose exceptions pass

    Raises
    ------
    ConfigurationError
        For every exception, `SystemExit` among them; errors of GranBench, `NotApplicable` and
        Ctrl-C pass.
    """
    if package is None:
        yield
        return
    try:
        with redirect_stdout(sys.stderr):
            yield
    except (GranbenchError, NotApplicable, KeyboardInterrupt, GeneratorExit):
        raise
    except BaseException as error:
        from granbench.cells.user_code import failure_location  # needs torch, scoring does not

        raise ConfigurationError(
            f"{what}, which the package {package} registers, failed {failure_location(error)}; "
            "correct or uninstall that package"
        ) from error
