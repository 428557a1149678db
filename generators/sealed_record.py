"""Records of campaign jobs that show whether they, and the files they speak of, are still whole.

A record is a JSON file that carries the SHA-256 of its own content. That of a finished job also
lists every file of the result with size and SHA-256, so that a file that was truncated, changed
or lost later is noticed before anyone reads it.
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
"""A record is some kilobytes; what is larger than 16 MiB is no record."""
FIELDS: dict[str, type] = {
    "key": str,
    "digest": str,
    "function": str,
    "configuration": dict,
    "seed": int,
    "needs": list,
}


def sealed(record: dict[str, Any]) -> str:
    """The text of a record's file."""
    return json.dumps(record | {SEAL: _seal(record)}, indent=1, sort_keys=True) + "\n"


def read_record(path: Path) -> dict[str, Any] | None:
    """A record that is as it was written, or None.

    Records that were written before records were sealed are taken if their fields are sound.
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
    """What is wrong with the files of a finished job; None where all are as they were written.

    Parameters
    ----------
    folder : of the result
    record : as `read_record` gives it; an earlier version listed no files, which cannot be checked
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
    """A regular file, open for reading: no link is followed, and a FIFO is not waited for."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(f"{path} is not a file")
    return os.fdopen(descriptor, "rb")
