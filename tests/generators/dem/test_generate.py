"""One small campaign from end to end: its data, its continuation, and its errors."""

import contextlib
import dataclasses
import json
import os
import re
import shutil
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from granbench.errors import EngineError
from granbench.generators.campaign.report import MissingResults
from granbench.generators.dem import engine
from granbench.generators.dem.generator import GENERATOR
from granbench.generators.dem.recording import (
    LARGEST_INERTIAL_NUMBER,
    LARGEST_RATIO_ERROR,
    LARGEST_SERVO_ERROR,
    stress_tensor,
)
from granbench.records import open_records, validate_records, verify

TESTS = [
    f"mono-f{friction}-r0/{number}"
    for friction in ("0.000", "0.300")
    for number in ("00-constant-p", "01-cyclic", "02-random-strain")
]


def generate(out, generator=GENERATOR, **options):
    return generator.generate("dem-triaxial", "smoke", out, progress="quiet", **options)


def with_broken_jobs(broken):
    """The generator, with other functions in `broken_tests` for some jobs, by key."""

    def jobs(dataset, preset, seed):
        return [
            dataclasses.replace(job, function=f"broken_tests:{broken[job.key]}")
            if job.key in broken
            else job
            for job in GENERATOR.jobs(dataset, preset, seed)
        ]

    return dataclasses.replace(GENERATOR, jobs=jobs)


def result_of(out, test):
    return out / "campaign" / "results" / test.replace("/", "__")


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """Folder of a finished smoke campaign, its file and its report; tests must not change them."""
    # LIGGGHTS interprets most of these characters, and truncates long input lines.
    out = tmp_path_factory.mktemp("smoke") / f'a b $HOME #x\t"q\'u" & * % ünï 日本 {"n" * 180}'
    path, report = generate(out)
    return out, path, report


@pytest.fixture
def own(finished, tmp_path):
    """A copy of the folder of the finished campaign."""
    return Path(shutil.copytree(finished[0], tmp_path / "own"))


@pytest.fixture
def dataset(finished):
    with open_records(finished[1]) as ds:
        yield ds.load()


def test_every_job_of_the_smoke_campaign_succeeds(finished):
    _, _, report = finished
    assert report.failed == {} and report.skipped == ()
    assert sorted(key for key in report.done if key in TESTS) == TESTS
    assert len(report.done) == len(TESTS) + 2


def test_dataset_is_valid_sealed_and_states_how_it_was_made(finished, dataset):
    _, path, _ = finished
    validate_records(dataset, str(path))
    verify(dataset, str(path))
    assert list(dataset.path_id.values) == TESTS
    assert dataset.sizes["step"] == 61 and dataset.attrs["planned_paths"] == len(TESTS)
    configuration = json.loads(dataset.attrs["configuration"])
    assert configuration["preset"]["particle_count"] == 400
    assert configuration["material"]["young_modulus"] == 0.8e9
    assert dataset.attrs["engine_version"].startswith("3.")


def test_every_path_keeps_the_limits_of_the_dataset(dataset):
    assert dataset.servo_error_rms.max() <= LARGEST_SERVO_ERROR
    held = dataset.intermediate_stress_ratio.notnull()
    assert held.sum() == 2
    assert dataset.stress_ratio_error_rms[held].max() <= LARGEST_RATIO_ERROR
    assert dataset.stress_ratio_error_rms[~held].isnull().all()
    assert 0 < dataset.peak_inertial_number.max() <= LARGEST_INERTIAL_NUMBER
    # A record has the largest of its chunks, so that the largest of the records is that of all.
    np.testing.assert_allclose(
        dataset.inertial_number.max("step"), dataset.peak_inertial_number, rtol=1e-6
    )
    both = np.concatenate([dataset.stress, dataset.shear_stress], axis=-1)
    assert np.linalg.eigvalsh(stress_tensor(both)).min() > 0


def test_void_ratio_follows_the_volumetric_strain(dataset):
    """(1 + e) = (1 + e0) exp(-eps_v), because the volume of the grains is constant."""
    strain = dataset.strain.sum("component").astype(float)
    start = 1 + dataset.void_ratio.isel(step=0).astype(float)
    # Float32 rounding of e and of three strains up to 0.1.
    np.testing.assert_allclose(
        1 + dataset.void_ratio.astype(float), start * np.exp(-strain), rtol=3e-7
    )
    # The box edges in a restart file are one time step ahead of its state.
    np.testing.assert_allclose(
        dataset.void_ratio.isel(step=0), dataset.initial_void_ratio, rtol=1e-5
    )


def test_paths_start_isotropic_at_their_pressure(dataset):
    start = dataset.stress.isel(step=0)
    np.testing.assert_allclose(
        start, np.repeat(dataset.initial_mean_stress.values[:, None], 3, axis=1), rtol=0.01
    )
    np.testing.assert_array_equal(dataset.strain.isel(step=0), 0.0)
    np.testing.assert_allclose(
        dataset.fabric.isel(fabric_component=[0, 1, 2]).sum("fabric_component"), 1.0, atol=1e-5
    )


def test_frictionless_preparation_is_denser_and_peaks_higher(dataset):
    dense, loose = (dataset.sel(path=dataset.preparation_friction == mu) for mu in (0.0, 0.3))
    assert dense.initial_void_ratio.max() < loose.initial_void_ratio.min() - 0.1
    assert (
        dense.coordination_number.isel(step=0).min() > loose.coordination_number.isel(step=0).max()
    )
    q_over_p = [
        float((s[:, 0] - s[:, 2]).max() / 0.5e6)
        for s in (ds.stress.isel(path=0).values for ds in (dense, loose))
    ]
    assert q_over_p[0] > 1.2 * q_over_p[1]


def test_running_again_continues_without_a_job_and_gives_the_same_file(own, finished):
    _, path, report = finished
    (own / path.name).unlink()
    same_path, again = generate(own)
    assert set(again.skipped) == set(report.done) and not again.failed
    with open_records(path) as first, open_records(same_path) as second:
        assert first.attrs["content_sha256"] == second.attrs["content_sha256"]


def test_one_test_run_twice_gives_the_same_bits(own):
    result = result_of(own, TESTS[1])
    before = (result / "record.npz").read_bytes()
    shutil.rmtree(result)
    _, report = generate(own)
    assert len(report.skipped) == len(report.done) - 1
    assert (result / "record.npz").read_bytes() == before


def helper_of_a_job() -> int | None:
    """The MPI daemon that LIGGGHTS has started in a job of this process."""
    parents, names = {}, {}
    for file in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            before, _, after = file.read_text().rpartition(")")
            parents[int(file.parent.name)] = int(after.split()[1])
            names[int(file.parent.name)] = before.partition("(")[2]
    for process, name in names.items():
        if name == "orted" and parents.get(parents[process]) == os.getpid():
            return process
    return None


def test_a_job_whose_mpi_helper_is_killed_is_tried_again_and_gives_the_same_bits(own):
    result = result_of(own, TESTS[0])
    before = (result / "record.npz").read_bytes()
    shutil.rmtree(result)

    def kill() -> None:
        end = time.monotonic() + 60.0
        while (helper := helper_of_a_job()) is None and time.monotonic() < end:
            time.sleep(0.02)
        time.sleep(0.2)
        os.kill(helper, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    path, report = generate(own)
    killer.join()
    log = (own / "campaign" / "campaign.log").read_text()
    assert f"again {TESTS[0]}" in log
    assert not report.failed and (result / "record.npz").read_bytes() == before
    with open_records(path) as ds:
        assert ds.sizes["path"] == ds.attrs["planned_paths"]


def test_a_dataset_without_the_result_of_a_killed_job_is_not_written(own, monkeypatch):
    shutil.rmtree(result_of(own, TESTS[0]))
    (own / "dem-triaxial-0.0.0+smoke.nc").unlink()
    with monkeypatch.context() as broken:
        broken.setenv("PYTHONPATH", str(Path(__file__).parent))
        with pytest.raises(MissingResults, match=f"{TESTS[0]} .*SIGKILL"):
            generate(own, with_broken_jobs({TESTS[0]: "killed"}))
    assert not list(own.glob("*.nc"))


def test_a_damaged_record_of_a_test_is_made_again(own, finished):
    result = result_of(own, TESTS[3])
    (result / "record.npz").write_bytes((result / "record.npz").read_bytes()[:5000])
    path, report = generate(own)
    assert list(report.damaged) == [TESTS[3]]
    with open_records(finished[1]) as first, open_records(path) as again:
        assert first.attrs["content_sha256"] == again.attrs["content_sha256"]


def test_failed_tests_are_recorded_with_their_reasons_and_are_not_in_the_data(own, monkeypatch):
    broken = {
        TESTS[0]: ("held_too_loosely", "servo error .* RMS > 0%"),
        TESTS[2]: ("loses_a_grain", "1 of 400 grains left the box"),
        TESTS[4]: ("stopped_by_the_engine", "ERROR.*no/such/style"),
    }

    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    for test in broken:
        shutil.rmtree(result_of(own, test))
    generator = with_broken_jobs({test: function for test, (function, _) in broken.items()})
    path, report = generate(own, generator)
    assert set(report.failed) == set(broken) == report.permanent
    for test, (_, reason) in broken.items():
        assert re.search(reason, report.failed[test])
    with open_records(path) as ds:
        assert list(ds.path_id.values) == [test for test in TESTS if test not in broken]
        assert ds.attrs["planned_paths"] == len(TESTS)


def test_missing_engine_is_named_before_any_work(tmp_path, monkeypatch):
    monkeypatch.setattr(engine, "LIBRARY", "libno-such-engine.so.3")
    with pytest.raises(EngineError, match=r"libno-such-engine\.so\.3"):
        generate(tmp_path)
    assert not (tmp_path / "campaign").exists()
