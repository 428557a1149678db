"""Text from files made safe for a terminal."""

import re

_UNPRINTABLE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)
"""Control characters but for newline and tab, what reverses the direction of a line, and halves of
surrogate pairs, which no terminal can be given."""


def printable(text: object) -> str:
    r"""A text whose control characters are written out as ``\u001b``.

    A terminal obeys such characters: text of a file could clear the screen, change its title or
    overwrite what stands there. Newlines and tabs stay. The escapes are those of JSON, so that a
    JSON document keeps its meaning.
    """
    return _UNPRINTABLE.sub(lambda found: f"\\u{ord(found[0]):04x}", str(text))
