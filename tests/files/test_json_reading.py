"""Laws of JSON from outside: plain values come back, everything else is one sentence."""

import json
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from granbench.errors import ModelError, SubmissionError
from granbench.files.json_reading import DEEPEST_JSON, parse_json, read_json, read_json_object

PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63) + 1, 2**63 - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0")),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text("abc"), inner, max_size=4),
    max_leaves=20,
)


@given(PLAIN)
def test_plain_values_come_back(value):
    assert parse_json(json.dumps(value), "a", ModelError, remedy="fix it") == value


HOSTILE = {
    "5,000 digits": ('{"seed": ' + "9" * 5000 + "}", "integer"),
    "beyond int64": ('{"seed": 100000000000000000000000}', "integer"),
    "just beyond int64": (f'{{"seed": {2**63}}}', "integer"),
    "NaN": ('{"a": NaN}', "NaN"),
    "-Infinity": ('{"a": -Infinity}', "Infinity"),
    "infinite number": ('{"a": 1e999}', "double precision"),
    "deep list": ("[" * 100_000 + "]" * 100_000, "nested too deeply"),
    "deep object": ('{"a":' * 100_000 + "1" + "}" * 100_000, "nested too deeply"),
    "deep enough to parse": ("[" * 50 + "]" * 50, "nested too deeply"),
    "key twice": ('{"a": {"b": 1, "b": 2}}', "'b' twice"),
    "half a surrogate": ('{"a": "\\ud800"}', "surrogate"),
    "half a surrogate as key": ('{"\\udfff": 1}', "surrogate"),
    "NUL": ('["a\\u0000b"]', "NUL"),
    "not JSON": ('{"a": }', "line 1, column 7"),
    "nothing": ("", "is not JSON"),
    "not UTF-8": (b'{"a": "\xff\xfe"}', "UTF-8"),
    "UTF-16": ('{"a": 1}'.encode("utf-16"), "UTF-8"),
    "too large": ('"' + "a" * 9_000_000 + '"', "too large"),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_a_malicious_document_is_an_error_of_one_sentence(case: str, tmp_path: Path):
    document, said = HOSTILE[case]
    file = tmp_path / "a.json"
    file.write_bytes(document if isinstance(document, bytes) else document.encode())
    with pytest.raises(SubmissionError, match=rf"^.*a\.json: .*{said}") as caught:
        read_json(file, SubmissionError, remedy="write it again")
    sentence = str(caught.value)
    assert sentence.endswith("; write it again") and "\n" not in sentence and len(sentence) < 400


def test_depth_up_to_the_bound_is_read():
    text = "[" * DEEPEST_JSON + "]" * DEEPEST_JSON
    assert parse_json(text, "a", ModelError, remedy="") is not None


def test_what_is_not_a_regular_file_does_not_block(tmp_path: Path):
    os.mkfifo(tmp_path / "pipe.json")
    for name, said in (("pipe.json", "regular"), ("none.json", "no such file")):
        with pytest.raises(ModelError, match=said):
            read_json(tmp_path / name, ModelError, remedy="check it")
    with pytest.raises(ModelError, match="regular"):
        read_json(Path("/dev/zero"), ModelError, remedy="check it")


def test_a_byte_order_mark_is_no_fault_and_a_list_is_no_object(tmp_path: Path):
    (tmp_path / "a.json").write_bytes(b'\xef\xbb\xbf{"a": [1]}')
    assert read_json_object(tmp_path / "a.json", ModelError, remedy="") == {"a": [1]}
    (tmp_path / "a.json").write_text("[1]")
    with pytest.raises(ModelError, match="must be a JSON object"):
        read_json_object(tmp_path / "a.json", ModelError, remedy="fix it")
