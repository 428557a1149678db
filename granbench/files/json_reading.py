"""Reading of JSON from outside: submissions, model files, attributes of datasets.

JSON may hold documents of any size and depth, integers of any length, NaN, repeated keys, and text
that no file can hold. Such values would cause failures later, far from their origin, so they are
refused here, in one sentence.
"""

import json
import math
from pathlib import Path
from typing import Any, NoReturn

from granbench.errors import GranbenchError

LARGEST_JSON = 8_000_000
"""Largest size of a JSON document in bytes; the largest on the leaderboard has 0.4 MB."""
DEEPEST_JSON = 32
"""Largest nesting of objects and lists; a submission needs five levels."""
LARGEST_INTEGER = 2**63 - 1
"""Largest magnitude of an integer that files and NumPy hold."""


class _Refused(Exception):
    """A fault of a document; raised by the hooks of the parser."""


def read_json(
    path: Path, error: type[GranbenchError], *, remedy: str, largest: int = LARGEST_JSON
) -> Any:
    """The value in a JSON file.

    Parameters
    ----------
    path : the file
    error : type of the error
    remedy : what the user can do, the end of every error text
    largest : size in bytes that the file may have

    Raises
    ------
    GranbenchError
        The given one: the file is missing, is a device or a pipe, is not UTF-8, or is refused by
        `parse_json`.
    """
    try:
        if not path.exists():
            raise error(f"{path}: there is no such file; {remedy}")
        if not path.is_file():
            raise error(f"{path}: cannot be read (it is not a regular file); {remedy}")
        with path.open("rb") as file:
            content = file.read(largest + 1)
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or problem
        raise error(f"{path}: cannot be read ({reason}); {remedy}") from problem
    return parse_json(content, str(path), error, remedy=remedy, largest=largest)


def parse_json(
    text: str | bytes,
    source: str,
    error: type[GranbenchError],
    *,
    remedy: str,
    largest: int = LARGEST_JSON,
) -> Any:
    """The value of a JSON text.

    Parameters
    ----------
    text : the document; bytes are UTF-8
    source : name of the document in errors
    error : type of the error
    remedy : what the user can do, the end of every error text
    largest : bytes, or characters, that it may have

    Raises
    ------
    GranbenchError
        The given one: the text is larger than `largest`, is not JSON, is nested deeper than
        `DEEPEST_JSON`, repeats a key in one object, holds NaN, infinity or an integer beyond
        `LARGEST_INTEGER`, or text that UTF-8 cannot hold.
    """
    if len(text) > largest:
        raise error(f"{source}: has more than {largest / 1e6:g} MB, which is too large; {remedy}")
    try:
        if isinstance(text, bytes):
            text = text.decode("utf-8-sig")
        value = json.loads(
            text,
            object_pairs_hook=_distinct,
            parse_int=_integer,
            parse_float=_number,
            parse_constant=_not_a_number,
        )
        _check_depth_and_text(value)
    except UnicodeDecodeError as problem:
        raise error(f"{source}: is not UTF-8 text; {remedy}") from problem
    except json.JSONDecodeError as problem:
        place = f"line {problem.lineno}, column {problem.colno}: {problem.msg}"
        raise error(f"{source}: is not JSON ({place}); {remedy}") from problem
    except RecursionError as problem:
        raise error(f"{source}: {_TOO_DEEP}; {remedy}") from problem
    except _Refused as problem:
        raise error(f"{source}: {problem}; {remedy}") from problem
    return value


def parse_json_object(
    text: str | bytes, source: str, error: type[GranbenchError], *, remedy: str
) -> dict[str, Any]:
    """The object in a JSON text, by key; like `parse_json`, but refuses other values.

    Raises
    ------
    GranbenchError
        See `parse_json`.
    """
    return _object(parse_json(text, source, error, remedy=remedy), source, error, remedy)


def read_json_object(path: Path, error: type[GranbenchError], *, remedy: str) -> dict[str, Any]:
    """The object in a JSON file, by key; like `read_json`, but refuses other values.

    Raises
    ------
    GranbenchError
        See `read_json`.
    """
    return _object(read_json(path, error, remedy=remedy), str(path), error, remedy)


def _object(value: Any, source: str, error: type[GranbenchError], remedy: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise error(f"{source}: must be a JSON object, {{...}}; {remedy}")
    return value


_TOO_DEEP = f"is nested too deeply (more than {DEEPEST_JSON} levels)"


def _distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                raise _Refused(f"has the key {shortened(key)} twice in one object; keep one")
            seen.add(key)
    return found


def _integer(digits: str) -> int:
    # The length first: Python refuses to convert thousands of digits.
    if len(digits) > 20 or abs(int(digits)) > LARGEST_INTEGER:
        raise _Refused(f"has the integer {shortened(digits)}, which is beyond 64 bits")
    return int(digits)


def _number(digits: str) -> float:
    value = float(digits)
    if math.isinf(value):
        raise _Refused(f"has the number {shortened(digits)}, which is beyond double precision")
    return value


def _not_a_number(name: str) -> NoReturn:
    raise _Refused(f"holds {name}, which is not a JSON number")


def _check_depth_and_text(value: Any) -> None:
    level, depth = [value], 0
    while level:
        if depth > DEEPEST_JSON:
            raise _Refused(_TOO_DEEP)
        inner: list[Any] = []
        for item in level:
            if isinstance(item, str):
                _check_text(item)
            elif isinstance(item, dict):
                for key in item:
                    _check_text(key)
                inner.extend(item.values())
            elif isinstance(item, list):
                inner.extend(item)
        level, depth = inner, depth + 1


def _check_text(text: str) -> None:
    if "\0" in text:
        raise _Refused(f"has a NUL character in the text {shortened(text)}")
    try:
        text.encode()
    except UnicodeEncodeError:
        raise _Refused(f"has half of a surrogate pair in the text {shortened(text)}") from None


def shortened(text: str, longest: int = 40) -> str:
    """A text in quotes for an error, shortened if it is long, in ASCII if it is not printable."""
    return ascii(text) if len(text) <= longest else f"{text[:longest]!a}..."
