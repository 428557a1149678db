"""Copies of the truth, of another row, and of one model under several seeds."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from small_cells import Persistence, secant
from small_submissions import about

from granbench.benchmark.predictions import open_predictions
from granbench.errors import SubmissionError
from granbench.leaderboard.admission import examine
from granbench.leaderboard.board import accept
from granbench.leaderboard.composition import compose
from granbench.leaderboard.originality import seeds_score_alike
from granbench.leaderboard.submission import read_submission

Change = Callable[[xr.Dataset], xr.Dataset]


@pytest.fixture
def recomposed(submission_file, sealed, tmp_path) -> Callable[..., Path]:
    """A submission of changed predictions, with the scores that follow from them."""

    def make(source: str, change: Change, name: str = "mine", **facts) -> Path:
        predictions = open_predictions(submission_file(source).with_suffix(".nc"))
        changed = change(predictions.copy(deep=True))
        out = tmp_path / "made" / f"{name}.json"
        out.parent.mkdir(exist_ok=True)
        compose(changed, sealed, about(name, **facts), out)
        return out

    return make


def honest_kind(change: Change) -> Change:
    """Predictions that do not say that they read the records, with responses of a model."""

    def changed(predictions: xr.Dataset) -> xr.Dataset:
        kept = [n for n in ("stress", "void_ratio") if n in predictions]
        return change(predictions[kept].assign_attrs(predictions.attrs | {"reads_records": 0}))

    return changed


def one_value_off(predictions: xr.Dataset) -> xr.Dataset:
    predictions["stress"][0, 2, 0, 7, 0] *= 1.001
    return predictions


def with_noise(size: float) -> Change:
    def noised(predictions: xr.Dataset) -> xr.Dataset:
        drawn = np.random.default_rng(0).normal(size=predictions["stress"].shape)
        return predictions.assign(stress=predictions["stress"] * (1.0 + size * drawn))

    return noised


def without_excuses(predictions: xr.Dataset) -> xr.Dataset:
    attrs = {k: v for k, v in predictions.attrs.items() if not k.endswith("not_applicable")}
    kept = predictions.copy()
    kept.attrs = attrs
    return kept


TOO_CLOSE = {
    "one value off by 0.1 %": one_value_off,
    "all off by 0.01 %": lambda p: p.assign(stress=p["stress"] * 1.0001),
    "scaled by 2 %": lambda p: p.assign(stress=p["stress"] * 1.02),
    "noise of 0.1 %": with_noise(1e-3),
    "noise of 5 %": with_noise(5e-2),
}


@pytest.mark.parametrize("case", TOO_CLOSE)
def test_predictions_close_to_the_truth_need_a_maintainers_reason(
    recomposed, sealed, tmp_path, case
):
    file = recomposed("oracle", lambda p: without_excuses(honest_kind(TOO_CLOSE[case])(p)))
    assert read_submission(file).role == "model"
    assert any(one.flagged for one in examine(file, None, sealed).objections)
    with pytest.raises(SubmissionError):
        accept(file, tmp_path / "board", sealed)
    assert not (tmp_path / "board").exists()


def test_a_maintainers_reason_is_kept_in_the_row(submission_file, sealed, tmp_path, recomposed):
    board = tmp_path / "board"
    accept(submission_file(), board, sealed)
    file = recomposed("secant", one_value_off)
    with pytest.raises(SubmissionError, match="secant"):
        accept(file, board, sealed)
    target = accept(file, board, sealed, word="the same law, written by two groups")
    acceptance = read_submission(target).acceptance
    assert acceptance is not None and acceptance.word == "the same law, written by two groups"


COPIES: dict[str, Change] = {
    "an attribute more": lambda p: p.assign_attrs(comment="mine"),
    "one value changed": one_value_off,
    "seeds exchanged": lambda p: p.isel(seed=[2, 0, 1]).assign_coords(seed=[0, 1, 2]),
    "other seeds": lambda p: p.assign_coords(seed=[7, 8, 9]),
    "paths in another order": lambda p: p.isel(
        path=slice(None, None, -1), checked_path=slice(None, None, -1)
    ),
    "noise of 0.01 %": with_noise(1e-4),
}


@pytest.mark.parametrize("case", COPIES)
def test_the_predictions_of_another_row_are_not_accepted_again(
    recomposed, submission_file, sealed, tmp_path, case
):
    board = tmp_path / "board"
    accept(submission_file(), board, sealed)
    file = recomposed("secant", COPIES[case])
    with pytest.raises(SubmissionError, match="secant"):
        accept(file, board, sealed)


def test_a_different_model_is_not_a_copy(submit, submission_file, sealed, tmp_path):
    board = tmp_path / "board"
    accept(submission_file(), board, sealed)

    class Softer(type(secant().module)):
        def forward(self, dstrain, state):
            stress, after = super().forward(0.7 * dstrain, state)
            return stress, after

    cell = secant("softer")
    cell.module.__class__ = Softer
    assert accept(submit(cell), board, sealed).is_file()


def test_one_model_under_three_seeds_is_one_deterministic_model(submission_file, sealed):
    examination = examine(submission_file(), None, sealed)
    assert not examination.objections
    assert examination.submission.deterministic is True
    assert seeds_score_alike(examination.submission.scores)


def seeds_off(*sizes: float) -> Change:
    def changed(predictions: xr.Dataset) -> xr.Dataset:
        factor = xr.DataArray(np.array([1.0 + size for size in sizes]), dims="seed")
        stress = (predictions["stress"] * factor).transpose(*predictions["stress"].dims)
        return predictions.assign(stress=stress)

    return changed


@pytest.mark.parametrize(
    "change",
    [
        seeds_off(0.0, 1e-3, 2e-3),  # one network, slightly perturbed
        seeds_off(0.0, 0.0, 0.3),  # two of three
        lambda p: one_value_off(p),
    ],
    ids=["perturbed", "two of three", "one value"],
)
def test_one_model_under_three_seeds_is_not_three_models(recomposed, sealed, change):
    objections = examine(recomposed("secant", change), None, sealed).objections
    assert any(one.flagged and "seeds" in one.text for one in objections)


def test_the_ceiling_may_be_the_truth(submission_file, sealed):
    assert not examine(submission_file("oracle"), None, sealed).objections


def test_only_the_records_themselves_count_as_read_from_the_records(recomposed, sealed):
    with pytest.raises(SubmissionError, match="reads_records"):
        recomposed("oracle", one_value_off)


def test_validation_and_the_board_object_to_few_seeds_and_missing_axes(submit, sealed, tmp_path):
    file = submit(Persistence(), seeds=(0,), axes=["rollout"])
    texts = [one.text for one in examine(file, None, sealed).objections]
    assert len(texts) == 2 and "seeds" in texts[0] and "axis" in texts[1]
    with pytest.raises(SubmissionError, match="seeds"):
        accept(file, tmp_path / "board", sealed)


def test_parameters_are_those_of_the_predictions(submission_file, sealed):
    file = submission_file()
    for change, field in (
        ({"parameters": 12_345}, "parameters"),
        ({"predictions": {"bytes": 1}}, "predictions.bytes"),
    ):
        content = json.loads(file.read_text())
        nested = change.get("predictions")
        content["predictions"] |= nested or {}
        content |= {} if nested else change
        other = file.with_name("other.json")
        other.write_text(json.dumps(content))
        with pytest.raises(SubmissionError, match=field):
            examine(other, None, sealed)
