"""Few specimens and few analyses: no interval, and a sentence that says so."""

import numpy as np
import pytest

from granbench.benchmark.bootstrap import MINIMUM_SPECIMENS, Resampling, weighted_mean
from granbench.benchmark.scorecard import Score
from granbench.benchmark.task_summary import shortages_of_scores


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_an_interval_needs_three_specimens(count: int) -> None:
    specimens = np.repeat([f"s{number}" for number in range(count)], 3)
    values = np.arange(len(specimens), dtype=float)
    interval = Resampling.by_specimen(specimens).interval(
        lambda weights: weighted_mean(values, weights)
    )
    assert (interval is None) == (count < MINIMUM_SPECIMENS)


def mean_error(split: str, low: float | None) -> Score:
    return Score(
        axis="rollout", protocol="rollout", split=split, metric="stress_mse_mean",
        status="scored", value=1.0, low=low, high=low, n=60,
    )  # fmt: skip


def reaction(n: int) -> Score:
    return Score(
        axis="embedded", protocol="embedded-explicit", split="all", metric="reaction_error",
        status="scored", value=0.1, n=n,
    )  # fmt: skip


def test_scores_show_what_is_too_few() -> None:
    (note,) = shortages_of_scores([mean_error("test", 0.9), mean_error("ood-wall", None)])
    assert "ood-wall" in note
    (note,) = shortages_of_scores([mean_error("test", 0.9), reaction(2)])
    assert "embedded" in note and "2" in note
    assert shortages_of_scores([mean_error("test", 0.9), reaction(3)]) == []
    assert shortages_of_scores([]) == []
