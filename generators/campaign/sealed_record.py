"""Records of campaign jobs, with which damage to them and to the results is noticed.

A record is a JSON file that contains the SHA-256 of its own content. The record of a finished job
also lists every file of the result with its size and SHA-256, so that a file that was truncated,
changed or lost later is noticed before it is read.
"""

import hashlib
import json
import os
import stat
from pathlib import Path
from typing import Any

SEAL = "record_sha256"
FILES = "files"
MOST_BYTES = 1 << 24
"""A record has some kilobytes; a file of more than 16 MiB is not a record."""
FIELDS: dict[str, type] = {
    "key": str,
    "digest": str,
    "function": str,
    "configuration": dict,
    "seed": int,
    "needs": list,
}


def sealed(record: dict[str, Any]) -> str:
    """Text of the file of a record."""
    return json.dumps(record | {SEAL: _seal(record)}, indent=1, sort_keys=True) + "\n"


def read_record(path: Path) -> dict[str, Any] | None:
    """Read a record; None if it is missing or not as it was written.

    Records of earlier versions, without a hash, are accepted if their fields have the right types.
    """
    try:
        record = json.loads(_content(path, MOST_BYTES))
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(record, dict):
        return None
    if any(not isinstance(record.get(name), kind) for name, kind in FIELDS.items()):
        return None
    seal = record.pop(SEAL, None)
    if seal is None:
        record.pop(FILES, None)
        return record
    return record if seal == _seal(record) else None


def digests_of(folder: Path) -> dict[str, list[Any]]:
    """Size in bytes and SHA-256 of every file below a folder, by its path in the folder."""
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    return {file.relative_to(folder).as_posix(): _digest(file) for file in files}


def damage(folder: Path, record: dict[str, Any]) -> str | None:
    """Return what is wrong with the files of a finished job, or None if nothing is.

    Parameters
    ----------
    folder : of the result
    record : as `read_record` returns it; records of earlier versions list no files, which are then
        not checked
    """
    for name, (size, sha256) in record.get(FILES, {}).items():
        try:
            found = _digest(folder / name)
        except FileNotFoundError:
            return f"{name} is missing"
        except OSError as error:
            return f"{name} cannot be read ({error.strerror or error})"
        if found[0] != size:
            return f"{name} has {found[0]} bytes instead of {size}"
        if found[1] != sha256:
            return f"{name} was changed"
    return None


def _seal(record: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(record, sort_keys=True).encode()).hexdigest()


def _digest(path: Path) -> list[Any]:
    with _opened(path) as file:
        return [os.fstat(file.fileno()).st_size, hashlib.file_digest(file, "sha256").hexdigest()]


def _content(path: Path, most_bytes: int) -> bytes:
    with _opened(path) as file:
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise ValueError(f"{path} has more than {most_bytes} bytes")
    return content


def _opened(path: Path) -> Any:
    """Open a regular file for reading; links are not followed, and FIFOs do not block."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(f"{path} is not a file")
    return os.fdopen(descriptor, "rb")
