"""Laws that hold for every registered generator."""

import json
import os
import signal
import subprocess
import sys
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from campaign_support import PATIENCE, files_of, quiet, wait_until

from granbench.errors import ConfigurationError, RegistryError
from granbench.generators.campaign import Job
from granbench.generators.campaign.schedule import Schedule, digests
from granbench.generators.find import ENTRY_POINTS, dataset_names, find_generator
from granbench.records import open_records, verify
from granbench.units.plausible import LARGEST_SEED

DATASETS = dataset_names()
CASES = [(name, preset) for name in DATASETS for preset in find_generator(name).presets]
FAMILIES = {point.name: point.load() for point in entry_points(group=ENTRY_POINTS)}
FIRST = [next(iter(generator.datasets)) for generator in FAMILIES.values()]
"""One dataset of each family."""


def identities(dataset: str, preset: str, seed: int = 0) -> dict[str, str]:
    """Hash, by key, of everything that the result of each planned job depends on."""
    return digests(Schedule(find_generator(dataset).planned_jobs(dataset, preset, seed)))


@cache
def identities_elsewhere() -> dict[str, dict[str, str]]:
    """`identities` of all cases, in a process that orders sets in another way."""
    program = (
        "import json; from test_generator_laws import CASES, identities; "
        "print(json.dumps({'/'.join(case): identities(*case) for case in CASES}))"
    )
    environment = {**os.environ, "PYTHONHASHSEED": "7", "PYTHONPATH": str(Path(__file__).parent)}
    command = [sys.executable, "-c", program]
    return json.loads(subprocess.check_output(command, env=environment))


@pytest.mark.parametrize(("dataset", "preset"), CASES)
def test_jobs_are_a_pure_function_of_preset_and_seed(dataset, preset):
    first = identities(dataset, preset)
    assert first == identities(dataset, preset) == identities_elsewhere()[f"{dataset}/{preset}"]
    other = identities(dataset, preset, 1)
    assert list(other) == list(first)
    assert not set(other.values()) & set(first.values())


@pytest.mark.parametrize("family", FAMILIES)
def test_every_dataset_of_a_family_is_found_by_its_name(family):
    for name in FAMILIES[family].datasets:
        assert find_generator(name) is FAMILIES[family]
        assert name in DATASETS


@pytest.mark.parametrize("dataset", DATASETS)
def test_presets_have_a_smoke_size_and_versions_of_their_own(dataset):
    presets = find_generator(dataset).presets
    assert {"smoke", "core", "paper"} <= set(presets)
    assert all(preset.name == name for name, preset in presets.items())
    assert len({preset.version for preset in presets.values()}) == len(presets)


@pytest.mark.parametrize("dataset", FIRST)
def test_unknown_names_and_seeds_are_refused_before_any_work(dataset, tmp_path):
    generate = find_generator(dataset).generate
    with pytest.raises(RegistryError, match="'huge'"):
        generate(dataset, "huge", tmp_path / "new")
    with pytest.raises(RegistryError, match="'none-such'"):
        generate("none-such", "smoke", tmp_path / "new")
    for seed in (-1, LARGEST_SEED + 1):
        with pytest.raises(ConfigurationError, match="seed"):
            generate(dataset, "smoke", tmp_path / "new", seed=seed)
    assert not (tmp_path / "new").exists()


def one_result(dataset: str, seed: int) -> list[Job]:
    """One job of the smoke preset whose result depends on the seed, and the jobs that it needs."""
    planned, other = (
        find_generator(dataset).planned_jobs(dataset, "smoke", number) for number in (0, 1)
    )
    needed = {key for job in planned for key in job.needs}
    final = [job.key for job in planned if job.key not in needed]
    drawn = [
        a.key for a, b in zip(planned, other, strict=True) if a.configuration != b.configuration
    ]
    chosen = next((key for key in final if key in drawn), final[0])
    jobs = {job.key: job for job in find_generator(dataset).planned_jobs(dataset, "smoke", seed)}
    return [*(jobs[key] for key in jobs[chosen].needs), jobs[chosen]]


def values_in(folder: Path) -> dict[str, bytes]:
    """All files of all results, without logs, which contain the time of day."""
    return {name: content for name, content in files_of(folder).items() if ".log" not in name}


def run(dataset: str, seed: int, folder: str) -> None:
    """Run the jobs of `one_result`; called in another process."""
    quiet(one_result(dataset, seed), Path(folder))


@pytest.mark.parametrize("dataset", FIRST)
def test_a_killed_campaign_resumes_to_the_same_bits_and_another_seed_gives_others(
    dataset, tmp_path, toy_jobs
):
    whole = quiet(one_result(dataset, 0), tmp_path / "whole")
    assert not whole.failed

    program = f"from test_generator_laws import run; run({dataset!r}, 0, {str(tmp_path / 'cut')!r})"
    command = subprocess.Popen([sys.executable, "-c", program])
    try:
        wait_until(lambda: list(tmp_path.glob("cut/attempts/*/*/out")))
        command.send_signal(signal.SIGKILL)
    finally:
        command.kill()
        command.wait(PATIENCE)
    resumed = quiet(one_result(dataset, 0), tmp_path / "cut")
    assert not resumed.failed
    assert values_in(tmp_path / "cut") == values_in(tmp_path / "whole")

    quiet(one_result(dataset, 1), tmp_path / "other")
    assert values_in(tmp_path / "other") != values_in(tmp_path / "whole")


@pytest.mark.slow
@pytest.mark.parametrize("dataset", DATASETS)
def test_two_runs_of_one_seed_write_the_same_values_and_another_seed_writes_others(
    dataset, tmp_path
):
    hashes = []
    for folder, seed in (("first", 0), ("second", 0), ("other", 1)):
        generate = find_generator(dataset).generate
        path, _ = generate(dataset, "smoke", tmp_path / folder, seed=seed, progress="quiet")
        with open_records(path) as records:
            verify(records.load(), str(path))
            hashes.append(records.attrs["content_sha256"])
    assert hashes[0] == hashes[1] != hashes[2]
