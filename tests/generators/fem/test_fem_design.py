"""The plan of the `fem-*` datasets: their splits, and whether every problem can be analysed."""

import json
from collections import Counter

import pytest
from pydantic import ValidationError

from granbench.fem.stated_problem import build_problem
from granbench.fem.statement import EmbeddedAnalysis, as_attribute
from granbench.generators.fem.design import DATASETS, PRESETS, FemPreset
from granbench.generators.fem.plan import AnalysisPlan, embedded_analyses_of, planned_analyses

CORE = PRESETS["core"]
IME = DATASETS["fem-ime"]


def plans(chosen: FemPreset = CORE, seed: int = 0) -> list[AnalysisPlan]:
    return planned_analyses(IME, chosen, seed)


def test_analyses_are_split_by_problem_and_loading() -> None:
    problems = {split: {plan.problem for plan in plans() if plan.split == split} for split in
                {plan.split for plan in plans()}}  # fmt: skip
    assert problems == {
        "train": {"biaxial"},
        "validation": {"biaxial"},
        "test": {"biaxial"},
        "ood-wall": {"retaining-wall"},
        "ood-footing": {"strip-footing"},
    }
    pressures = [
        {plan.confinement for plan in plans() if plan.split == split}
        for split in ("train", "validation", "test")
    ]
    assert not pressures[0] & pressures[1] and not pressures[0] & pressures[2]
    assert not pressures[1] & pressures[2]


def test_no_two_loadings_differ_only_in_a_constant_pressure() -> None:
    """IME would deform in the same way, and a test path would repeat a training path."""
    constant = Counter((plan.problem, plan.choices["cycles"]) for plan in plans() if plan.seed == 0)
    assert set(constant.values()) == {1}
    seeds = Counter(plan.seed for plan in plans() if plan.seed)
    assert set(seeds.values()) == {1}


def test_training_has_each_kind_of_loading() -> None:
    trained = [plan for plan in plans() if plan.split == "train"]
    assert {plan.choices["ends"] for plan in trained} == {"rough", "smooth"}
    assert {plan.mesh for plan in trained} == {"coarse", "medium"}
    assert {plan.loading_family for plan in trained} == {"biaxial-monotonic", "biaxial-cyclic"}


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("dataset", DATASETS)
def test_every_planned_problem_can_be_built(dataset: str, name: str) -> None:
    listed = planned_analyses(DATASETS[dataset], PRESETS[name], 0)
    assert len({plan.name for plan in listed}) == len(listed)
    for plan in listed:
        problem = build_problem(plan)
        assert plan.mesh in problem.meshes
        assert problem.initial_pressure == plan.confinement
        assert build_problem(AnalysisPlan.model_validate_json(plan.model_dump_json())) == problem


def test_another_seed_draws_other_confinements() -> None:
    ours, theirs = ({plan.seed for plan in plans(seed=seed)} - {0} for seed in (0, 1))
    assert len(ours) == len(theirs) and not ours & theirs


def test_embedded_analyses_survive_their_attribute() -> None:
    modulus = dict.fromkeys((plan.name for plan in plans()), 2e7)
    listed = embedded_analyses_of(plans(), CORE, modulus)
    assert {analysis.problem for analysis in listed} == {
        "biaxial", "retaining-wall", "strip-footing",
    }  # fmt: skip

    written = json.loads(as_attribute(listed))
    assert tuple(map(EmbeddedAnalysis.model_validate, written)) == listed
    written[1]["choices"].pop("confinement")
    with pytest.raises(ValidationError, match="confinement"):
        EmbeddedAnalysis.model_validate(written[1])
