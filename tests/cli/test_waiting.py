"""Long work without a terminal says how far it is."""

import time

import pytest

from granbench.cli import waiting
from granbench.cli.waiting import spoken_progress


@pytest.mark.parametrize("hidden", [False, True])
def test_long_work_says_how_far_it_is(hidden, monkeypatch, capsys):
    monkeypatch.setattr(waiting, "SECONDS_BETWEEN_NOTES", 0.05)
    with spoken_progress(lambda: "driving csuh: 3 of 200 steps", hidden):
        time.sleep(0.3)
    said = capsys.readouterr().err.splitlines()
    if hidden:
        assert said == []
    else:
        assert said[0].startswith("note: driving csuh: 3 of 200 steps after")
    time.sleep(0.15)
    assert capsys.readouterr().err == ""
