"""The plan of the `dem-triaxial` dataset: specimens, loadings and splits."""

from collections import Counter

import pytest

from granbench.errors import ConfigurationError
from granbench.generators.dem.design import (
    ALL_FRICTIONS,
    CORE,
    DATASETS,
    PRESETS,
    UNSEEN_GRADING,
)
from granbench.generators.dem.generator import jobs
from granbench.generators.dem.gradings import GRADINGS
from granbench.generators.dem.plan import ANCHOR_PRESSURE, planned_tests, specimens
from granbench.paths import ConstantMeanStress

FAMILIES = {"constant-p", "constant-sigma3", "cyclic", "random-strain"}
TRIAXIAL = DATASETS["dem-triaxial"]
SPLITS = {"train", "validation", "test", "ood-psd"}


@pytest.fixture(scope="module")
def core():
    return planned_tests(CORE, 0)


def by_split(plans):
    return {split: [p for p in plans if p.specimen.split == split] for split in SPLITS}


def test_core_has_at_least_420_tests_with_unique_names(core):
    assert len(core) == 443
    assert len({plan.name for plan in core}) == len(core)
    assert len({plan.specimen.seed for plan in core}) == len({p.specimen.name for p in core})
    assert {plan.specimen.grading for plan in core} == set(GRADINGS)


def test_every_family_and_every_pressure_is_in_every_split(core):
    for split, plans in by_split(core).items():
        assert {plan.programme.loading_family for plan in plans} == FAMILIES, split
        assert {plan.programme.pressure for plan in plans} == set(CORE.pressures), split


def test_every_ratio_is_trained_and_tested(core):
    for split in ("train", "test"):
        plans = by_split(core)[split]
        assert {getattr(p.programme, "b", 0.0) for p in plans} == set(CORE.ratios), split


def test_all_specimens_of_the_unseen_grading_are_out_of_distribution(core):
    for plan in core:
        assert (plan.specimen.split == "ood-psd") == (plan.specimen.grading == UNSEEN_GRADING)


def test_test_and_validation_hold_one_friction_of_every_seen_grading_and_every_density(core):
    originals = {plan.specimen for plan in core if plan.specimen.replicate == 0}
    for split in ("validation", "test"):
        chosen = [s for s in originals if s.split == split]
        seen = Counter(specimen.grading for specimen in chosen)
        assert set(seen) == set(GRADINGS) - {UNSEEN_GRADING} and set(seen.values()) == {1}
        assert {specimen.preparation_friction for specimen in chosen} == set(ALL_FRICTIONS)


def test_replicates_share_split_and_programmes_with_their_originals_but_not_their_seed(core):
    loads = {}
    for plan in core:
        loads.setdefault(plan.specimen, []).append(plan.programme)
    replicates = [specimen for specimen in loads if specimen.replicate]
    assert len(replicates) == CORE.replicates
    for replicate in replicates:
        (original,) = (
            s for s in loads
            if s.replicate == 0 and (s.grading, s.preparation_friction)
            == (replicate.grading, replicate.preparation_friction)
        )  # fmt: skip
        assert replicate.split == original.split and replicate.seed != original.seed
        assert loads[replicate] == loads[original]


def test_densest_and_loosest_of_every_grading_share_a_compression(core):
    anchored = {plan.specimen.grading: set() for plan in core}
    anchor = ConstantMeanStress(pressure=ANCHOR_PRESSURE, b=0.0, axial_strain=0.4)
    for plan in core:
        if plan.programme == anchor:
            anchored[plan.specimen.grading].add(plan.specimen.preparation_friction)
    assert all({min(ALL_FRICTIONS), max(ALL_FRICTIONS)} <= found for found in anchored.values())


def test_jobs_of_a_part_are_jobs_of_the_whole():
    part = CORE.model_copy(update={"only_gradings": ("bell", "mono"), "only_levels": (0, 6)})
    small = jobs(TRIAXIAL, part, 0)
    large = {job.key: job for job in jobs(TRIAXIAL, CORE, 0)}
    assert len(small) > 30
    assert all(large[job.key] == job for job in small)


def test_every_specimen_is_prepared_once_and_before_its_tests(core):
    planned = jobs(TRIAXIAL, CORE, 0)
    keys = [job.key for job in planned]
    assert len(keys) == len(set(keys)) == len(core) + len(specimens(CORE, 0))
    seen = set()
    for job in planned:
        assert seen.issuperset(job.needs)
        seen.add(job.key)


def test_another_seed_changes_specimens_and_drawn_loadings_but_no_split(core):
    other = planned_tests(CORE, 1)
    assert [p.name for p in other] == [p.name for p in core]
    assert [p.specimen.split for p in other] == [p.specimen.split for p in core]
    for one, two in zip(core, other, strict=True):
        assert one.specimen.seed != two.specimen.seed
        drawn = one.programme.loading_family in ("cyclic", "random-strain")
        assert (one.programme != two.programme) == drawn


def test_adding_a_grading_changes_no_other_specimen():
    fewer = CORE.model_copy(update={"gradings": CORE.gradings[:4], "replicates": 0})
    known = {(s.name, s.seed) for s in specimens(CORE, 0)}
    assert all((s.name, s.seed) in known for s in specimens(fewer, 0))


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_is_planned(name):
    assert {plan.programme.pressure for plan in planned_tests(PRESETS[name], 0)} <= set(
        PRESETS[name].pressures
    )


def test_more_replicates_than_specimens_are_refused_by_field():
    with pytest.raises(ConfigurationError, match="replicates"):
        specimens(CORE.model_copy(update={"replicates": 99}), 0)
