import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import pytest
from small_cells import Persistence, secant
from small_submissions import register_task

from granbench.benchmark.axes.physics.checks import CHECKS
from granbench.benchmark.metric import METRIC_VERSION
from granbench.data.replicates import replicate_scatter
from granbench.errors import ConfigurationError, SubmissionError
from granbench.leaderboard.board import Row, accept, accepted, default_folder, slug
from granbench.leaderboard.build import build
from granbench.leaderboard.rescoring import rescore
from granbench.leaderboard.submission import read_submission
from granbench.leaderboard.validation import validate


@pytest.fixture(scope="module")
def _board(_submissions, sealed, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("board")
    for name in ("secant", "persistence", "oracle"):
        accept(_submissions / f"{name}.json", folder, sealed)
    return folder


@pytest.fixture
def board(_board, tmp_path) -> Path:
    return Path(shutil.copytree(_board, tmp_path / "board"))


def test_an_accepted_submission_is_valid_in_its_folder(board, sealed):
    rows = accepted(board)
    assert [row.submission.name for row in rows] == ["oracle", "persistence", "secant"]
    for row in rows:
        assert row.submission.badge == "rescored"
        assert validate(row.file, sealed).name == row.submission.name
    assert not list(board.rglob("*.part"))


def test_a_model_is_accepted_once(board, submission_file, submit, sealed):
    with pytest.raises(SubmissionError, match="is on the board"):
        accept(submission_file(), board, sealed)
    assert accept(submission_file(), board, sealed, replace=True).is_file()
    copied = submission_file()
    content = json.loads(copied.read_text()) | {"name": "my own"}
    copied.write_text(json.dumps(content))
    with pytest.raises(SubmissionError, match="predictions are those of 'secant'"):
        accept(copied, board, sealed)


def test_the_board_needs_every_axis_and_three_seeds(submit, sealed, tmp_path):
    with pytest.raises(SubmissionError, match="at least 3 seeds"):
        accept(submit(Persistence(), seeds=(0, 1)), tmp_path / "board", sealed)
    with pytest.raises(SubmissionError, match="was left out"):
        accept(submit(Persistence(), axes=["rollout"]), tmp_path / "board", sealed)
    assert not (tmp_path / "board").exists()


class Page(HTMLParser):
    """Collects links and identifiers of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        for name, value in attrs:
            if name in ("href", "src") and value:
                self.links.append(value)
            if name == "id" and value:
                self.anchors.add(value)


def test_the_site_links_only_to_itself_and_to_the_models_code(board, tmp_path):
    index = build(accepted(board), tmp_path / "site")
    pages = list(index.parent.glob("*.html"))
    assert {page.name for page in pages} == {"index.html", "synthetic-1.0.0.html"}
    for page in pages:
        text = page.read_text()
        content = Page(text)
        for link in content.links:
            if link.startswith("#"):
                assert link[1:] in content.anchors
            elif link.startswith("https://"):
                assert link == "https://example.org/code"
            elif link != "data:,":
                assert (index.parent / link).is_file(), link
        assert "@import" not in text
        assert text.count("url(") == text.count("url(#")  # clip paths of the page's own charts
    assert "http" not in (index.parent / "board.js").read_text()
    assert not list(tmp_path.glob(".site*"))


def test_the_json_board_agrees_with_the_submissions(board, sealed, tmp_path):
    scatter = replicate_scatter(sealed)
    build(accepted(board), tmp_path / "site", {("synthetic", "1.0.0"): scatter})
    content = json.loads((tmp_path / "site" / "leaderboard.json").read_text())
    (task,) = content["tasks"]
    assert task["replicate_scatter"]["floor_mse"] == scatter.floor_mse
    by_name = {item["name"]: item for item in task["submissions"]}
    assert by_name["oracle"]["role"] == "ceiling"
    assert by_name["persistence"]["role"] == "floor"
    secant_scores = {
        (s["protocol"], s["split"], s["metric"]): s.get("value")
        for s in by_name["secant"]["scores"]
    }
    card = read_submission(board / "synthetic" / "secant.json")
    for score in card.scores:
        if score.group == "all":
            assert secant_scores[score.protocol, score.split, score.metric] == score.value
    assert (tmp_path / "site" / by_name["secant"]["file"]).is_file()


def test_the_site_is_the_same_when_built_again(board, tmp_path):
    build(accepted(board), tmp_path / "one")
    build(accepted(board), tmp_path / "two")
    for file in (tmp_path / "one").rglob("*"):
        if file.is_file():
            other = tmp_path / "two" / file.relative_to(tmp_path / "one")
            assert file.read_bytes() == other.read_bytes()


def test_an_older_site_is_replaced_and_nothing_else_is_touched(board, tmp_path):
    rows = accepted(board)
    site = tmp_path / "site"
    build(rows, site)
    (site / "left-over.html").write_text("old")
    build(rows[:1], site)
    assert not (site / "left-over.html").exists()
    treasure = tmp_path / "treasure"
    treasure.mkdir()
    (treasure / "thesis.tex").write_text("years of work")
    with pytest.raises(ConfigurationError, match="not a leaderboard"):
        build(rows, treasure)
    assert (treasure / "thesis.tex").read_text() == "years of work"
    with pytest.raises(ConfigurationError, match="is a file"):
        build(rows, treasure / "thesis.tex")


def test_a_failure_while_building_leaves_the_old_site(board, tmp_path, monkeypatch):
    rows = accepted(board)
    site = tmp_path / "site"
    build(rows, site)
    before = (site / "index.html").read_bytes()

    def full_disk(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("granbench.leaderboard.build.shutil.copyfile", full_disk)
    with pytest.raises(ConfigurationError, match="No space left"):
        build(rows[:1], site)
    assert (site / "index.html").read_bytes() == before
    assert [path.name for path in tmp_path.glob(".site*")] == []


def test_an_empty_board_has_a_page(tmp_path):
    assert "no submission yet" in build([], tmp_path / "site").read_text()


def test_text_of_a_submission_cannot_run_as_code_in_a_browser(submit, tmp_path):
    attack = '<script>alert("1")</script>"><img src=x onerror=alert(1)>'
    file = submit(Persistence(), title=attack, authors=(attack,), training_data=attack,
                  licence=attack, command=attack)  # fmt: skip
    build([Row(read_submission(file), file)], tmp_path / "site")
    page = (tmp_path / "site" / "synthetic-1.0.0.html").read_text()
    assert "<script>alert" not in page and "<img" not in page
    assert page.count("<script") == 1


def test_names_that_give_one_file_are_refused(submit, tmp_path):
    rows = []
    for name in ("my-net", "My net"):
        file = submit(Persistence(), name=name)
        rows.append(Row(read_submission(file), file))
    with pytest.raises(SubmissionError, match="choose another name"):
        build(rows, tmp_path / "site")
    assert slug("My net") == "my-net"


def test_what_does_not_apply_is_shown_with_its_reason(submit, tmp_path):
    file = submit(Persistence())
    build([Row(read_submission(file), file)], tmp_path / "site")
    page = (tmp_path / "site" / "synthetic-1.0.0.html").read_text()
    assert re.search(r'title="the model does not predict the void ratio">n/a<', page)


def test_the_best_model_is_marked_and_floors_are_not(board, tmp_path):
    build(accepted(board), tmp_path / "site")
    page = (tmp_path / "site" / "synthetic-1.0.0.html").read_text()
    for row in re.findall(r"<tr.*?</tr>", page, flags=re.DOTALL):
        if ">floor<" in row or ">ceiling<" in row:
            assert 'class="frame"' in row and "num best" not in row
    assert "num best" in page


def test_the_replicate_scatter_is_a_line_of_whole_paths_only(board, sealed, tmp_path):
    scatter = {("synthetic", "1.0.0"): replicate_scatter(sealed)}
    build(accepted(board), tmp_path / "site", scatter)
    page = (tmp_path / "site" / "synthetic-1.0.0.html").read_text()
    figures = re.findall(r"<figcaption>(.*?)</figcaption>(.*?)</figure>", page, flags=re.DOTALL)
    assert len(figures) == 2 * 5
    for title, figure in figures:
        assert ("<title>replicate scatter" in figure) == (not title.startswith("Windows"))


def test_a_page_of_several_models_gives_each_its_colour(submit, tmp_path):
    rows = []
    for name in ("one", "two", "three"):
        file = submit(secant(name))
        rows.append(Row(read_submission(file), file))
    build(rows, tmp_path / "site")
    page = (tmp_path / "site" / "synthetic-1.0.0.html").read_text()
    lines = re.findall(r"<title>(\w+):[^<]*</title><path [^>]*stroke: (#\w+)", page)
    strokes = {colour: name for name, colour in lines}
    swatches = dict(re.findall(r'style="background:(#\w+)"></span><a href="#about-(\w+)"', page))
    assert strokes == swatches and len(swatches) == 3


def test_violations_and_costs_have_tables_with_reasons(submit, tmp_path):
    file = submit(Persistence())
    build([Row(read_submission(file), file)], tmp_path / "site")
    page = (tmp_path / "site" / "synthetic-1.0.0.html").read_text()
    assert "<h2>Physics</h2>" in page and "<h2>Cost</h2>" in page
    for check in CHECKS.values():
        assert f">{check.title}</button>" in page and f"<dt>{check.title}</dt>" in page
    assert 'title="the records hold principal components, which cannot be turned">n/a<' in page
    assert 'title="this task has no ground-truth cell">n/a<' in page
    assert "<small>passes</small>" in page
    assert "recomputed_mse" not in page  # no model made these records


def test_a_model_that_breaks_a_law_shows_on_how_many_paths(submit, tmp_path):
    class Creeping(Persistence):
        name = "creeping"

        def step(self, dstrain, state):
            return super().step(dstrain, 0.99 * state)

    file = submit(Creeping())
    build([Row(read_submission(file), file)], tmp_path / "site")
    page = (tmp_path / "site" / "synthetic-1.0.0.html").read_text()
    assert "<small>100 % of paths</small>" in page


def test_an_axis_without_scores_has_no_table(submit, tmp_path):
    file = submit(Persistence(), axes=["rollout"])
    build([Row(read_submission(file), file)], tmp_path / "site")
    page = (tmp_path / "site" / "synthetic-1.0.0.html").read_text()
    assert "<h2>Physics</h2>" not in page and "<h2>Cost</h2>" not in page


def test_a_board_of_an_older_metric_version_is_scored_again(board, sealed, monkeypatch):
    file = board / "synthetic" / "secant.json"
    before = read_submission(file)
    content = json.loads(file.read_text())
    content["metric_version"] = "0.9"
    content["scores"] = content["scores"][:1]
    file.write_text(json.dumps(content))
    register_task(sealed, monkeypatch)
    assert list(rescore(board)) == [file]
    assert read_submission(file) == before
    assert validate(file, sealed).name == "secant"
    assert list(rescore(board)) == []


def test_submissions_of_the_checkout_follow_the_metric_version():
    rows = accepted(default_folder())
    assert rows
    assert {row.submission.metric_version for row in rows} == {METRIC_VERSION}
