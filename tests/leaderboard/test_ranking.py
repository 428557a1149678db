"""Who is ranked, who shares a rank, and what a page can show of a claim."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from small_cells import secant

from granbench.benchmark.scorecard import Score
from granbench.errors import SubmissionError
from granbench.leaderboard.build import build
from granbench.leaderboard.ranking import (
    RankedErrors,
    few_seeds,
    is_ranked,
    shared_ranks,
    standing,
)
from granbench.leaderboard.rows import Row
from granbench.leaderboard.submission import ModelFile, ModelReference, read_submission
from granbench.leaderboard.tables import headline_table


def scored(value: float, low: float | None = None, high: float | None = None) -> Score:
    return Score(
        axis="rollout", protocol="rollout", split="test", metric="stress_mse_mean",
        status="scored", value=value, low=low, high=high, n=9, by_seed=(value,),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("intervals", "ranks"),
    [
        ({"a": (1.0, 0.9, 1.1), "b": (2.0, 1.8, 2.2), "c": (3.0, 2.9, 3.1)}, ["1", "2", "3"]),
        ({"a": (1.0, 0.5, 2.5), "b": (2.0, 1.8, 2.2), "c": (3.0, 2.9, 3.1)}, ["1=", "1=", "3"]),
        ({"a": (1.0, 0.9, 1.1), "b": (2.0, 1.5, 2.6), "c": (2.5, 2.2, 3.1)}, ["1", "2=", "2="]),
        ({"a": (1.0, None, None), "b": (1.0, None, None), "c": (3.0, None, None)},
         ["1=", "1=", "3"]),
    ],
)  # fmt: skip
def test_overlapping_intervals_share_a_rank(intervals, ranks):
    scores = {name: scored(*interval) for name, interval in intervals.items()}
    assert list(shared_ranks(scores, "test", {}).values()) == ranks


def errors(value: np.ndarray) -> RankedErrors:
    count = len(value)
    names = np.arange(count).astype(str)
    return RankedErrors(value, names, names, np.full(count, "test"))


def test_paired_paths_distinguish_models_with_overlapping_intervals():
    """Paths differ by orders of magnitude, the models on each of them by a tenth."""
    hard = np.logspace(-3, 0, 40)
    paths = {"better": errors(hard), "worse": errors(1.1 * hard)}
    scores = {name: scored(float(one.value.mean()), 0.01, 1.0) for name, one in paths.items()}
    assert set(shared_ranks(scores, "test", {}).values()) == {"1="}
    assert shared_ranks(scores, "test", paths) == {"better": "1", "worse": "2"}
    shaken = hard * np.random.default_rng(0).choice([0.5, 1.5], len(hard))
    paths["worse"] = errors(shaken)
    scores["worse"] = scored(float(shaken.mean()), 0.01, 1.0)
    assert set(shared_ranks(scores, "test", paths).values()) == {"1="}


def spread(submission, *factors: float):
    """Another value for each seed; their mean is the score."""

    def changed(score: Score) -> Score:
        if score.status != "scored" or score.axis == "cost":
            return score
        value = score.value or 0.0
        by_seed = tuple(value * factor for factor in factors)
        return score.model_copy(update={"by_seed": by_seed, "value": sum(by_seed) / len(by_seed)})

    return submission.model_copy(
        update={"scores": tuple(map(changed, submission.scores)), "seeds": range(len(factors))}
    )


@pytest.fixture
def claimed(submission_file):
    return read_submission(submission_file())


def test_few_seeds_never_rank_above_three(claimed):
    three = spread(claimed, 0.9, 1.0, 1.1)
    lucky = spread(claimed, 0.5).model_copy(update={"name": "lucky"})
    two = spread(claimed, 0.5, 0.6).model_copy(update={"name": "two"})
    same = spread(claimed, 1.0, 1.0, 1.0).model_copy(update={"name": "one-answer"})
    assert [is_ranked(one) for one in (three, lucky, two, same)] == [True, False, False, True]
    assert standing(lucky) == "1 seed, not ranked" and standing(two) == "2 seeds, not ranked"
    assert standing(same) == "deterministic" and standing(three) == ""
    table = headline_table([lucky, two, three, same], "test")
    assert [row.name for row in table.rows][2:] == ["lucky", "two"]
    assert {row.name: bool(row.rank) for row in table.rows} == {
        "secant": True, "one-answer": True, "lucky": False, "two": False,
    }  # fmt: skip
    assert not any(cell.best for row in table.rows[2:] for cell in row.cells)
    assert table.leader in ("secant", "one-answer", "one-answer and secant")


def test_one_trained_network_under_three_seeds_is_not_ranked(claimed):
    same = spread(claimed, 1.0, 1.0, 1.0)
    files = tuple(
        ModelFile(path=f"a.model/{seed}/model.json", seed=seed, sha256="0" * 64, bytes=1)
        for seed in range(3)
    )
    network = ModelReference(baseline="gru", files=files)
    fitted = ModelReference(baseline="j2-fitted", files=files)
    for model, few in (
        (network, True),
        (fitted, False),
        (ModelReference(baseline="oracle"), False),
    ):
        row = same.model_copy(update={"predictions": None, "model": model})
        assert few_seeds(row) is few


Change = Callable[[dict], object]


def first_value(content: dict) -> dict:
    return next(score for score in content["scores"] if score.get("value"))


SHOWN: dict[str, Change] = {
    "horizon of 8,000": lambda c: c["curves"][0].update(
        horizon=[1, 8_000], value=[0.1, 0.2], low=[0.1, 0.1], high=[0.2, 0.3]
    ),
    "smallest number": lambda c: first_value(c).update(value=5e-324, low=5e-324, high=1e-323),
    "smallest curve": lambda c: c["curves"][0].update(
        value=[5e-324] * len(c["curves"][0]["value"])
    ),
    "no curves": lambda c: c.update(curves=[]),
}
REFUSED: dict[str, Change] = {
    "no splits": lambda c: c.update(scores=[{**s, "split": "all"} for s in c["scores"][:1]]),
    "n of 0": lambda c: [score.update(n=0) for score in c["scores"]],
    "n too large": lambda c: first_value(c).update(n=10**400),
    "value too large": lambda c: first_value(c).update(value=1e308),
    "horizon from 0": lambda c: c["curves"][0]["horizon"].__setitem__(0, 0),
    "horizon back": lambda c: c["curves"][0]["horizon"].reverse(),
    "no horizon": lambda c: c["curves"][0].update(horizon=[], value=[], low=[], high=[]),
    "horizon beyond counting": lambda c: c["curves"][0]["horizon"].__setitem__(-1, 10**400),
    "negative curve": lambda c: c["curves"][0]["value"].__setitem__(0, -1.0),
    "parameters": lambda c: c.update(parameters=10**400),
}  # fmt: skip


def changed_row(file: Path, change: Change) -> Row:
    content = json.loads(file.read_text())
    change(content)
    file.write_text(json.dumps(content))
    return Row(read_submission(file), file)


@pytest.mark.parametrize("case", SHOWN)
def test_odd_claims_are_shown(submission_file, tmp_path, case):
    page = build([changed_row(submission_file(), SHOWN[case])], tmp_path / "site")
    assert page.is_file()


@pytest.mark.parametrize("case", REFUSED)
def test_impossible_claims_are_refused(submission_file, tmp_path, case):
    with pytest.raises(SubmissionError, match="evaluate"):
        build([changed_row(submission_file(), REFUSED[case])], tmp_path / "site")
    assert not (tmp_path / "site").exists()


def test_the_page_marks_ranks_and_seeds(submission_file, submit, sealed, tmp_path):
    rows = [changed_row(submission_file(), lambda c: None)]
    one_seed = submit(secant("demo"), seeds=(0,))
    rows.append(Row(read_submission(one_seed), one_seed))
    text = (build(rows, tmp_path / "site").parent / "synthetic-1.0.0.html").read_text()
    assert "1 seed, not ranked" in text and 'class="rank"' in text
