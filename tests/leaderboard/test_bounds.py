"""The texts and lists of a submission have bounds."""

import json
from pathlib import Path

import pytest

from granbench.errors import SubmissionError
from granbench.leaderboard.submission import read_submission

LONG = "x" * 30_000
BOUNDED = {
    "long environment": (lambda c: c["environment"].update(machine=LONG), "environment.machine"),
    "escape in the environment": (lambda c: c["environment"].update(torch="\x1b[2J"), "torch"),
    "empty environment": (lambda c: c["environment"].update(python=""), "environment.python"),
    "long title": (lambda c: c.update(title=LONG), "title"),
    "line break in the title": (lambda c: c.update(title="a\nb"), "title"),
    "long licence": (lambda c: c.update(licence=LONG), "licence"),
    "many authors": (lambda c: c.update(authors=["A"] * 1_000), "authors"),
    "long author": (lambda c: c.update(authors=[LONG]), r"authors\.0"),
    "long address": (lambda c: c.update(code=f"https://example.org/{LONG}"), "code"),
    "escape in the address": (lambda c: c.update(code="https://a/\x1b[2J"), "code"),
    "negative seed": (lambda c: c.update(seeds=[-1, 0, 1]), r"seeds\.0"),
    "seed as text": (lambda c: c.update(seeds=["a"]), r"seeds\.0"),
    "seed with a point": (lambda c: c.update(seeds=[0.5]), r"seeds\.0"),
    "huge seed": (lambda c: c.update(seeds=[1e30]), r"seeds\.0"),
    "seed beyond 64 bits": (lambda c: c.update(seeds=[10**23]), "seeds|bits"),
    "many seeds": (lambda c: c.update(seeds=list(range(100_000))), "seeds"),
    "many parameters": (lambda c: c.update(parameters=2**80), "beyond 64 bits"),
    "null environment": (lambda c: c.update(environment=None), "environment"),
    "long metric version": (lambda c: c.update(metric_version=LONG), "metric_version"),
}


@pytest.mark.parametrize("case", BOUNDED)
def test_a_field_beyond_its_bound_is_named(case: str, submission_file) -> None:
    file: Path = submission_file()
    content = json.loads(file.read_text())
    change, field = BOUNDED[case]
    change(content)
    file.write_text(json.dumps(content))
    with pytest.raises(SubmissionError, match=field) as caught:
        read_submission(file)
    assert len(str(caught.value)) < 500
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("digits", [19, 100, 5_000])
def test_integers_of_any_length_are_one_sentence(digits: int, submission_file) -> None:
    file: Path = submission_file()
    text = json.dumps(json.loads(file.read_text()) | {"parameters": "@"})
    file.write_text(text.replace('"@"', "9" * digits))
    with pytest.raises(SubmissionError, match="beyond 64 bits|parameters"):
        read_submission(file)


def test_committed_rows_keep_within_the_bounds() -> None:
    folder = Path(__file__).parents[2] / "leaderboard/submissions"
    assert [read_submission(file).name for file in sorted(folder.glob("*/*.json"))]
