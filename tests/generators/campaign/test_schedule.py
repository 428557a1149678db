"""Order and dependencies of jobs, without running them."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from granbench.errors import ConfigurationError
from granbench.generators.campaign.schedule import Job, Schedule, digests


def job(key: str, *needs: str, seed: int = 0, **configuration: object) -> Job:
    return Job(key, "toy_jobs:walk", configuration, seed, needs)


@st.composite
def job_lists(draw: st.DrawFn) -> list[Job]:
    """Random campaigns without cycles, whose jobs are not listed in topological order."""
    count = draw(st.integers(1, 12))
    edges = draw(st.sets(st.tuples(st.integers(0, 11), st.integers(0, 11)), max_size=20))
    jobs = [job(f"j{i}", *[f"j{a}" for a, b in sorted(edges) if b == i and a < b])
            for i in range(count)]  # fmt: skip
    return draw(st.permutations(jobs))


@given(jobs=job_lists(), workers=st.integers(1, 4), seed=st.integers(0, 2**16))
def test_every_job_runs_once_in_order_of_priority_after_all_that_it_needs(jobs, workers, seed):
    schedule = Schedule(jobs)
    rng = random.Random(seed)
    running: list[str] = []
    done: set[str] = set()
    while True:
        while len(running) < workers and (taken := schedule.take()):
            assert set(taken.needs) <= done
            assert taken.key not in done and taken.key not in running
            waiting = [j for j in jobs if j.key not in done and j.key not in running]
            assert taken.key == next(j.key for j in waiting if set(j.needs) <= done)
            running.append(taken.key)
        if not running:
            break
        ended = running.pop(rng.randrange(len(running)))
        if rng.random() < 0.2:
            schedule.put_back(ended)
        else:
            done.add(ended)
            schedule.finish(ended)
    assert done == {j.key for j in jobs}


@given(jobs=job_lists(), bad=st.integers(0, 11))
def test_a_failure_stops_exactly_the_jobs_that_depend_on_it(jobs, bad):
    schedule = Schedule(jobs)
    failing = jobs[bad % len(jobs)].key
    stopped: set[str] = set()
    ended: set[str] = set()
    while taken := schedule.take():
        ended.add(taken.key)
        if taken.key == failing:
            for user, need in schedule.fail(taken.key):
                assert need in schedule.jobs[user].needs
                assert need in stopped | {failing}
                stopped.add(user)
        else:
            schedule.finish(taken.key)
    reach = {failing}
    for key in schedule.order:
        if reach & set(schedule.jobs[key].needs):
            reach.add(key)
    assert stopped == reach - {failing}
    assert ended == set(schedule.jobs) - stopped


def test_circular_needs_repeated_keys_and_missing_needs_are_refused():
    with pytest.raises(ConfigurationError, match="circle: a, b"):
        Schedule([job("a", "b"), job("b", "a"), job("c")])
    with pytest.raises(ConfigurationError, match="key a"):
        Schedule([job("a"), job("a")])
    with pytest.raises(ConfigurationError, match="needs ghost"):
        Schedule([job("a", "ghost")])


@pytest.mark.parametrize("key", ["", "/a", "a/", "a__b", "a//b", "../a", "a b", "ä", "a" * 300])
def test_a_key_that_cannot_name_a_folder_is_refused(key):
    with pytest.raises(ConfigurationError, match="job key"):
        job(key)


@given(st.lists(st.text("aB1.-_/", max_size=6), min_size=2, max_size=2, unique=True))
def test_different_keys_have_different_folders(keys):
    try:
        first, second = (job(key) for key in keys)
    except ConfigurationError:
        return
    assert first.slug != second.slug
    assert "/" not in first.slug


@pytest.mark.parametrize("setting", [float("nan"), object(), {1, 2}])
def test_a_configuration_that_is_not_json_is_refused(setting):
    with pytest.raises(ConfigurationError, match="plain JSON"):
        job("a", setting=setting)


def test_a_configuration_cannot_be_changed_afterwards():
    setting = {"friction": [0.1, 0.2]}
    made = job("a", **setting)
    setting["friction"].append(0.3)
    assert made.configuration["friction"] == [0.1, 0.2]
    with pytest.raises(TypeError):
        made.configuration["friction"] = 0.4  # type: ignore[index]


def test_the_digest_follows_every_setting_of_a_job_and_of_what_it_needs():
    def digest_of_b(first: Job, second: Job) -> str:
        return digests(Schedule([second, first]))["b"]

    b = job("b", "a", steps=3, pressure=1.0)
    same = digest_of_b(job("a", steps=3), b)
    assert same == digest_of_b(job("a", steps=3), job("b", "a", pressure=1.0, steps=3))
    assert len({
        same,
        digest_of_b(job("a", steps=4), b),
        digest_of_b(job("a", steps=3, seed=1), b),
        digest_of_b(job("a", steps=3), job("b", "a", steps=3, pressure=2.0)),
        digest_of_b(job("a", steps=3), job("b", steps=3, pressure=1.0)),
    }) == 5  # fmt: skip
