"""Faults that pydantic finds in the content of a file, as text for an error."""

from pydantic import ValidationError


def first_fault(error: ValidationError) -> str:
    """The first field that is wrong and what is wrong with it, such as ``'hidden' must be ...``."""
    first = error.errors()[0]
    field = ".".join(str(part) for part in first["loc"])
    message = first["msg"].removeprefix("Value error, ")
    return f"{field!r}: {message}" if field else message
