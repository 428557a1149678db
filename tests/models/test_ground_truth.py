"""The model behind a dataset, from the dataset alone."""

import json

import numpy as np
import pytest
from plane_records import plane_records

from granbench.benchmark.axes.along_paths.free_run import rollout
from granbench.errors import DatasetError
from granbench.generators.classical.design import DATASETS
from granbench.models.ground_truth import ground_truth_cell, holds_no_tension
from granbench.records.schema import GROUND_TRUTH

QUICK = [name for name in DATASETS if name != "gp-csuh"]


@pytest.mark.parametrize("name", QUICK)
def test_the_ground_truth_is_the_model_that_made_the_records(name):
    records = plane_records(name)
    cell = ground_truth_cell(records)
    made_by = DATASETS[name].cell()
    assert (cell.name, cell.values()) == (made_by.name, made_by.values())
    # Records keep some digits only: 2^-16 of the stress, with the internals that a start takes.
    stress = rollout(cell, records)["stress"].detach().numpy()
    np.testing.assert_allclose(stress, records["stress"], rtol=2e-4, atol=1.0)


def test_other_parameters_make_another_truth():
    records = plane_records()
    truth = json.loads(records.attrs[GROUND_TRUTH])
    truth["parameters"]["yield_stress"] *= 2.0
    records.attrs[GROUND_TRUTH] = json.dumps(truth)
    assert ground_truth_cell(records).values()["yield_stress"] == pytest.approx(2e5)


def test_records_of_grains_have_no_ground_truth_and_no_tension(records):
    assert ground_truth_cell(records) is None
    assert holds_no_tension(records)
    assert not holds_no_tension(records.drop_vars("void_ratio"))
    assert holds_no_tension(plane_records("gp-dp"))
    assert not holds_no_tension(plane_records("gp-j2"))


@pytest.mark.parametrize(
    "text",
    ["{", "[]", '{"model": "j3", "parameters": {}}', '{"model": "j2", "parameters": {}}',
     '{"model": "j2"}', '{"model": "j2", "parameters": {}, "more": 1}'],
)  # fmt: skip
def test_a_ground_truth_that_cannot_be_rebuilt_is_named(text):
    records = plane_records()
    records.attrs[GROUND_TRUTH] = text
    with pytest.raises(DatasetError, match="gp-j2: its attribute 'ground_truth'"):
        ground_truth_cell(records)
