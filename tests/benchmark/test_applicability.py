"""What applies follows from the task and the kind of model, not from what a file says of itself."""

import json

import embedded_tasks
import pytest
import xarray as xr
from lawless_cells import Elastic, cell
from small_cells import Persistence

from granbench.baselines.oracle import OracleCell
from granbench.benchmark.axes.embedded.axis import EMBEDDED_OBSTACLE
from granbench.benchmark.axes.physics.checks import (
    CARRIES_TENSION,
    CHECKS,
    NO_TANGENT,
    PHYSICS_OBSTACLES,
    PRINCIPAL,
)
from granbench.benchmark.evaluation import predict
from granbench.benchmark.predictions import evaluated
from granbench.benchmark.scoring import score
from granbench.data.normalisation import Normalisation
from granbench.errors import SubmissionError


@pytest.fixture(scope="module")
def stated() -> xr.Dataset:
    return embedded_tasks.embedding_records()


@pytest.fixture(scope="module")
def _predictions(stated) -> xr.Dataset:
    axes = ["rollout", "embedded", "physics"]
    task = embedded_tasks.task_of(stated)
    return predict({0: cell(Elastic())}, evaluated(stated), axes, task=task)


@pytest.fixture
def predictions(_predictions) -> xr.Dataset:
    return _predictions.copy(deep=True)


def card(predictions: xr.Dataset, records: xr.Dataset):
    task = embedded_tasks.task_of(records)
    return score(predictions, evaluated(records), Normalisation.from_training(records), task)


EXCUSES = {
    "the analyses": {EMBEDDED_OBSTACLE: "my model is above that"},
    "the analyses, in the task's own words": {
        EMBEDDED_OBSTACLE: "the analyses are in the plane, the records are not"
    },
    "the analyses, as a ceiling": {
        EMBEDDED_OBSTACLE: "the model reads its answers from the records and has none inside an "
        "analysis",
        "reads_records": 1,
    },
    "everything, as a ceiling": {"reads_records": 1},
    "every check": {PHYSICS_OBSTACLES: json.dumps(dict.fromkeys(CHECKS, "not needed"))},
    "rotation": {PHYSICS_OBSTACLES: json.dumps({"rotation": PRINCIPAL})},
    "dissipation": {PHYSICS_OBSTACLES: json.dumps({"dissipation": "not needed"})},
    "the tangent": {PHYSICS_OBSTACLES: json.dumps({"tangent": "not needed"})},
    "the tangent, with a page": {
        PHYSICS_OBSTACLES: json.dumps({"tangent": f"{NO_TANGENT[0]}\n<b>"})
    },
    "a check with a list": {PHYSICS_OBSTACLES: json.dumps({"rotation": [PRINCIPAL]})},
}


@pytest.mark.parametrize("case", EXCUSES)
def test_a_file_does_not_excuse_its_model(predictions, stated, case):
    with pytest.raises(SubmissionError, match="the predictions"):
        card(predictions.assign_attrs(EXCUSES[case]), stated)


def test_the_task_itself_excuses_with_its_own_words(predictions, stated):
    """J2 may carry tension, whatever the file gives as the reason."""
    claimed = predictions.assign_attrs({PHYSICS_OBSTACLES: json.dumps({"compression": "lazy"})})
    found = card(claimed, stated).find("compression", "test", "violation_worst")
    assert (found.status, found.reason) == ("not_applicable", CARRIES_TENSION)


def test_a_model_without_a_tangent_is_a_kind_of_model(predictions, stated):
    reason = f"{NO_TANGENT[0]}: element 0 of tensors does not require grad"
    claimed = predictions.assign_attrs(
        {PHYSICS_OBSTACLES: json.dumps({"tangent": reason, "compression": CARRIES_TENSION})}
    )
    found = card(claimed, stated).find("tangent", "test", "violation_worst")
    assert (found.status, found.reason) == ("not_applicable", reason)


def test_the_ceiling_is_excused(stated):
    oracle = OracleCell(stated)
    task = embedded_tasks.task_of(stated)
    predictions = predict({0: oracle}, evaluated(stated), ["rollout", "embedded"], task=task)
    found = card(predictions, stated)
    assert found.perfect
    place = found.find("embedded-explicit", "all", "reaction_error")
    assert place.status == "not_applicable" and "reads its answers" in (place.reason or "")


def test_times_may_not_be_left_out(truth, normalisation, monkeypatch):
    monkeypatch.setattr("granbench.benchmark.axes.cost.predict.SECONDS", 1e-3)
    predictions = predict({0: Persistence()}, truth, ["cost"])
    for name in ("update_seconds", "training_seconds"):
        with pytest.raises(SubmissionError, match=name):
            score(predictions.drop_vars(name), truth, normalisation)
