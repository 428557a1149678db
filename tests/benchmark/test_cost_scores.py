"""Scores of the cost axis from given timings."""

import numpy as np
import pytest
import xarray as xr

from granbench.benchmark.axes.cost.metrics import METRICS
from granbench.benchmark.predictions import assembled_predictions
from granbench.benchmark.scoring import score
from granbench.errors import SubmissionError
from granbench.records.schema import GROUND_TRUTH

SEEDS = (0, 1, 2)


def with_truth(records: xr.Dataset) -> xr.Dataset:
    return records.assign_attrs({GROUND_TRUTH: "{}"})


def costs(truth: xr.Dataset, **variables: object) -> xr.Dataset:
    given = xr.Dataset(variables, {"points": [100, 10_000]})
    return assembled_predictions([given], dataset=truth, seeds=SEEDS, attrs={})


def test_cost_is_averaged_over_seeds_and_compared_with_the_truth(truth, normalisation):
    seconds = np.array([[2e-6, 2e-7], [2e-6, 2e-7], [5e-6, 5e-7]])
    predictions = costs(
        truth,
        parameters=("seed", [1_234_567.0] * 3),
        training_seconds=("seed", [60.0, 120.0, 180.0]),
        update_seconds=(("seed", "points"), seconds),
        truth_update_seconds=(("seed", "points"), seconds / 4.0),
    )
    card = score(predictions, with_truth(truth), normalisation)
    found = {metric.name: card.find("cost", "all", metric.name) for metric in METRICS}
    assert found["parameters"].value == 1_234_567.0  # counted, not rounded
    assert found["training_seconds"].value == pytest.approx(120.0, rel=1e-4)
    assert found["update_seconds_100"].value == pytest.approx(3e-6, rel=1e-4)
    assert found["update_seconds_10000"].unit == "s"
    assert found["update_ratio_10000"].value == pytest.approx(4.0, rel=1e-4)
    assert not card.perfect  # nothing is known of its errors


def test_what_is_not_known_of_cost_has_a_reason(truth, normalisation):
    predictions = costs(
        truth,
        parameters=("seed", [3.0] * 3),
        training_seconds=("seed", [1.0, np.nan, 1.0]),
        update_seconds=(("seed", "points"), np.full((3, 2), np.nan)),
    )
    card = score(predictions, truth, normalisation)
    reasons = {metric.name: card.find("cost", "all", metric.name).reason for metric in METRICS}
    assert reasons["parameters"] is None
    assert "not known" in reasons["training_seconds"]
    assert "broke down" in reasons["update_seconds_100"]
    assert "no ground-truth cell" in reasons["update_ratio_100"]
    left_out = score(predictions.drop_vars(["parameters"]), truth, normalisation)
    assert left_out.find("cost", "all", "parameters").status == "not_run"


def measured(truth: xr.Dataset, **changes: object) -> xr.Dataset:
    variables = {
        "parameters": ("seed", [3.0] * 3),
        "training_seconds": ("seed", [1.0] * 3),
        "update_seconds": (("seed", "points"), np.full((3, 2), 2e-6)),
        "truth_update_seconds": (("seed", "points"), np.full((3, 2), 1e-6)),
    }
    return costs(truth, **variables | changes)


def test_a_ground_truth_that_was_not_timed_gives_no_ratio(truth, normalisation):
    found = score(
        measured(truth).drop_vars("truth_update_seconds"), with_truth(truth), normalisation
    )
    assert "not timed" in (found.find("cost", "all", "update_ratio_100").reason or "")
    assert found.find("cost", "all", "update_seconds_100").value == pytest.approx(2e-6, rel=1e-4)


def test_costs_belong_to_no_split_and_have_no_interval(truth, normalisation):
    found = [
        item
        for item in score(measured(truth), with_truth(truth), normalisation).scores
        if item.axis == "cost"
    ]
    assert [item.metric for item in found] == [metric.name for metric in METRICS]
    assert {(item.split, item.group, item.n, item.low) for item in found} == {
        ("all", "all", 0, None)
    }


def test_other_sizes_of_batches_are_refused(truth, normalisation):
    with pytest.raises(SubmissionError, match="update_seconds"):
        score(measured(truth).assign_coords(points=[10, 20]), with_truth(truth), normalisation)
