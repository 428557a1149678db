"""Text from files made safe for a terminal."""

import re

_UNPRINTABLE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)
"""Control characters except newline and tab, characters that reverse the direction of a line, and
halves of surrogate pairs, which cannot be written to a terminal."""


def printable(text: object) -> str:
    r"""A text with control characters written as ``\u001b``.

    A terminal interprets such characters: text from a file could clear the screen, change the title
    or overwrite other text. Newlines and tabs are kept. The escapes are those of JSON, so that a
    JSON document keeps its meaning.
    """
    return _UNPRINTABLE.sub(lambda found: f"\\u{ord(found[0]):04x}", str(text))
