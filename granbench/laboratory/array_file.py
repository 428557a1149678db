"""Reading of .npz files; the declared sizes are checked before anything is allocated."""

import math
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from granbench.errors import DatasetError
from granbench.files.bounded_reading import read_bounded
from granbench.files.input_file import require_archive

MOST_UNPACKED = 256_000_000
"""Largest size of all arrays of a file, bytes."""
MOST_TESTS = 10_000
"""Largest number of tests in one file."""

Arrays = Mapping[str, NDArray]


def read_arrays(path: Path) -> dict[str, NDArray]:
    """The arrays of an .npz file by name; numbers and text, no objects.

    Raises
    ------
    DatasetError
        If the file is damaged, protected or too large, an array is of another kind or declares
        another size than it has, or the file breaks the bounds of
        `granbench.files.bounded_reading`.
    """
    return read_bounded(path, DatasetError, arrays_of, str(path))


def arrays_of(path: str) -> dict[str, NDArray]:
    """The arrays of an .npz file, read without bounds on memory and time; see `read_arrays`."""
    try:
        with zipfile.ZipFile(path) as archive:
            require_archive(archive, path, DatasetError, MOST_UNPACKED)
            if "mimetype" in archive.namelist() or "word/document.xml" in archive.namelist():
                raise DatasetError(
                    f"{path}: is a document of an office program; save the table as .xlsx or CSV"
                )
            found = {}
            for member in archive.infolist():
                if member.filename.endswith(".npy"):
                    name = member.filename.removesuffix(".npy")
                    with archive.open(member) as file:
                        found[name] = _array(file, member.file_size, f"{path}: its array {name!r}")
            return found
    except (OSError, zipfile.BadZipFile, zlib.error, EOFError) as problem:
        raise DatasetError(
            f"{path}: cannot be read as .npz ({problem}); copy the file again, or export the test "
            "as CSV"
        ) from problem


def _array(file: IO[bytes], size: int, source: str) -> NDArray:
    try:
        version = np.lib.format.read_magic(file)
        read_header = (
            np.lib.format.read_array_header_1_0
            if version == (1, 0)
            else np.lib.format.read_array_header_2_0
        )
        shape, fortran_order, dtype = read_header(file)
    except (OSError, zipfile.BadZipFile, zlib.error, EOFError):
        raise
    except Exception as problem:  # the header is Python source that NumPy parses
        raise DatasetError(
            f"{source} has a header that cannot be read ({type(problem).__name__}); copy the file "
            "again, or export the test as CSV"
        ) from problem
    if dtype.kind not in "biufU":
        raise DatasetError(
            f"{source} has the type {dtype}, which is neither numbers nor text; save it as numbers"
        )
    declared, held = math.prod(shape) * dtype.itemsize, size - file.tell()
    if declared != held or min(shape, default=1) < 0:
        raise DatasetError(
            f"{source} declares {declared:,} bytes of data but has {held:,}; copy the file "
            "again, or export the test as CSV"
        )
    flat = np.frombuffer(file.read(declared), dtype=dtype) if declared else np.empty(0, dtype)
    return flat.reshape(shape, order="F" if fortran_order else "C")


def require_shape(
    path: Path, arrays: Arrays, name: str, shape: tuple[int | str, ...]
) -> tuple[int, ...]:
    """The shape of an array of numbers, checked against the required one.

    Parameters
    ----------
    path : of the file, for the error
    arrays : with the array `name`
    shape : for each dimension its length, or a word if the length is free but not zero; the same
        word stands for the same length

    Raises
    ------
    DatasetError
        If it has another shape, or is not numbers.
    """
    found, wanted = arrays[name].shape, tuple(str(length) for length in shape)
    lengths: dict[str, int] = {}
    fits = len(found) == len(shape)
    for length, part in zip(found, shape, strict=False):
        needed = part if isinstance(part, int) else lengths.setdefault(part, length)
        fits = fits and 0 < length == needed
    if not fits or arrays[name].dtype.kind not in "iuf":
        raise DatasetError(
            f"{path}: its array {name!r} has the shape {found} and the type {arrays[name].dtype}, "
            f"but numbers ({', '.join(wanted)}) are needed; export the test as CSV"
        )
    return found


def require_few(path: Path, tests: int) -> None:
    """Refuse a file of more tests than `MOST_TESTS`."""
    if tests > MOST_TESTS:
        raise DatasetError(
            f"{path}: has {tests:,} tests, more than the {MOST_TESTS:,} that are read; keep fewer"
        )
