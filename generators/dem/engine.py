"""LIGGGHTS in this process, through its C interface."""

from __future__ import annotations

import contextlib
import ctypes
import os
import re
import subprocess
from pathlib import Path
from types import TracebackType

import numpy as np

from granbench.errors import EngineError

LIBRARY = "libliggghts.so.3"
REMEDY = "apt-get install liggghts libliggghts-dev (make setup does it)"

PLAIN_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
"""File names that LIGGGHTS accepts anywhere in an input line."""

_started = False


class SimulationFailure(EngineError):
    """A simulation failed for a reason of its own: run again, it would fail in the same way."""


class Liggghts:
    """One LIGGGHTS instance; a process can start only one (a second fails in MPI).

    Parameters
    ----------
    log_path : log of LIGGGHTS. An error inside LIGGGHTS ends the process; `last_error` reads it
        from the log.

    Raises
    ------
    EngineError
        If the library is missing, or this process has started an instance before.
    """

    def __init__(self, log_path: Path) -> None:
        global _started
        if _started:
            raise EngineError(
                "LIGGGHTS can be started only once in a process; run each simulation in a new "
                "process"
            )
        self.log_path = Path(log_path)
        self._library = _load_library()
        arguments: list[str | Path] = ["liggghts", "-log", self.log_path, "-screen", "none"]
        encoded = [os.fsencode(argument) for argument in arguments]
        argv = (ctypes.c_char_p * len(encoded))(*encoded)
        self._handle = ctypes.c_void_p()
        _started = True
        self._library.lammps_open_no_mpi(len(arguments), argv, ctypes.byref(self._handle))

    def __enter__(self) -> Liggghts:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free the instance; further calls do nothing."""
        if self._handle:
            self._library.lammps_close(self._handle)
            self._handle = ctypes.c_void_p()

    def command(self, *lines: str) -> None:
        """Execute input lines; an error ends the process, and its text is in the log."""
        for line in lines:
            self._library.lammps_command(self._handle, line.encode())

    def file_command(self, command: str, path: Path) -> None:
        """Execute a command on a file, from the folder of the file.

        LIGGGHTS splits its input at spaces and tabs, interprets ``$ # " & % *``, and reads at most
        2048 characters per line, so that a line must not contain the path of a user.

        Parameters
        ----------
        command : such as ``read_data``; the file is its only argument
        path : of the file; its folder exists

        Raises
        ------
        EngineError
            If the name of the file has characters that LIGGGHTS interprets.
        """
        path = Path(path)
        if not PLAIN_NAME.fullmatch(path.name):
            raise EngineError(
                f"LIGGGHTS cannot take the file name {path.name!r}; use letters, digits and . _ -"
            )
        # The simulation is alone in this process, so that it may change the working folder.
        with contextlib.chdir(path.parent):
            self.command(f"{command} {path.name}")

    def run(self, steps: int) -> None:
        """Run `steps` with a full set-up, which is needed after a fix or compute has changed."""
        self.command(f"run {steps} post no")

    def resume(self, steps: int) -> None:
        """Continue the last run by `steps` without set-up; only variables may have changed."""
        self.command(f"run {steps} pre no post no")

    def box_lengths(self) -> np.ndarray:
        """Return the box edges, (3,), m."""
        low, high = self._box()
        return high - low

    def box_low(self) -> np.ndarray:
        """Return the lower corner of the box, (3,), m."""
        return self._box()[0]

    def time_step(self) -> float:
        """Return the time step, s."""
        return self._global_double("dt")

    def current_step(self) -> int:
        """Return the number of the current step, which restart files contain."""
        self.command("variable current_step equal step")
        pointer = self._library.lammps_extract_variable(self._handle, b"current_step", None)
        step = ctypes.cast(pointer, ctypes.POINTER(ctypes.c_double))[0]
        self._library.lammps_free(ctypes.c_void_p(pointer))
        return int(step)

    def grain_count(self) -> int:
        """Return the number of grains; LIGGGHTS removes lost grains without an error."""
        return int(self._library.lammps_get_natoms(self._handle))

    def positions(self) -> np.ndarray:
        """Return grain centres by id, (grain, 3), m; some may lie slightly outside the box."""
        return self._gather("x", 3)

    def velocities(self) -> np.ndarray:
        """Return grain velocities by id, (grain, 3), m/s."""
        return self._gather("v", 3)

    def set_velocities(self, velocities: np.ndarray) -> None:
        """Set all velocities by id, (grain, 3), m/s; no set-up is needed afterwards."""
        ordered = np.ascontiguousarray(velocities, dtype=float)
        pointer = ordered.ctypes.data_as(ctypes.c_void_p)
        self._library.lammps_scatter_atoms(self._handle, b"v", 1, 3, pointer)

    def angular_velocities(self) -> np.ndarray:
        """Return angular velocities of the grains by id, (grain, 3), rad/s."""
        return self._gather("omega", 3)

    def forces(self) -> np.ndarray:
        """Return the total forces on the grains by id, (grain, 3), N."""
        return self._gather("f", 3)

    def radii(self) -> np.ndarray:
        """Return grain radii by id, (grain,), m."""
        return self._gather("radius", 1)[:, 0]

    def fix_vector(self, name: str, size: int) -> np.ndarray:
        """Return the first `size` entries of the global vector of a fix."""
        values = np.empty(size)
        for i in range(size):
            pointer = self._library.lammps_extract_fix(self._handle, name.encode(), 0, 1, i, 0)
            if not pointer:
                raise EngineError(f"LIGGGHTS has no fix {name!r} with a global vector")
            values[i] = ctypes.cast(pointer, ctypes.POINTER(ctypes.c_double))[0]
            self._library.lammps_free(ctypes.c_void_p(pointer))
        return values

    def compute_scalar(self, name: str) -> float:
        """Return the global scalar of a compute, evaluated now if it is not current."""
        return float(ctypes.cast(self._compute(name, 0, 0), ctypes.POINTER(ctypes.c_double))[0])

    def compute_local(self, name: str, rows: int, columns: int) -> np.ndarray:
        """Return the local array of a compute, (rows, columns), evaluated now if not current."""
        table = ctypes.POINTER(ctypes.POINTER(ctypes.c_double))
        first = ctypes.cast(self._compute(name, 2, 2), table)[0]
        # LIGGGHTS stores the rows in one block.
        return np.ctypeslib.as_array(first, (rows, columns)).copy()

    def _compute(self, name: str, style: int, kind: int) -> int:
        pointer = self._library.lammps_extract_compute(self._handle, name.encode(), style, kind)
        if not pointer:
            raise EngineError(f"LIGGGHTS has no compute {name!r} of the wanted kind")
        return int(pointer)

    def _gather(self, name: str, count: int) -> np.ndarray:
        values = np.empty((self.grain_count(), count))
        pointer = values.ctypes.data_as(ctypes.c_void_p)
        self._library.lammps_gather_atoms(self._handle, name.encode(), 1, count, pointer)
        return values

    def _box(self) -> tuple[np.ndarray, np.ndarray]:
        low = np.array([self._global_double(f"box{axis}lo") for axis in "xyz"])
        high = np.array([self._global_double(f"box{axis}hi") for axis in "xyz"])
        return low, high

    def _global_double(self, name: str) -> float:
        pointer = self._library.lammps_extract_global(self._handle, name.encode())
        return float(ctypes.cast(pointer, ctypes.POINTER(ctypes.c_double))[0])


def _load_library() -> ctypes.CDLL:
    try:
        # Global symbols, because the plug-ins of the MPI library of LIGGGHTS need them.
        library = ctypes.CDLL(LIBRARY, mode=ctypes.RTLD_GLOBAL)
    except OSError as missing:
        raise EngineError(f"the DEM engine {LIBRARY} cannot be loaded: {REMEDY}") from missing
    library.lammps_command.argtypes = [ctypes.c_void_p, ctypes.c_char_p]
    library.lammps_command.restype = ctypes.c_void_p
    library.lammps_close.argtypes = [ctypes.c_void_p]
    library.lammps_get_natoms.argtypes = [ctypes.c_void_p]
    library.lammps_get_natoms.restype = ctypes.c_int
    library.lammps_extract_global.argtypes = [ctypes.c_void_p, ctypes.c_char_p]
    library.lammps_extract_global.restype = ctypes.c_void_p
    integers = [ctypes.c_int] * 4
    library.lammps_extract_fix.argtypes = [ctypes.c_void_p, ctypes.c_char_p, *integers]
    library.lammps_extract_fix.restype = ctypes.c_void_p
    library.lammps_extract_compute.argtypes = [ctypes.c_void_p, ctypes.c_char_p, *integers[:2]]
    library.lammps_extract_compute.restype = ctypes.c_void_p
    library.lammps_extract_variable.argtypes = [
        ctypes.c_void_p, ctypes.c_char_p, ctypes.c_char_p,
    ]  # fmt: skip
    library.lammps_extract_variable.restype = ctypes.c_void_p
    library.lammps_gather_atoms.argtypes = [
        ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_int, ctypes.c_void_p,
    ]  # fmt: skip
    library.lammps_scatter_atoms.argtypes = library.lammps_gather_atoms.argtypes
    library.lammps_free.argtypes = [ctypes.c_void_p]
    return library


def last_error(log_path: Path) -> str | None:
    """Return the error with which LIGGGHTS ended the process that wrote a log.

    Parameters
    ----------
    log_path : log of LIGGGHTS

    Returns
    -------
    The last ``ERROR`` line of the log; None if there is no log or no such line, as after a signal
    or the loss of an MPI process
    """
    try:
        text = Path(log_path).read_text(errors="replace")
    except OSError:
        return None
    errors = [line.strip() for line in text.splitlines() if "ERROR" in line]
    return errors[-1] if errors else None


def engine_version() -> str:
    """Return name and version of the installed engine, such as ``LIGGGHTS 3.8.0``.

    Raises
    ------
    EngineError
        If LIGGGHTS is missing.
    """
    _load_library()
    try:
        answer = subprocess.run(
            ["dpkg-query", "-W", "-f", "${Version}", "liggghts"],
            capture_output=True, text=True, timeout=10, check=True,
        ).stdout  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return "LIGGGHTS 3"
    release = re.match(r"[\d.]+", answer)
    return f"LIGGGHTS {release.group(0) if release else answer} (Debian {answer})"
