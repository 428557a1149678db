"""LIGGGHTS, driven in this process through its C interface."""

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
"""What LIGGGHTS takes as a file name whatever its position in an input line."""

_started = False


class SimulationFailure(EngineError):
    """A simulation that its own physics ended: run again, it would end in the same way."""


class Liggghts:
    """One LIGGGHTS instance; a process can hold one in its life (a second fails in MPI).

    Parameters
    ----------
    log_path : file for LIGGGHTS' own log; its last ``ERROR:`` line is what `last_error` reads,
        because an error inside LIGGGHTS ends the process

    Raises
    ------
    EngineError : the library is missing, or this process has had an instance before
    """

    def __init__(self, log_path: Path) -> None:
        global _started
        if _started:
            raise EngineError(
                "LIGGGHTS can be started once in a process; run each simulation in its own "
                "worker process"
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
        """Execute input lines; an error in one ends the process with its text in the log."""
        for line in lines:
            self._library.lammps_command(self._handle, line.encode())

    def file_command(self, command: str, path: Path) -> None:
        """Execute a command on a file, which is given by its bare name in its own folder.

        LIGGGHTS splits its input at spaces and tabs, gives ``$ # " & % *`` a meaning, and has
        2048 characters for a line: no path of a user's may be part of one.

        Parameters
        ----------
        command : such as ``read_data``; its one argument is the file
        path : of the file; its folder exists

        Raises
        ------
        EngineError : the bare name has characters that mean something to LIGGGHTS
        """
        path = Path(path)
        if not PLAIN_NAME.fullmatch(path.name):
            raise EngineError(
                f"LIGGGHTS cannot take the file name {path.name!r}; use letters, digits and . _ -"
            )
        # One simulation has this process to itself, so that nobody else minds the folder.
        with contextlib.chdir(path.parent):
            self.command(f"{command} {path.name}")

    def run(self, steps: int) -> None:
        """Run `steps` with a full set-up, as needed after any fix or compute has changed."""
        self.command(f"run {steps} post no")

    def resume(self, steps: int) -> None:
        """Run `steps` on from the last run without set-up; only variables may have changed."""
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
        """Return the number of the current step, which a restart file carries on."""
        self.command("variable current_step equal step")
        pointer = self._library.lammps_extract_variable(self._handle, b"current_step", None)
        step = ctypes.cast(pointer, ctypes.POINTER(ctypes.c_double))[0]
        self._library.lammps_free(ctypes.c_void_p(pointer))
        return int(step)

    def grain_count(self) -> int:
        """Return how many grains are left; LIGGGHTS drops lost ones without a word."""
        return int(self._library.lammps_get_natoms(self._handle))

    def positions(self) -> np.ndarray:
        """Return grain centres by id, (grain, 3), m; they may lie slightly outside the box."""
        return self._gather("x", 3)

    def velocities(self) -> np.ndarray:
        """Return grain velocities by id, (grain, 3), m/s."""
        return self._gather("v", 3)

    def set_velocities(self, velocities: np.ndarray) -> None:
        """Set all velocities by id, (grain, 3), m/s, in place: no set-up is needed after it."""
        ordered = np.ascontiguousarray(velocities, dtype=float)
        pointer = ordered.ctypes.data_as(ctypes.c_void_p)
        self._library.lammps_scatter_atoms(self._handle, b"v", 1, 3, pointer)

    def angular_velocities(self) -> np.ndarray:
        """Return grain spins by id, (grain, 3), rad/s."""
        return self._gather("omega", 3)

    def forces(self) -> np.ndarray:
        """Return the total forces on the grains by id, (grain, 3), N."""
        return self._gather("f", 3)

    def radii(self) -> np.ndarray:
        """Return grain radii by id, (grain,), m."""
        return self._gather("radius", 1)[:, 0]

    def fix_vector(self, name: str, size: int) -> np.ndarray:
        """Return the first `size` entries of a fix's global vector."""
        values = np.empty(size)
        for i in range(size):
            pointer = self._library.lammps_extract_fix(self._handle, name.encode(), 0, 1, i, 0)
            if not pointer:
                raise EngineError(f"LIGGGHTS has no fix {name!r} with a global vector")
            values[i] = ctypes.cast(pointer, ctypes.POINTER(ctypes.c_double))[0]
            self._library.lammps_free(ctypes.c_void_p(pointer))
        return values

    def compute_scalar(self, name: str) -> float:
        """Return a compute's global scalar, evaluated now if it is not current."""
        return float(ctypes.cast(self._compute(name, 0, 0), ctypes.POINTER(ctypes.c_double))[0])

    def compute_local(self, name: str, rows: int, columns: int) -> np.ndarray:
        """Return a compute's local array, (rows, columns), evaluated now if not current."""
        table = ctypes.POINTER(ctypes.POINTER(ctypes.c_double))
        first = ctypes.cast(self._compute(name, 2, 2), table)[0]
        # LIGGGHTS keeps the rows in one block.
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
        # Global symbols: the MPI that LIGGGHTS links loads its plug-ins against them.
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
    """Return LIGGGHTS' own words for why it ended the process that wrote `log_path`.

    Returns
    -------
    str : the text of the log's last ``ERROR`` line; None where there is no log or no such line,
        as after a signal or the loss of an MPI process
    """
    try:
        text = Path(log_path).read_text(errors="replace")
    except OSError:
        return None
    errors = [line.strip() for line in text.splitlines() if "ERROR" in line]
    return errors[-1] if errors else None


def engine_version() -> str:
    """Return the installed engine's name and version, such as ``LIGGGHTS 3.8.0``."""
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
