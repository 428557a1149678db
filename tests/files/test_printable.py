"""No text of a file gives orders to a terminal."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from granbench.files.printable import printable

ORDERS = {
    "clear": "\x1b[2J",
    "title": "\x1b]0;owned\x07",
    "one byte": "\x9b31m",
    "overwrite": "good\rbad",
    "backspace": "a\bb",
    "right to left": "\u202egnp",
    "isolate": "\u2066x",
    "delete": "\x7f",
}


@pytest.mark.parametrize("case", ORDERS)
def test_control_characters_are_written_out(case: str):
    shown = printable(ORDERS[case])
    assert shown.isprintable()
    assert "\\u" in shown


@given(st.text(st.characters(exclude_categories=["Cs"])))
def test_json_keeps_its_meaning_and_clean_text_its_form(text: str):
    document = json.dumps({"a": text}, ensure_ascii=False)
    assert json.loads(printable(document)) == {"a": text}
    if all(character.isprintable() or character in "\n\t" for character in text):
        assert printable(text) == text
