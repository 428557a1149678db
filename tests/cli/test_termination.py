"""SIGTERM unwinds a command once, with the exit code that shells expect."""

import signal

import pytest
import typer

from granbench.cli.termination import stopped_by_sigterm


def test_sigterm_ends_the_block_and_a_second_one_does_not_interrupt_its_cleaning_up(capsys):
    before = signal.getsignal(signal.SIGTERM)
    steps = []
    with pytest.raises(typer.Exit) as left, stopped_by_sigterm():
        try:
            signal.raise_signal(signal.SIGTERM)
            steps.append("went on")
        finally:
            signal.raise_signal(signal.SIGTERM)
            steps.append("cleaned up")
    assert steps == ["cleaned up"]
    assert left.value.exit_code == 143
    assert capsys.readouterr() == ("", "terminated; run the same command again to continue\n")
    assert signal.getsignal(signal.SIGTERM) is before


def test_without_sigterm_nothing_changes(capsys):
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(ZeroDivisionError), stopped_by_sigterm():
        raise ZeroDivisionError
    assert capsys.readouterr() == ("", "")
    assert signal.getsignal(signal.SIGTERM) is before
