"""The paths of the `gp-*` datasets."""

import pytest

from granbench.generators.classical.design import DATASETS, PRESETS, split_seed, splits
from granbench.models import MODELS
from granbench.records.schema import SPLIT_PATTERN

CORE = PRESETS["core"]


def counts(dataset: str, preset_name: str) -> dict[str, int]:
    return {plan.name: plan.count for plan in splits(DATASETS[dataset], PRESETS[preset_name])}


def test_core_has_the_specified_paths() -> None:
    assert counts("gp-j2", "core") == {
        "train": 1000,
        "validation": 200,
        "test": 200,
        "ood-rougher": 50,
        "ood-amplitude": 50,
        "ood-proportional": 50,
        "ood-cyclic": 50,
    }
    assert CORE.steps == 200
    assert all(SPLIT_PATTERN.fullmatch(name) for name in counts("gp-dp", "core"))


def test_tangents_are_recorded_along_the_paths_of_core() -> None:
    with_tangents = PRESETS["tangents"]
    assert with_tangents.tangents and not CORE.tangents
    assert counts("gp-dp", "tangents") == counts("gp-dp", "core")
    assert with_tangents.version == f"{CORE.version}+tangents"


def test_one_split_of_drucker_prager_keeps_its_volume_change() -> None:
    plans = {plan.name: plan for plan in splits(DATASETS["gp-dp"], CORE)}
    assert [name for name, plan in plans.items() if not plan.admissible] == ["ood-unscaled"]
    assert plans["ood-unscaled"].family == plans["train"].family
    assert not any(plan.admissible for plan in splits(DATASETS["gp-j2"], CORE))
    paper = splits(DATASETS["gp-dp"], PRESETS["paper"])
    assert not any(plan.admissible for plan in paper)
    assert sum(plan.count for plan in paper if plan.name != "test") == 1000


def test_all_models_follow_the_same_paths() -> None:
    ours, theirs = (splits(DATASETS[name], CORE) for name in ("gp-j2", "gp-dp"))
    for one, other in zip(ours, theirs, strict=False):
        assert (one.name, one.family) == (other.name, other.family)


def test_no_two_splits_share_random_numbers() -> None:
    names = [plan.name for plan in splits(DATASETS["gp-dp"], CORE)]
    seeds = [split_seed(name, seed) for name in names for seed in range(5)]
    assert len(set(seeds)) == len(seeds)


def test_splits_out_of_distribution_are_out_of_the_training_ranges() -> None:
    families = {plan.name: plan.family for plan in splits(DATASETS["gp-j2"], CORE)}
    training = families["train"]
    assert families["ood-rougher"].l[1] < training.l[0]
    assert families["ood-amplitude"].v[0] > training.v[1]
    assert families["validation"] == families["test"] == training
    assert families["ood-cyclic"].loading_family == "strain-cycles"


@pytest.mark.parametrize("dataset", DATASETS)
def test_every_pressure_dependent_model_starts_under_pressure(dataset: str) -> None:
    described = DATASETS[dataset]
    assert described.dataset == dataset and described.model in MODELS
    assert described.cell().pressure_dependent == (described.initial_mean_stress > 0.0)
