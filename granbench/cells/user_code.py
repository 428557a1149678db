"""Calls of user code: how its failures are reported, and where its printed output goes."""

import sys
import sysconfig
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path

from granbench.errors import GranbenchError, ModelError

LONGEST_REASON = 300
"""Characters of an exception's text that are shown."""

INSTALLED = {"site-packages", "dist-packages"}
LIBRARIES = {
    "_pytest", "jinja2", "matplotlib", "meshio", "netCDF4", "numpy", "pandas", "pluggy", "pooch",
    "pydantic", "rich", "safetensors", "scipy", "skfem", "torch", "torchgen", "typer", "click",
    "xarray", "yaml",
}  # fmt: skip
"""Packages that user code calls; a line in one of them does not show what to change."""

STANDARD_LIBRARY = Path(sysconfig.get_paths()["stdlib"])


@contextmanager
def user_code(what: str, remedy: str = "fix the model") -> Iterator[None]:
    """Report any exception of user code in one sentence, with the line of the user's own file.

    What the code prints goes to standard error, so that it does not mix with a command's output.

    Parameters
    ----------
    what : the beginning of the sentence, as ``m:cell failed``
    remedy : its end

    Raises
    ------
    ModelError
        For every exception, `SystemExit` among them; errors of GranBench and Ctrl-C pass.
    """
    try:
        with redirect_stdout(sys.stderr):
            yield
    except (GranbenchError, KeyboardInterrupt, GeneratorExit):
        raise
    except BaseException as error:
        raise ModelError(f"{what} {failure_location(error)}; {remedy}") from error


def failure_location(error: BaseException) -> str:
    """What was raised, and in which line: ``with ValueError (boom) at my_model.py line 16``.

    The line is the last one of the user's own code where there is one, not a line of torch, as
    where a network is given a wrong shape.
    """
    if isinstance(error, SyntaxError) and error.filename is not None:
        text, file, line = str(error.msg), error.filename, error.lineno or 1
    else:
        text = _text_of(error)
        file, line = _place(error)
    why = f" ({text})" if text else ""
    return f"with {type(error).__name__}{why} at {Path(file).name} line {line}"


def _text_of(error: BaseException) -> str:
    """The exception's text in one printable line, cut where it is long."""
    try:
        words = str(error)
    except Exception:
        return "its text cannot be shown"
    line = " ".join(words[: 4 * LONGEST_REASON].split())
    line = "".join(character if character.isprintable() else "?" for character in line)
    return line if len(line) <= LONGEST_REASON else f"{line[:LONGEST_REASON]} ..."


def _place(error: BaseException) -> tuple[str, int]:
    """File and line to look at first."""
    frames = [
        (frame.f_code.co_filename, line, str(frame.f_globals.get("__name__", "")).split(".")[0])
        for frame, line in traceback.walk_tb(error.__traceback__)
    ]
    if not frames:
        return "an unknown file", 0
    outside = [frame for frame in frames if not _of_library(*frame)]
    in_folder = [frame for frame in outside if not INSTALLED & set(Path(frame[0]).parts)]
    # Of installed packages the first is the user's; it calls the others.
    in_package = [frame for frame in outside if frame[2] == outside[0][2]]
    file, line, _ = (in_folder or in_package or frames)[-1]
    return file, line


def _of_library(file: str, line: int, package: str) -> bool:
    path = Path(file)
    return (
        package == "granbench"
        or package in LIBRARIES
        or file.startswith("<frozen")
        or (STANDARD_LIBRARY in path.parents and not INSTALLED & set(path.parts))
    )
