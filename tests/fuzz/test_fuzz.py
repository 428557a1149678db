"""A minute of the fuzzer: no case fails, and the same seed gives the same cases."""

from pathlib import Path

import pytest
from kinds import KINDS, make_case
from run import fuzz, report

CASES = {"laboratory": 60, "path": 60, "load-path": 60, "task": 60, "mesh": 40}
"""Number of cases of each kind; of the others, which take longer, `OTHERS`."""
OTHERS = 24


@pytest.mark.parametrize("kind", KINDS)
def test_no_changed_file_makes_reading_fail(kind: str, tmp_path: Path) -> None:
    outcomes = fuzz(
        [kind], seed=2026, cases=CASES.get(kind, OTHERS), seconds=None, out=tmp_path / "failures"
    )
    assert not outcomes[kind].failures, report(outcomes)
    assert outcomes[kind].counts["refused"] > 0


@pytest.mark.parametrize("kind", ["dataset", "model", "path"])
def test_the_same_seed_gives_the_same_cases(kind: str, tmp_path: Path) -> None:
    KINDS[kind].seeds(tmp_path / "seeds")
    one, two = (
        make_case(kind, tmp_path / "seeds", f"7/{kind}/3", tmp_path / name) for name in ("a", "b")
    )
    files = [path.relative_to(one) for path in sorted(one.rglob("*")) if path.is_file()]
    assert files
    for file in files:
        assert (one / file).read_bytes() == (two / file).read_bytes()


@pytest.mark.parametrize("fault", ["raises", "waits", "allocates", "ends"])
def test_every_kind_of_failure_is_reported(
    fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GRANBENCH_FUZZ_FAULT", fault)
    outcomes = fuzz(["path"], seed=0, cases=1, seconds=None, out=tmp_path)
    (failure,) = outcomes["path"].failures
    expected = {"raises": "KeyError", "waits": "hang", "allocates": "MemoryError", "ends": "crash"}
    assert failure["error"] == expected[fault]
    kept = tmp_path / failure["case"].replace("/", "-")
    assert "run.py --case 0/path/0" in (kept / "failure.txt").read_text()
    assert (kept / "a.csv").is_file()
