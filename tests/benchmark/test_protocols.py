import numpy as np
import pytest
import torch
import xarray as xr
from small_cells import Fragile, Oracle, Persistence, Secant, secant

from granbench.benchmark.axes.along_paths.free_run import noise, rollout, window
from granbench.benchmark.axes.along_paths.protocols import PROTOCOLS
from granbench.benchmark.axes.along_paths.single_step import single_step
from granbench.benchmark.evaluation import predict
from granbench.benchmark.predictions import (
    evaluated,
    open_predictions,
    quantise,
    write_predictions,
)
from granbench.benchmark.scoring import score
from granbench.cells.contract import ModuleCell, StateLayout
from granbench.data.normalisation import Normalisation
from granbench.errors import ConfigurationError, ModelError


@pytest.fixture
def scored(records: xr.Dataset) -> xr.Dataset:
    return evaluated(records)


def test_the_oracle_scores_exactly_zero_on_every_axis(records, scored, tmp_path):
    oracle = Oracle(scored)
    write_predictions(predict({0: oracle, 1: oracle}, scored), tmp_path / "oracle.nc")
    card = score(
        open_predictions(tmp_path / "oracle.nc"), scored, Normalisation.from_training(records)
    )
    scored_items = [item for item in card.scores if item.status == "scored"]
    assert {item.protocol for item in scored_items} == {*PROTOCOLS, "cost"}
    assert all(item.value == 0.0 for item in scored_items)


def test_scores_from_the_file_equal_scores_from_memory(records, scored, tmp_path):
    predictions = predict({0: secant(), 3: secant()}, scored)
    write_predictions(predictions, tmp_path / "secant.nc")
    normalisation = Normalisation.from_training(records)
    again = open_predictions(tmp_path / "secant.nc")
    assert score(again, scored, normalisation) == score(predictions, scored, normalisation)
    assert again.attrs["model"] == "secant"
    assert again.attrs["dataset"] == "synthetic"


def test_a_single_step_starts_from_the_truth(scored):
    stress = single_step(Persistence(), scored)["stress"].numpy()
    truth = scored["stress"].values
    np.testing.assert_array_equal(stress[:, 1:], truth[:, :-1])
    series = single_step(secant(), scored)
    step = np.diff(scored["strain"].values.astype(float), axis=1)
    np.testing.assert_allclose(
        series["stress"][:, 1:], truth[:, :-1] + 2e6 * step, rtol=1e-5, atol=1.0
    )
    void_ratio = scored["void_ratio"].values[:, :-1].astype(float)
    expected = void_ratio - (1.0 + void_ratio) * step.sum(-1)
    np.testing.assert_allclose(series["void_ratio"][:, 1:], expected, rtol=1e-5)


def test_a_rollout_is_given_the_truth_only_at_the_start(scored):
    stress = rollout(Persistence(), scored)["stress"].numpy()
    np.testing.assert_array_equal(stress, np.repeat(stress[:, :1], stress.shape[1], axis=1))
    np.testing.assert_array_equal(stress[:, 0], scored["stress"].values[:, 0])


@pytest.mark.parametrize("length", [7, 20, 40, 100])
def test_windows_restart_from_the_truth(scored, length):
    stress = window(Persistence(), scored, length)["stress"].numpy()
    truth = scored["stress"].values
    steps = truth.shape[1]
    assert stress.shape == truth.shape
    for step in range(1, steps):
        np.testing.assert_array_equal(stress[:, step], truth[:, (step - 1) // length * length])


def test_a_window_gets_the_conditions_of_its_start(scored):
    series = window(Oracle(scored), scored)
    np.testing.assert_array_equal(series["stress"], scored["stress"])
    np.testing.assert_array_equal(series["void_ratio"], scored["void_ratio"])


def test_without_noise_the_noised_run_is_the_rollout(scored):
    clean, quiet = rollout(secant(), scored), noise(secant(), scored, 0.0, seed=5)
    assert torch.equal(clean["stress"], quiet["stress"])
    assert torch.equal(clean["void_ratio"], quiet["void_ratio"])


def test_noise_scales_the_increments(scored):
    """A linear cell shows the noised increments themselves (Eq 5.13)."""
    cell = ModuleCell(Secant(), name="s", layout=StateLayout.of(stress=3, void_ratio=1),
                      dtype=torch.float64)  # fmt: skip
    increment = np.diff(scored["strain"].values.astype(float), axis=1)
    moving = np.abs(increment) > 1e-6

    def factor(xi: float, seed: int) -> np.ndarray:
        stress = noise(cell, scored, xi, seed)["stress"].numpy()
        return (np.diff(stress, axis=1)[moving] / 2e6 / increment[moving] - 1.0) / xi

    drawn = factor(0.5, seed=1)
    assert drawn.size > 2000
    # Mean and spread of n standard normals scatter by 1/sqrt(n), here 2 %; three of these.
    assert abs(drawn.mean()) < 0.06 and abs(drawn.std() - 1.0) < 0.06
    np.testing.assert_allclose(factor(1.0, seed=1), drawn, atol=1e-6)  # the same R at every xi
    assert np.abs(factor(0.5, seed=2) - drawn).max() > 1.0


def test_noise_belongs_to_the_path_and_not_to_its_place(scored):
    whole = noise(secant(), scored, 0.5, seed=0)["stress"]
    some = [7, 2, 5]
    part = noise(secant(), scored.isel(path=some), 0.5, seed=0)["stress"]
    assert torch.equal(whole[some], part)


@pytest.mark.parametrize("raises", [True, False])
def test_a_breakdown_keeps_what_came_before_and_every_other_path(scored, raises):
    limit = 0.1
    stress = rollout(Fragile(limit, raises), scored)["stress"].numpy()
    strain = scored["strain"].values[..., 0].astype(float)
    broken = np.maximum.accumulate(np.cumsum(np.diff(strain, axis=1), axis=1) > limit, axis=1)
    assert broken.any() and not broken.all()
    np.testing.assert_array_equal(np.isnan(stress[:, 1:, 0]), broken)


def test_both_kinds_of_breakdown_have_the_same_score(records, scored):
    normalisation = Normalisation.from_training(records)
    by_nan, by_raising = (
        score(
            predict({0: Fragile(0.1, raises)}, scored, ["window", "rollout", "noise"]),
            scored,
            normalisation,
        )
        for raises in (False, True)
    )
    assert by_nan == by_raising
    assert by_nan.find("rollout", "test", "failed_share").value > 0.0


def test_single_steps_are_lost_once_the_state_of_the_record_fails(scored):
    class Limited(Persistence):
        def step(self, dstrain, state):
            if (state[:, 0] > 2e6).any():
                raise ZeroDivisionError
            return super().step(dstrain, state)

    stress = single_step(Limited(), scored)["stress"].numpy()
    too_high = scored["stress"].values[..., 0] > 2e6
    lost = np.isnan(stress[:, 1:, 0])
    # Conditioning runs the cell along the record, so a failing state also ends what follows.
    assert lost.any() and not lost.all()
    np.testing.assert_array_equal(lost, np.maximum.accumulate(too_high[:, :-1], axis=1))


def test_a_model_without_void_ratio_has_none_in_its_file(scored):
    predictions = predict({0: Persistence()}, scored, ["rollout"])
    assert "void_ratio" not in predictions
    assert list(predictions["protocol"].values) == ["rollout"]


def test_progress_is_reported_after_each_protocol(scored):
    reported = []
    predict(
        {0: Persistence(), 4: Persistence()}, scored, ["window", "noise"],
        progress=lambda seed, done: reported.append((seed, done)),
    )  # fmt: skip
    names = ["window", "noise-0.2", "noise-0.5", "noise-1.0"]
    assert reported == [(seed, PROTOCOLS[name].title) for seed in (0, 4) for name in names]


def test_wrong_requests_are_refused(scored):
    with pytest.raises(ConfigurationError, match="unknown axis 'rolout'"):
        predict({0: Persistence()}, scored, ["rolout"])
    plane = ModuleCell(torch.nn.Identity(), name="flat", order="plane")
    with pytest.raises(ModelError, match="component order"):
        predict({0: plane}, scored)


def test_a_bug_in_user_code_is_reported_with_its_line(scored):
    class Wide(torch.nn.Module):
        def forward(self, dstrain, stress):
            return stress @ torch.ones(4, 3)

    with pytest.raises(
        ModelError, match=r"wide failed with RuntimeError.* at test_protocols.py li"
    ):
        predict({0: ModuleCell(Wide(), name="wide")}, scored, ["rollout"])


def test_a_bug_that_shows_late_names_the_protocol(scored):
    class Late(torch.nn.Module):
        def forward(self, dstrain, stress):
            if len(dstrain) > 10:  # more than are checked
                raise KeyError("fabric")
            return stress

    with pytest.raises(
        ModelError, match=r"protocol rollout with KeyError \('fabric'\) at test_pro"
    ):
        predict({0: ModuleCell(Late(), name="late")}, scored, ["rollout"])


def test_quantising_twice_changes_nothing_and_errs_little():
    rng = np.random.default_rng(0)
    values = rng.normal(size=10_000) * 10.0 ** rng.integers(-30, 30, size=10_000)
    once = quantise(values)
    np.testing.assert_array_equal(quantise(once), once)
    assert (np.abs(once - values) <= 2.0**-16 * np.abs(values) * (1 + 1e-6)).all()
    special = quantise(np.array([0.0, -0.0, np.nan, np.inf, -np.inf, 1e300, 3.4028e38]))
    np.testing.assert_array_equal(np.isnan(special), [False, False, *[True] * 5])
