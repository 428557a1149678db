"""Long work without a terminal says how far it is."""

import time

import pytest

from granbench.cli import progress
from granbench.cli.progress import progress_bar, progress_notes, shows_bar


@pytest.mark.parametrize("hidden", [False, True])
def test_long_work_reports_its_progress(hidden, monkeypatch, capsys):
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_NOTES", 0.05)
    with progress_notes(lambda: "driving csuh: 3 of 200 steps", hidden):
        time.sleep(0.3)
    said = capsys.readouterr().err.splitlines()
    if hidden:
        assert said == []
    else:
        assert said[0].startswith("note: driving csuh: 3 of 200 steps after")
    time.sleep(0.15)
    assert capsys.readouterr().err == ""


def test_nothing_is_shown_without_a_terminal(capsys):
    with progress_bar("working", 3) as bar:
        bar.advance()
        bar.move(2, text="nearly there")
    with progress_bar("fetching", shown="bytes") as bar:
        bar.move(10, 100)
    assert not shows_bar() and capsys.readouterr() == ("", "")


def test_a_terminal_shows_the_text_and_the_count(monkeypatch, capsys):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "80")
    assert shows_bar() and not shows_bar(hidden=True)
    with progress_bar("driving j2", 3) as bar:
        bar.move(2)
    shown = capsys.readouterr().err
    assert "driving j2" in shown and "2/3" in shown
