"""Faults that pydantic finds in the content of a file, as text for an error."""

import json
import re
from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

EXPECTED = {
    "string_type": "be text in quotes",
    "float_type": "be a number, without quotes",
    "finite_number": "be a finite number",
    "mapping_type": "be an object {...}",
    "dict_type": "be an object {...}",
    "model_type": "be an object {...}",
    "dataclass_type": "be an object {...}",
    "tuple_type": "be a list [...]",
    "list_type": "be a list [...]",
    "float_parsing": "be a number",
}
"""What a value must do, by the type of pydantic's error, where pydantic names types of Python."""

PATTERNS = {"^[a-z0-9][a-z0-9-]*$": "hold small letters, digits and dashes only"}
"""What a text must do, by the pattern that it has to match."""

LONGEST_NAME, LONGEST_VALUE = 200, 60
"""Characters of a field's name and of its value that are shown."""


def first_fault(error: ValidationError, unknown: str = "remove it") -> str:
    """The first field that is wrong and what is wrong with it.

    Such as ``'paths.steps' is -1 but must be greater than 0``.

    Parameters
    ----------
    error : of pydantic
    unknown : what to do with a field that the file cannot have
    """
    faults = error.errors(include_url=False)
    first: Mapping[str, Any] = faults[0]
    field = ".".join(map(str, first["loc"]))[:LONGEST_NAME]
    more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
    if first["type"] == "value_error":
        text = first["msg"].removeprefix("Value error, ")
        return f"{field!r}: {text}{more}" if field else f"{text}{more}"
    return f"{repr(field) if field else 'the content'} {_predicate(first, unknown)}{more}"


def _predicate(fault: Mapping[str, Any], unknown: str) -> str:
    if fault["type"] == "missing":
        return "is missing; add it"
    if fault["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        return f"is unknown; {unknown}"
    if fault["type"] == "too_short" and fault["ctx"]["min_length"] == 1:
        return "is empty; list at least one"
    value = json.dumps(fault["input"], default=str)[:LONGEST_VALUE]
    pattern = fault.get("ctx", {}).get("pattern")
    rule = EXPECTED.get(fault["type"]) or PATTERNS.get(pattern)
    if rule is None:
        sentence = re.fullmatch(r"\w+ should (.*)", fault["msg"], flags=re.DOTALL)
        if sentence is None:
            return f"is {value}: {fault['msg']}"
        rule = sentence[1]
    return f"is {value} but must {rule}"
