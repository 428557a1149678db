import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from granbench.benchmark.bootstrap import Resampling, weighted_mean, weighted_median


@given(
    values=st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=12),
    seed=st.integers(0, 2**31),
)
def test_weights_are_repetitions(values, seed):
    weights = np.random.default_rng(seed).integers(0, 4, size=(5, len(values)))
    weights[:, 0] += 1
    series = np.array(values)
    for row in weights:
        repeated = np.repeat(series, row)
        assert weighted_median(series, row[None].astype(float))[0] == np.median(repeated)
        mean = weighted_mean(series, row[None].astype(float))[0]
        assert mean == pytest.approx(repeated.mean(), rel=1e-12, abs=1e-9)


def test_a_specimen_comes_with_all_its_paths():
    specimens = np.array(["a", "a", "b", "b", "b", "c"])
    weights = Resampling.by_specimen(specimens).weights
    assert (weights[:, 0] == weights[:, 1]).all()
    assert (weights[:, 2] == weights[:, 4]).all()
    assert (weights[:, [0, 2, 5]].sum(axis=1) == 3).all()


def test_clustering_widens_the_interval():
    """Ten copies of each of eight specimens know no more than the eight do."""
    rng = np.random.default_rng(0)
    values = np.repeat(rng.normal(size=8), 10)
    specimens = np.repeat(np.arange(8), 10)

    def width(labels):
        resampling = Resampling.by_specimen(labels)
        low, high = resampling.interval(lambda w: weighted_mean(values, w))
        return high - low

    assert width(specimens) > 2.0 * width(np.arange(80))


def test_the_interval_of_a_mean_has_the_width_of_theory():
    values = np.random.default_rng(3).normal(size=400)
    low, high = Resampling.by_specimen(np.arange(400)).interval(lambda w: weighted_mean(values, w))
    # 2000 resamples leave a few per cent of noise in a 95 % bound.
    assert high - low == pytest.approx(2 * 1.96 * values.std() / 20.0, rel=0.08)
    assert low < values.mean() < high


def test_the_stream_is_frozen():
    """Intervals in published submissions must be reproduced by every later version."""
    weights = Resampling.by_specimen(np.array(["a", "b", "c", "d"]), resamples=3).weights
    assert weights.tolist() == [[1.0, 1.0, 1.0, 1.0], [1.0, 2.0, 1.0, 0.0], [1.0, 0.0, 1.0, 2.0]]


def test_one_specimen_alone_has_no_interval():
    values = np.arange(5.0)
    alone = Resampling.by_specimen(np.array(["a"] * 5))
    assert alone.interval(lambda w: weighted_mean(values, w)) is None


def test_infinite_values_stay_infinite():
    values = np.array([1.0, np.inf, np.inf, 2.0])
    low, high = Resampling.by_specimen(np.arange(4)).interval(lambda w: weighted_median(values, w))
    assert low < np.inf and high == np.inf
