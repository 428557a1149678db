"""The cost axis; how long anything takes is nowhere asserted."""

import numpy as np
import pytest
import torch
from lawless_cells import Elastic, Mortal, cell
from plane_records import plane_records
from small_cells import Oracle, Persistence

from granbench.benchmark.axes.cost.predict import POINTS
from granbench.benchmark.evaluation import predict
from granbench.benchmark.predictions import evaluated
from granbench.cells.find import FoundModel, find_cells


def test_model_and_ground_truth_are_timed_together() -> None:
    scored = evaluated(plane_records())
    found = predict({0: cell(Elastic()), 1: cell(Elastic())}, scored, ["cost"],
                    training_seconds={0: 7.0})  # fmt: skip
    assert list(found["points"].values) == list(POINTS)
    for name in ("update_seconds", "truth_update_seconds"):
        assert found[name].dims == ("seed", "points")
        assert (found[name] > 0.0).all() and np.isfinite(found[name]).all()
    assert found["training_seconds"].values[0] == 7.0
    assert np.isnan(found["training_seconds"].values[1])
    assert (found["parameters"] == 0.0).all()


def test_grains_have_no_ground_truth_to_be_timed(records) -> None:
    found = predict({0: Persistence()}, evaluated(records), ["cost"])
    assert "truth_update_seconds" not in found and (found["update_seconds"] > 0.0).all()


@pytest.mark.parametrize("raises", [False, True])
def test_a_cell_is_timed_where_it_is_alive(raises: bool) -> None:
    """It breaks down along every path, so that only steps from before can be timed."""
    answers = []

    class Watched(Mortal):
        def step(self, dstrain, state):
            stress, after = super().step(dstrain, state)
            answers.append(torch.isfinite(stress).all())
            return stress, after

    found = predict({0: Watched(raises)}, evaluated(plane_records()), ["cost"])
    assert np.isfinite(found["update_seconds"]).all()
    assert answers[-1]


def test_a_cell_that_never_answers_has_no_time() -> None:
    class Dead(Mortal):
        def step(self, dstrain, state):
            raise ZeroDivisionError

    found = predict({0: Dead(raises=True)}, evaluated(plane_records()), ["cost"])
    assert np.isnan(found["update_seconds"]).all()


def test_looking_up_is_no_update(records) -> None:
    scored = evaluated(records)
    found = predict({0: Oracle(scored)}, scored, ["cost"])
    assert "update_seconds" not in found and (found["parameters"] == 0.0).all()


def test_a_published_model_brings_its_parameters() -> None:
    records = plane_records()
    candidate: FoundModel = find_cells("j2", records)
    found = predict(candidate.cells, evaluated(records), ["cost"])
    assert (found["parameters"] == 3.0).all()
    # One cell for all seeds is timed once.
    assert len(np.unique(found["update_seconds"].isel(points=0))) == 1
