"""What may be claimed of analyses that a model has lost: nothing that its own run does not give."""

from collections.abc import Callable

import pytest

from granbench.benchmark.scorecard import Score, Scorecard
from granbench.errors import SubmissionError
from granbench.leaderboard.agreement import RERUN, compare, lost_results
from granbench.leaderboard.rows import default_folder
from granbench.leaderboard.submission import Submission, read_submission


@pytest.fixture(scope="module")
def row() -> Submission:
    """A network that loses every analysis of its task."""
    return read_submission(default_folder() / "fem-ime" / "gru.json")


@pytest.fixture(scope="module")
def card(row) -> Scorecard:
    """What its run gives."""
    return Scorecard(
        metric_version=row.metric_version,
        normalisation=row.normalisation,
        scores=row.scores,
        curves=row.curves,
    )


def changed(row: Submission, metric: str, new: Callable[[float], float]) -> Submission:
    def one(score: Score) -> Score:
        if score.axis != "embedded" or score.metric != metric or score.value is None:
            return score
        by_seed = tuple(new(value) for value in score.by_seed)
        return score.model_copy(update={"by_seed": by_seed, "value": sum(by_seed) / len(by_seed)})

    return row.model_copy(update={"scores": tuple(map(one, row.scores))})


def test_what_the_run_gives_is_reproduced(row, card):
    assert lost_results(card.scores)
    assert compare(row, card, "gru.json", RERUN) == ()


@pytest.mark.parametrize(
    ("metric", "new"),
    [
        ("error_point_share", lambda value: 0.0),
        ("reached_share", lambda value: 1.0),
        ("reaction_error", lambda value: value / 3.5),
        ("point_stress_mse", lambda value: value / 10.0),
        ("volumetric_strain_error", lambda value: 0.01),
        ("error_point_share", lambda value: value + 1.0),
    ],
)
def test_numbers_of_another_order_are_refused(row, card, metric, new):
    with pytest.raises(SubmissionError, match=f"{metric} cannot be reproduced"):
        compare(changed(row, metric, new), card, "gru.json", RERUN)


@pytest.mark.parametrize(
    ("metric", "new"),
    [
        ("reaction_error", lambda value: value / 2.9),
        ("acceleration_ratio", lambda value: 1.0),
        ("error_point_share", lambda value: max(0.0, value - 0.4)),
    ],
)
def test_numbers_of_the_same_order_are_named_and_not_taken(row, card, metric, new):
    named = compare(changed(row, metric, new), card, "gru.json", RERUN)
    assert named and all(metric in label for label in named)


def test_a_curve_of_another_order_is_refused(row, card):
    flat = tuple(
        curve.model_copy(update={"value": tuple(0.0 for _ in curve.value)})
        if curve.metric == "error_point_share"
        else curve
        for curve in row.curves
    )
    with pytest.raises(SubmissionError, match="curve embedded-.* cannot be reproduced"):
        compare(row.model_copy(update={"curves": flat}), card, "gru.json", RERUN)
