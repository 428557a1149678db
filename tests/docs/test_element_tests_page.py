"""The page on element tests: its example runs, its commands exist, its tables are complete."""

from test_pages import ROOT, blocks, commands, printed, run_command

from granbench.paths.standard_tests import STANDARD_TESTS

PAGE = "docs/element_tests.md"


def test_the_example_runs_and_prints_the_strength():
    (example,) = blocks(PAGE, "python")
    assert printed(example).startswith("strength 100.0 kPa, held within ")


def test_every_command_on_the_page_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "path.csv").write_text("eps_xx,eps_yy,eps_xy\n0,0,0\n0.01,0,0\n")
    drives = [words for words in commands(PAGE) if words[0] == "drive"]
    assert len(drives) == 3
    for words in drives:
        run_command([*words, "--quiet"])
    assert {"test.csv", "test.png", "loop.csv", "answer.csv"} <= {
        file.name for file in tmp_path.iterdir()
    }


def test_every_standard_test_is_in_the_table():
    text = (ROOT / PAGE).read_text(encoding="utf-8")
    assert all(f"| `{name}` |" in text for name in STANDARD_TESTS)
