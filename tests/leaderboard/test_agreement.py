"""How closely numbers must agree that were computed again, by the tolerance of their metric."""

import pytest

from granbench.benchmark.registry import axes, find_metric
from granbench.benchmark.scorecard import Curve, Scales, Score, Scorecard
from granbench.benchmark.tolerance import Tolerance
from granbench.errors import SubmissionError
from granbench.leaderboard.agreement import RERUN, RESCORED, compare, tolerance_of
from granbench.leaderboard.rows import default_folder
from granbench.leaderboard.submission import Submission, read_submission


def number(axis: str, protocol: str, metric: str, n: int = 50) -> Score:
    found = find_metric(axis, metric)
    assert found is not None
    return Score(
        axis=axis, protocol=protocol, split="test", metric=metric, status="scored", value=1.0, n=n,
        unit=found.unit, by_seed=(1.0,),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("place", "claimed", "again", "agree"),
    [
        # A mean of many numbers: a thousandth.
        (("rollout", "rollout", "stress_mse_mean"), 1.0005, 1.0, True),
        (("rollout", "rollout", "stress_mse_mean"), 1.002, 1.0, False),
        (("rollout", "rollout", "stress_11_mse_mean"), 1.0005, 1.0, True),
        (("rollout", "rollout", "relative_error_mean"), 0.101, 0.1, False),
        # A share of steps: a thousandth of all of them.
        (("window", "window", "error_point_share"), 0.0008, 0.0, True),
        (("window", "window", "error_point_share"), 0.0012, 0.0, False),
        (("noise", "noise-0.5", "recomputed_error_point_share"), 0.0008, 0.0, True),
        # A share of paths: one path of fifty.
        (("rollout", "rollout", "failed_share"), 0.02, 0.0, True),
        (("rollout", "rollout", "failed_share"), 0.04, 0.0, False),
        (("physics", "tangent", "violated_share"), 0.02, 0.0, True),
        (("physics", "tangent", "kink_share"), 0.04, 0.0, False),
        # A step: one.
        (("rollout", "rollout", "divergence_step_median"), 31.0, 30.0, True),
        (("rollout", "rollout", "divergence_step_median"), 32.0, 30.0, False),
        # A violation: a tenth of what is allowed, or of a tenth where nothing is.
        (("physics", "tangent", "violation_worst"), 9e-5, 0.0, True),
        (("physics", "tangent", "violation_worst"), 2e-4, 0.0, False),
        (("physics", "compression", "violation_worst"), 0.009, 0.0, True),
        (("physics", "compression", "violation_worst"), 0.02, 0.0, False),
        # An analysis: two per cent of a value, or of all of a share.
        (("embedded", "embedded-explicit", "point_stress_mse"), 0.101, 0.1, True),
        (("embedded", "embedded-explicit", "point_stress_mse"), 0.104, 0.1, False),
        (("embedded", "embedded-explicit", "error_point_growth"), 0.015, 0.0, True),
        (("embedded", "embedded-explicit", "error_point_share"), 0.03, 0.0, False),
        # A clock: a factor of ten.
        (("cost", "cost", "update_seconds_100"), 9.0, 1.0, True),
        (("cost", "cost", "update_seconds_100"), 11.0, 1.0, False),
        (("embedded", "embedded-implicit", "cell_speed_ratio"), 0.11, 1.0, True),
        (("cost", "cost", "update_ratio_10000"), 0.09, 1.0, False),
        # These are not measured: they are counted, or read from a file.
        (("cost", "cost", "parameters"), 1001.0, 999.0, False),
        (("cost", "cost", "training_seconds"), 2.0, 1.0, False),
    ],
)
def test_a_rerun_agrees_as_far_as_machines_do(place, claimed, again, agree) -> None:
    score = number(*place)
    assert RERUN.holds(score, claimed, again) is agree
    # Numbers from the same predictions agree to what is written of them.
    assert not RESCORED.holds(score, claimed, again)
    assert RESCORED.holds(score, again * (1.0 + 1e-8), again)


def test_a_value_and_none_never_agree() -> None:
    score = number("rollout", "rollout", "stress_mse_mean")
    for how in (RERUN, RESCORED):
        assert how.holds(score, None, None)
        assert not how.holds(score, None, 1.0) and not how.holds(score, 1.0, None)


def test_every_metric_has_the_tolerance_that_it_declares() -> None:
    for axis in axes():
        for metric in axis.metrics(["11"]):
            for name in axis.names:
                assert tolerance_of(name, metric.name) is metric.tolerance


def test_a_score_of_no_axis_is_compared_as_a_value() -> None:
    assert tolerance_of("an axis of another package", "its metric") == Tolerance("value")


@pytest.fixture
def row() -> Submission:
    return read_submission(default_folder() / "dem-triaxial" / "lstm.json")


def again(row: Submission, **changes: object) -> Scorecard:
    fields = {
        "metric_version": row.metric_version,
        "normalisation": row.normalisation,
        "scores": row.scores,
        "curves": row.curves,
    }
    return Scorecard(**fields | changes)


@pytest.mark.parametrize("how", [RERUN, RESCORED], ids=["rerun", "rescored"])
def test_a_row_agrees_with_itself(row, how) -> None:
    assert compare(row, again(row), "lstm.json", how) == ()


def test_what_is_missing_or_foreign_is_named(row) -> None:
    last = row.scores[-1]
    key = " / ".join(last.key)
    fewer = row.model_copy(update={"scores": row.scores[:-1]})
    with pytest.raises(SubmissionError, match=f"score {key} is missing"):
        compare(fewer, again(row), "lstm.json", RESCORED)
    with pytest.raises(SubmissionError, match=f"score {key} is not one"):
        compare(row, again(row, scores=row.scores[:-1]), "lstm.json", RESCORED)
    with pytest.raises(SubmissionError, match="curve .* is missing"):
        compare(row.model_copy(update={"curves": ()}), again(row), "lstm.json", RESCORED)
    with pytest.raises(SubmissionError, match="curve .* is not one"):
        compare(row, again(row, curves=()), "lstm.json", RESCORED)


@pytest.mark.parametrize("field", ["axis", "metric"])
def test_a_score_that_no_installed_package_defines_is_named(row, field: str) -> None:
    unknown = row.scores[0].model_copy(update={field: "beyond"})
    claimed = row.model_copy(update={"scores": (*row.scores, unknown)})
    with pytest.raises(SubmissionError, match=f"{field} 'beyond'"):
        compare(claimed, again(row), "lstm.json", RESCORED)


@pytest.mark.parametrize("field", ["protocol", "metric"])
def test_a_curve_that_no_installed_package_defines_is_named(row, field: str) -> None:
    unknown = row.curves[0].model_copy(update={field: "beyond"})
    claimed = row.model_copy(update={"curves": (*row.curves, unknown)})
    with pytest.raises(SubmissionError, match=f"{field} 'beyond'"):
        compare(claimed, again(row), "lstm.json", RESCORED)


@pytest.mark.parametrize("field", ["value", "low", "by_seed", "n", "unit"])
def test_a_field_that_differs_is_refused(row, field) -> None:
    def changed(score: Score) -> Score:
        if score.key != target.key:
            return score
        new = {"value": 2.0 * score.value, "low": None, "by_seed": score.by_seed[:-1], "n": 1,
               "unit": "Pa"}  # fmt: skip
        return score.model_copy(update={field: new[field]})

    target = next(s for s in row.scores if s.metric == "stress_mse_mean" and s.low is not None)
    claimed = row.model_copy(update={"scores": tuple(map(changed, row.scores))})
    with pytest.raises(SubmissionError, match="stress_mse_mean cannot be reproduced"):
        compare(claimed, again(row), "lstm.json", RERUN)


def test_a_curve_that_differs_is_refused(row) -> None:
    def moved(curve: Curve) -> Curve:
        return curve.model_copy(update={"value": tuple(1.01 * value for value in curve.value)})

    claimed = row.model_copy(update={"curves": tuple(map(moved, row.curves))})
    with pytest.raises(SubmissionError, match="curve .* cannot be reproduced"):
        compare(claimed, again(row), "lstm.json", RERUN)


def test_another_normalisation_is_refused(row) -> None:
    scales = Scales(stress={name: 1.0 for name in row.normalisation.stress}, void_ratio=None)
    with pytest.raises(SubmissionError, match="normalisation"):
        compare(row, again(row, normalisation=scales), "lstm.json", RERUN)
