"""Sections of an MSH file, and the numbers in them."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from granbench.errors import ConfigurationError

DAMAGED = "the file is damaged or cut off; write it again"


class Numbers:
    """Numbers of one section, read in order from text or from binary data.

    Parameters
    ----------
    section : name
    raw : content
    order : byte order, ``<`` or ``>``; None for text
    size : bytes of a count
    """

    def __init__(self, section: str, raw: bytes, order: str | None, size: int) -> None:
        self.section, self.order, self.size = section, order, size
        self.raw = raw
        self.words = raw.split() if order is None else []
        self.place = 0

    def integers(self, count: int) -> np.ndarray:
        """The next 4-byte integers."""
        return self._next(count, "i4")

    def counts(self, count: int) -> np.ndarray:
        """The next integers of the size in the file's header."""
        return self._next(count, f"u{self.size}")

    def count(self) -> int:
        """The next integer of that size."""
        return int(self.counts(1)[0])

    def reals(self, count: int) -> np.ndarray:
        """The next floating-point numbers."""
        return self._next(count, "f8")

    def _next(self, count: int, kind: str) -> np.ndarray:
        if self.order is None:
            if not 0 <= count <= len(self.words) - self.place:
                raise self.too_few()
            words = self.words[self.place : self.place + count]
            self.place += count
            try:
                numbers = np.array(words, dtype="S").astype(float)
            except ValueError:
                raise ConfigurationError(
                    f"section ${self.section} has {_first_word(words)!r} where a number belongs; "
                    f"{DAMAGED}"
                ) from None
            if kind == "f8":
                return numbers
            whole = np.isfinite(numbers) & (numbers == np.round(numbers)) & (abs(numbers) < 2**53)
            if not whole.all():
                raise ConfigurationError(
                    f"section ${self.section} has {numbers[~whole][0]:g} where a whole number "
                    f"belongs; {DAMAGED}"
                )
            return numbers.astype(np.int64)
        width = int(kind[1:])
        if not 0 <= count <= (len(self.raw) - self.place) // width:
            raise self.too_few()
        found = np.frombuffer(self.raw, self.order + kind, count, self.place)
        self.place += count * width
        return found.astype(float if kind == "f8" else np.int64)

    def too_few(self) -> ConfigurationError:
        """The error of a section that ends before its last number."""
        return ConfigurationError(f"section ${self.section} has too few numbers; {DAMAGED}")


def _first_word(words: list[bytes]) -> str:
    for word in words:
        try:
            float(word)
        except ValueError:
            return word.decode("latin-1")[:40]
    return "a word"


def header(raw: bytes) -> tuple[int, str | None, int, int]:
    """Major version, byte order (None for text), size of counts, and where sections begin."""
    start = raw.find(b"$MeshFormat")
    if start < 0:
        if b"$NOD" in raw[:2000]:
            raise ConfigurationError("is of MSH version 1; save it in Gmsh as version 4.1 or 2.2")
        begin = raw[:30].split(b"\n")[0].decode("latin-1")
        raise ConfigurationError(
            f"is no Gmsh file: it begins with {begin!r} and has no section $MeshFormat; write it "
            "with Gmsh, version 4.1 or 2.2"
        )
    line_end = raw.find(b"\n", start)
    first, _, rest = raw[line_end + 1 :].partition(b"\n")
    words = first.split()
    try:
        version, binary, size = float(words[0]), int(words[1]), int(words[2])
    except (IndexError, ValueError):
        raise ConfigurationError(f"section $MeshFormat is not one of Gmsh; {DAMAGED}") from None
    if not (2.0 <= version < 3.0 or version == 4.1) or binary not in (0, 1) or size not in (4, 8):
        raise ConfigurationError(
            f"is of MSH version {words[0].decode('latin-1')[:20]}; save it in Gmsh as version 4.1 "
            "or 2.2 (Mesh.MshFileVersion, or gmsh FILE -save -format msh41)"
        )
    order = None
    if binary:
        order = "<" if rest[:4] == b"\1\0\0\0" else ">"
        if rest[:4] not in (b"\1\0\0\0", b"\0\0\0\1"):
            raise ConfigurationError(f"its header says binary, but its data are not; {DAMAGED}")
    return int(version), order, size, line_end + len(first) + 2


def sections(raw: bytes, begin: int) -> Iterator[tuple[str, bytes]]:
    """Name and content of each section, those before $MeshFormat left out."""
    mark = re.compile(rb"^\$([A-Za-z][A-Za-z0-9]*)[ \t]*\r?\n", re.MULTILINE)
    end = raw.find(b"$EndMeshFormat", begin)
    place = begin if end < 0 else end
    while section := mark.search(raw, place):
        name = section[1].decode()
        if name.startswith("End"):
            place = section.end()
            continue
        # Binary data may hold any bytes: the end is a line of its own.
        close = raw.find(b"\n$End" + section[1], section.end() - 1)
        if close < 0:
            raise ConfigurationError(f"section ${name} has no end; {DAMAGED}")
        yield name, raw[section.end() : close + 1]
        place = close + 1
