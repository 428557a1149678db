import subprocess
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from granbench.benchmark.axes.along_paths.path_errors import PathErrors
from granbench.benchmark.axes.along_paths.protocols import PROTOCOLS
from granbench.benchmark.comparison import CEILING
from granbench.benchmark.metric import METRIC_VERSION
from granbench.benchmark.predictions import evaluated
from granbench.benchmark.scoring import score, scored_predictions
from granbench.errors import SubmissionError


def test_scoring_needs_no_torch():
    code = "import sys, granbench.benchmark.scoring; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_truth_scores_exactly_zero_on_every_axis(predicted, truth, normalisation):
    card = score(predicted(), truth, normalisation)
    scored = [item for item in card.scores if item.status == "scored"]
    assert {item.protocol for item in scored} == set(PROTOCOLS)
    assert {item.split for item in scored} == {"test", "ood-psd"}
    assert all(item.value == 0.0 for item in scored)
    assert all(value == 0.0 for curve in card.curves for value in curve.value)


def test_an_error_of_one_training_deviation_scores_one(predicted, truth, normalisation):
    card = score(predicted(normalisation.std["stress"], None), truth, normalisation)
    # Two roundings of 3e-5 relative, at stresses of up to some ten deviations.
    assert card.find("rollout", "test", "stress_mse_mean").value == pytest.approx(1.0, rel=1e-3)
    for label in ("11", "22", "33"):
        metric = f"stress_{label}_mse_mean"
        assert card.find("window", "ood-psd", metric).value == pytest.approx(1.0, rel=1e-3)


def test_the_joint_error_has_equal_weights_for_four_outputs(predicted, truth, normalisation):
    card = score(predicted(0.0, 2.0 * normalisation.std["void_ratio"]), truth, normalisation)
    assert card.find("rollout", "test", "void_ratio_mse_mean").value == pytest.approx(4, rel=1e-2)
    assert card.find("rollout", "test", "output_mse_mean").value == pytest.approx(1, rel=1e-2)


def test_context_steps_are_never_counted(predicted, truth, normalisation):
    predictions = predicted()
    predictions["stress"][..., 0, :] = np.nan
    card = score(predictions, truth, normalisation)
    assert card.find("rollout", "test", "stress_mse_worst").value == 0.0
    assert card.find("rollout", "test", "failed_share").value == 0.0


def test_a_broken_run_counts_in_the_mean(predicted, truth, normalisation):
    predictions = predicted()
    test_paths = np.flatnonzero(truth["split"].values == "test")
    predictions["stress"][:, :, test_paths[0], 21:] = np.nan
    card = score(predictions, truth, normalisation)
    paths = len(test_paths)
    steps = truth.sizes["step"] - 1
    lost = (steps - 20) / steps
    mean = card.find("rollout", "test", "stress_mse_mean")
    assert mean.n == paths
    assert mean.value == pytest.approx(CEILING**2 * lost / paths)
    assert card.find("rollout", "test", "stress_mse_worst").value == pytest.approx(
        CEILING**2 * lost
    )
    assert card.find("rollout", "test", "failed_share").value == pytest.approx(1.0 / paths)
    assert card.find("rollout", "test", "diverged_share").value == pytest.approx(1.0 / paths)
    assert card.find("rollout", "test", "error_point_share").value == pytest.approx(lost / paths)
    assert card.find("rollout", "ood-psd", "failed_share").value == 0.0


def test_the_step_of_divergence_is_the_first_without_recovery(predicted, truth, normalisation):
    predictions = predicted()
    predictions["stress"][..., 5, :] *= 3.0  # an error point with recovery
    predictions["stress"][..., 12:, :] *= 3.0  # lost from step 12 on
    scored = scored_predictions(predictions, truth, normalisation)
    for name in ("rollout", "noise-0.5"):
        assert (PathErrors.of(scored, PROTOCOLS[name]).divergence_step == 12).all()
    card = score(predictions, truth, normalisation)
    step = card.find("rollout", "test", "divergence_step_median")
    assert (step.value, step.unit) == (12.0, "step")


def test_what_does_not_apply_is_there_with_a_reason(predicted, truth, normalisation):
    card = score(predicted(void_ratio_error=None), truth, normalisation)
    missing = card.find("rollout", "test", "void_ratio_mse_mean")
    assert missing.status == "not_applicable" and "void ratio" in missing.reason
    never = card.find("rollout", "test", "divergence_step_median")
    assert never.status == "not_applicable" and "diverge" in never.reason
    stepwise = card.find("single-step", "test", "diverged_share")
    assert stepwise.status == "not_applicable"
    assert card.find("embedded", "test", "all").status == "not_applicable"
    recomputed = card.find("noise-0.5", "test", "recomputed_mse_mean")
    assert recomputed.status == "not_applicable" and "ground-truth" in recomputed.reason


def test_an_axis_left_out_is_there_as_not_run(predicted, truth, normalisation):
    card = score(predicted(protocols=("rollout",)), truth, normalisation)
    whole = score(predicted(), truth, normalisation)
    assert [item.key for item in card.scores] == [item.key for item in whole.scores]
    left_out = card.find("noise-0.5", "test", "stress_mse_mean")
    assert left_out.status == "not_run" and "noise" in left_out.reason


def test_every_score_is_unique_and_has_a_family_breakdown(predicted, truth, normalisation):
    card = score(predicted(), truth, normalisation)
    keys = [item.key for item in card.scores]
    assert len(keys) == len(set(keys))
    assert card.metric_version == METRIC_VERSION
    families = set(truth["loading_family"].values.astype(str))
    groups = {item.group for item in card.scores if item.split == "test"}
    assert groups == {"all", *families}


def test_families_average_to_the_whole(predicted, truth, normalisation):
    noise = np.random.default_rng(1).normal(size=truth["stress"].shape)
    card = score(predicted(1e5 * noise), truth, normalisation)
    parts = [
        item
        for item in card.scores
        if (item.protocol, item.split, item.metric) == ("rollout", "test", "stress_mse_mean")
    ]
    whole = next(item for item in parts if item.group == "all")
    others = [item for item in parts if item.group != "all"]
    assert sum(item.n for item in others) == whole.n
    mean = sum(item.n * item.value for item in others) / whole.n
    assert mean == pytest.approx(whole.value, rel=1e-8)


def test_seeds_are_averaged_and_listed(predicted, truth, normalisation):
    error = np.array([1.0, 2.0, 3.0])[:, None, None, None, None] * normalisation.std["stress"]
    card = score(predicted(error), truth, normalisation)
    mean = card.find("rollout", "test", "stress_mse_mean")
    assert mean.by_seed == pytest.approx((1.0, 4.0, 9.0), rel=1e-3)
    assert mean.value == pytest.approx(14.0 / 3.0, rel=1e-3)
    worst = card.find("rollout", "test", "stress_mse_worst")
    assert worst.value == pytest.approx(9.0, rel=2e-3) and worst.low is None


def test_window_errors_are_binned_by_distance_from_given_truth(predicted, truth, normalisation):
    horizon = PROTOCOLS["window"].horizon(truth.sizes["step"])
    error = horizon[:, None] * 0.1 * normalisation.std["stress"]
    card = score(predicted(error), truth, normalisation)
    curve = next(c for c in card.curves if (c.protocol, c.split) == ("window", "test"))
    assert curve.horizon == tuple(range(1, 21))
    assert curve.value == pytest.approx([(0.1 * h) ** 2 for h in range(1, 21)], rel=1e-2)


@settings(
    max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(order=st.randoms(use_true_random=False))
def test_the_order_of_paths_does_not_matter(predicted, truth, normalisation, order):
    noise = np.random.default_rng(2).normal(size=truth["stress"].shape)
    predictions = predicted(1e5 * noise, protocols=("rollout",))
    rows = list(range(truth.sizes["path"]))
    order.shuffle(rows)
    first = score(predictions, truth, normalisation)
    second = score(predictions.isel(path=rows), truth, normalisation)
    for one, other in zip(first.scores, second.scores, strict=True):
        assert one.key == other.key
        assert one.status != "scored" or one.value == pytest.approx(other.value, rel=1e-8)


def test_shear_components_count_twice_in_the_relative_error(predicted, truth, normalisation):
    labels = ["xx", "yy", "xy"]
    plane_truth = truth.assign_coords(component=labels)
    plane_truth["stress"][:] = np.array([3.0, 4.0, 0.0]) * 1e5
    predictions = predicted(protocols=("rollout",)).assign_coords(component=labels)
    predictions["stress"][:] = np.array([3.0, 4.0, 1.0]) * 1e5
    scored = scored_predictions(predictions, plane_truth, normalisation)
    found = PathErrors.of(scored, PROTOCOLS["rollout"]).relative
    assert found == pytest.approx(2.0**0.5 / 5.0, rel=1e-4)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda p: p.isel(path=slice(1, None)), "lack 1 of the"),
        (lambda p: p.isel(step=slice(0, -1)), "steps a path"),
        (lambda p: p.assign_coords(component=["33", "22", "11"]), "components"),
    ],
)
def test_predictions_that_do_not_fit_are_refused(predicted, truth, normalisation, change, word):
    with pytest.raises(SubmissionError, match=word):
        score(change(predicted()), truth, normalisation)


def test_predictions_of_training_paths_are_refused(records, predicted, truth, normalisation):
    foreign = predicted(protocols=("rollout",))
    names = foreign["path_id"].values.copy()
    names[0] = records["path_id"].values[0]
    with pytest.raises(SubmissionError, match="not among the scored paths"):
        score(foreign.assign_coords(path_id=("path", names)), evaluated(records), normalisation)
