"""The campaign executor with real processes, which are killed."""

import errno
import os
import random
import shutil
import signal
import threading
import time
from pathlib import Path

import pytest
from campaign_support import (
    PATIENCE,
    campaign_command,
    files_of,
    is_alive,
    processes_named_in,
    quiet,
    wait_until,
    waiting_jobs,
    walks,
)
from toy_jobs import walk_of

from granbench.errors import ConfigurationError
from granbench.generators.campaign import Job, run_campaign
from granbench.generators.campaign.report import MissingResults

pytestmark = pytest.mark.usefixtures("toy_jobs")


def test_results_depend_only_on_configuration_seed_and_needs(tmp_path):
    report = quiet(walks(), tmp_path / "one")
    assert list(report.done) == ["joined", "walk/0", "walk/1", "walk/2"]
    assert report.failed == {} and report.skipped == ()
    start = sum(walk_of(report.done[f"walk/{i}"])[-1] for i in (0, 2))
    first_step = random.Random(7).gauss(0.0, 1.0)
    assert walk_of(report.done["joined"])[0] == start + first_step
    quiet(walks(), tmp_path / "two", workers=3)
    assert files_of(tmp_path / "one") == files_of(tmp_path / "two")


def test_a_finished_campaign_is_not_run_again_and_a_lost_result_is_made_again_bit_for_bit(tmp_path):
    first = quiet(walks(), tmp_path)
    before = files_of(tmp_path)
    again = quiet(walks(), tmp_path)
    assert again.done == first.done and again.skipped == tuple(first.done)
    shutil.rmtree(first.done["joined"])
    (first.done["walk/1"] / "job.json").unlink()  # without it the result is incomplete
    completed = quiet(walks(), tmp_path)
    assert completed.skipped == ("walk/0", "walk/2")
    assert list(completed.damaged) == ["walk/1"]
    assert files_of(tmp_path) == before
    assert (tmp_path / "campaign.log").read_text().count(" done ") == 6


def test_a_lost_result_that_only_finished_jobs_needed_is_not_made_again(tmp_path):
    first = quiet(walks(), tmp_path)
    shutil.rmtree(first.done["walk/0"])  # "joined" needed it and is done
    again = quiet(walks(), tmp_path)
    assert again.not_needed == ("walk/0",)
    assert set(again.done) == {"joined", "walk/1", "walk/2"} and not again.failed


def test_output_of_jobs_does_not_reach_the_terminal(tmp_path, capfd):
    report = quiet(walks(), tmp_path)
    assert capfd.readouterr() == ("", "")
    assert "must not reach" in (report.done["walk/0"] / "job.json").read_text()


def test_the_bar_counts_failures(tmp_path, capfd):
    failing = Job("bad", "toy_jobs:rejected", {"repair": str(tmp_path / "no")}, 0)
    run_campaign([failing, *walks()], tmp_path)
    out, err = capfd.readouterr()
    assert out == ""
    assert "5/5 jobs" in err and "1 failed" in err and "must not reach" not in err


def test_a_failure_is_recorded_with_its_reason_and_stops_the_jobs_that_need_it(tmp_path):
    repair = tmp_path / "repair"
    jobs = [
        Job("bad", "toy_jobs:rejected", {"repair": str(repair)}, 0),
        Job("user", "toy_jobs:rejected", {"repair": __file__}, 0, ("bad",)),
        Job("user-of-user", "toy_jobs:rejected", {"repair": __file__}, 0, ("user",)),
        Job("engine", "toy_jobs:ends_like_an_engine", {}, 0),
        Job("silent", "toy_jobs:leaves_silently", {}, 0),
        Job("good", "toy_jobs:rejected", {"repair": __file__}, 0),
    ]
    reasons = {
        "bad": "out of range: 3 of 400",
        "user": "needs bad, which failed",
        "user-of-user": "needs user, which failed",
        "engine": "ERROR: Unknown fix style (line 7)",
        "silent": "its process ended with exit code 0 before the job was finished, 3 times",
    }
    report = quiet(jobs, tmp_path / "campaign", workers=2)
    assert report.failed == reasons
    assert report.permanent == set(reasons) - {"silent"}
    assert set(report.done) == {"good"}
    assert {file.stem for file in (tmp_path / "campaign/failed").iterdir()} == set(reasons)
    assert {file.name for file in (tmp_path / "campaign/results").iterdir()} == {"good"}
    assert "in rejected" in (tmp_path / "campaign/failed/bad.json").read_text()  # the traceback

    repair.touch()
    again = quiet(jobs, tmp_path / "campaign")
    assert again.failed == reasons  # permanent failures are not tried again
    assert again.permanent == report.permanent
    log = (tmp_path / "campaign/campaign.log").read_text()
    assert log.count("failed bad ") == 1 and log.count("failed silent ") == 2
    retried = quiet(jobs, tmp_path / "campaign", retry_failed=True)
    assert set(retried.failed) == {"engine", "silent"}
    assert list(retried.done) == ["bad", "user", "user-of-user", "good"]
    assert {file.stem for file in (tmp_path / "campaign/failed").iterdir()} == {"engine", "silent"}


@pytest.mark.parametrize("name", ["SIGKILL", "SIGTERM"])
def test_a_killed_job_is_tried_again_in_the_same_run(tmp_path, name):
    settings = {"count": str(tmp_path / "count"), "times": 2, "signal": name}
    job = Job("killed", "toy_jobs:killed_at_first", settings, 0)
    report = quiet([job], tmp_path / "campaign")
    assert files_of(tmp_path / "campaign") == {"killed/whole.txt": b"whole"}
    assert report.failed == {}
    log = (tmp_path / "campaign/campaign.log").read_text()
    assert log.count("again killed") == 2 and f"was ended by {name}" in log


@pytest.mark.parametrize("name", ["SIGKILL", "SIGSEGV", "SIGABRT", "SIGRTMIN"])
def test_a_job_that_is_ended_every_time_is_given_up_but_tried_by_the_next_command(tmp_path, name):
    settings = {"count": str(tmp_path / "count"), "times": 3, "signal": name}
    job = Job("killed", "toy_jobs:killed_at_first", settings, 0)
    report = quiet([job], tmp_path / "campaign")
    assert list(report.failed) == ["killed"] and not report.permanent
    with pytest.raises(MissingResults, match="killed"):
        report.require_every_result("toy", except_permanent=True)
    assert quiet([job], tmp_path / "campaign").failed == {}


def test_a_job_whose_helper_process_is_killed_is_tried_again(tmp_path):
    settings = {"count": str(tmp_path / "count"), "times": 1}
    job = Job("helped", "toy_jobs:loses_its_helper", settings, 0)
    report = quiet([job], tmp_path / "campaign")
    assert report.failed == {}
    assert files_of(tmp_path / "campaign") == {"helped/whole.txt": b"whole"}


@pytest.mark.parametrize("error", ["OSError", "MemoryError"])
def test_an_error_of_the_machine_is_tried_again_in_the_same_run(tmp_path, error):
    settings = {"count": str(tmp_path / "count"), "times": 2, "error": error}
    report = quiet([Job("flaky", "toy_jobs:raises_at_first", settings, 0)], tmp_path / "campaign")
    assert report.failed == {}


def test_an_exception_that_is_not_permanent_is_tried_again_by_the_next_command(tmp_path):
    settings = {"count": str(tmp_path / "count"), "times": 1, "error": "KeyError"}
    job = Job("odd", "toy_jobs:raises_at_first", settings, 0)
    report = quiet([job], tmp_path / "campaign")
    assert report.failed and not report.permanent
    assert quiet([job], tmp_path / "campaign").failed == {}


def test_permanent_failures_can_be_left_out_of_the_required_results(tmp_path):
    bad = Job("bad", "toy_jobs:rejected", {"repair": str(tmp_path / "no")}, 0)
    user = Job("user", "toy_jobs:rejected", {"repair": __file__}, 0, ("bad",))
    report = quiet([bad, user], tmp_path)
    report.require_every_result("toy", except_permanent=True)
    with pytest.raises(MissingResults, match="bad") as caught:
        report.require_every_result("toy")
    assert caught.value.permanent


def test_jobs_of_a_killed_command_end_and_the_campaign_resumes_without_loss(
    tmp_path, shared, undisturbed
):
    with campaign_command(shared, tmp_path / "campaign", workers=2) as command:
        wait_until(lambda: len(processes_named_in(shared)) == 2)
        workers = processes_named_in(shared)
        command.send_signal(signal.SIGKILL)
        wait_until(lambda: not any(map(is_alive, workers)))
    assert files_of(tmp_path / "campaign") == {}
    (shared / "go").touch()
    quiet(waiting_jobs(shared), tmp_path / "campaign", workers=2)
    assert files_of(tmp_path / "campaign") == undisturbed
    assert list((tmp_path / "campaign/attempts").iterdir()) == []


def test_ctrl_c_stops_the_jobs_at_once_and_leaves_a_folder_that_resumes(
    tmp_path, shared, undisturbed
):
    with campaign_command(shared, tmp_path / "campaign", workers=2) as command:
        wait_until(lambda: len(processes_named_in(shared)) == 2)
        workers = processes_named_in(shared)
        command.send_signal(signal.SIGINT)
        sent = time.monotonic()
        _, errors = command.communicate(timeout=PATIENCE)
        assert time.monotonic() - sent < 20.0  # the jobs themselves would never end
    assert errors.decode().rstrip().endswith("KeyboardInterrupt")
    assert not any(map(is_alive, workers))
    assert list((tmp_path / "campaign/attempts").iterdir()) == []
    assert list((tmp_path / "campaign/failed").iterdir()) == []
    (shared / "go").touch()
    quiet(waiting_jobs(shared), tmp_path / "campaign", workers=2)
    assert files_of(tmp_path / "campaign") == undisturbed


def test_killed_worker_process_loses_nothing(tmp_path, shared, undisturbed):
    def kill_the_first() -> None:
        try:
            wait_until(lambda: len(processes_named_in(shared)) == 2)
            os.kill(processes_named_in(shared)[0], signal.SIGKILL)
        finally:
            (shared / "go").touch()  # so that the jobs end in any case

    killer = threading.Thread(target=kill_the_first)
    killer.start()
    report = quiet(waiting_jobs(shared), tmp_path / "campaign", workers=2)
    killer.join()
    assert report.failed == {}
    assert len(processes_named_in(shared)) == 4
    assert files_of(tmp_path / "campaign") == undisturbed


def test_a_folder_in_use_is_refused(tmp_path, shared):
    with campaign_command(shared, tmp_path / "campaign", workers=2) as command:
        wait_until(lambda: processes_named_in(shared))
        with pytest.raises(ConfigurationError, match=f"process {command.pid}"):
            quiet(waiting_jobs(shared), tmp_path / "campaign")


def test_results_of_another_configuration_are_refused_with_the_changed_setting(tmp_path):
    quiet(walks(), tmp_path)
    with pytest.raises(ConfigurationError, match="walk/0.*steps.*20.*21"):
        quiet(walks(21)[1:], tmp_path)
    with pytest.raises(ConfigurationError, match="walk/0.*seed.*0.*5"):
        quiet([Job("walk/0", "toy_jobs:walk", {"steps": 20}, 5)], tmp_path)
    with pytest.raises(ConfigurationError, match="joined.*walk/0"):
        quiet([walks()[1], Job("joined", "toy_jobs:walk", {"steps": 20}, 7, ("walk/0",))], tmp_path)


def test_a_job_that_cannot_be_imported_stops_the_campaign(tmp_path):
    with pytest.raises(ConfigurationError, match="no_such_module"):
        quiet([Job("a", "no_such_module:function", {}, 0)], tmp_path)
    assert list((tmp_path / "failed").iterdir()) == []


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ConfigurationError, match=str(tmp_path / "file" / "campaign")):
        quiet(walks(), tmp_path / "file" / "campaign")


def test_a_folder_that_cannot_be_written_is_named():
    with pytest.raises(ConfigurationError, match="/proc/campaign"):
        quiet(walks(), Path("/proc/campaign"))


def test_a_disk_that_is_full_from_the_start_is_an_error(tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "mkdir", full)
    with pytest.raises(ConfigurationError, match="No space left"):
        quiet(walks(), tmp_path)


def test_a_full_disk_stops_the_campaign_and_fails_no_job(tmp_path):
    with pytest.raises(ConfigurationError, match="no space is left"):
        quiet([Job("full", "toy_jobs:fills_the_disk", {}, 0)], tmp_path)
    assert list((tmp_path / "failed").iterdir()) == []
    assert list((tmp_path / "results").iterdir()) == []
