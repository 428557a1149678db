"""Checks of a file before it is read: kind and size."""

import os
import stat
import zipfile
from pathlib import Path

from granbench.errors import GranbenchError

_KINDS = (
    (stat.S_ISDIR, "is a folder; give a file in it"),
    (stat.S_ISFIFO, "is a pipe and not a file; write what it delivers into a file and give that"),
    (stat.S_ISCHR, "is a device and not a file; give a file"),
    (stat.S_ISBLK, "is a device and not a file; give a file"),
    (stat.S_ISSOCK, "is a socket and not a file; give a file"),
)


MOST_MEMBERS = 4_000
"""Largest number of members of an archive such as a workbook or an .npz file."""


def require_file(path: Path, error: type[GranbenchError], most_bytes: int) -> None:
    """Refuse a path that is not a regular file, or a file that is too large.

    Parameters
    ----------
    path : as the user gives it; links are followed
    error : type of the error
    most_bytes : size beyond which the file is refused

    Raises
    ------
    GranbenchError
        The given one, naming the file and the remedy. A pipe or a device is not opened.
    """
    try:
        found = os.stat(path)
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or problem
        raise error(f"{path}: cannot be read ({reason}); check the name") from problem
    for is_kind, what in _KINDS:
        if is_kind(found.st_mode):
            raise error(f"{path}: cannot be read: it {what}")
    if found.st_size > most_bytes:
        raise error(
            f"{path}: has {found.st_size / 1e6:,.0f} MB, more than the {most_bytes / 1e6:,.0f} MB "
            "that are read; give the part that is needed, or fewer rows"
        )


def require_archive(
    archive: zipfile.ZipFile, source: str, error: type[GranbenchError], most_bytes: int
) -> None:
    """Refuse an archive with members that cannot be unpacked, or too many or too large ones.

    Parameters
    ----------
    archive : opened; nothing is unpacked
    source : the file, as errors name it
    error : type of the error
    most_bytes : of all members unpacked, as the archive declares them

    Raises
    ------
    GranbenchError
        The given one, if a member is protected by a password, has an unsupported compression or the
        name of another, or if there are too many or too large members.
    """
    members = archive.infolist()
    if len(members) > MOST_MEMBERS:
        raise error(
            f"{source}: holds {len(members):,} files, more than {MOST_MEMBERS:,}; it is not a data "
            "file, or is damaged"
        )
    names: set[str] = set()
    for member in members:
        shown = repr(member.filename[:80])
        if member.flag_bits & 1:
            raise error(f"{source}: is protected by a password; save it without one")
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise error(
                f"{source}: its part {shown} has an unsupported compression (method "
                f"{member.compress_type}); save the file again"
            )
        if member.filename in names:
            raise error(f"{source}: its part {shown} occurs twice; save the file again")
        names.add(member.filename)
    if (size := sum(member.file_size for member in members)) > most_bytes:
        raise error(
            f"{source}: unpacks to {size / 1e6:,.0f} MB, more than the {most_bytes / 1e6:,.0f} MB "
            "that are read; keep what is needed, or export it as CSV"
        )
