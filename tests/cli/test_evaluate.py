"""`granbench evaluate`, `submission` and `leaderboard`, as a user types them."""

import json
import re

import numpy as np
import pytest
import xarray as xr
import yaml
from embedded_tasks import embedding_records, task_of
from plane_records import plane_records

from granbench.benchmark.axes.along_paths.protocols import NOISE_PROTOCOLS
from granbench.benchmark.axes.physics.checks import CHECKS
from granbench.benchmark.predictions import open_predictions
from granbench.cli import main
from granbench.leaderboard.submission import read_submission
from granbench.models import find_model
from granbench.models.parameter_file import write_parameters
from granbench.records import open_records, write_records

MODEL = """
import torch
from granbench.cells.contract import ModuleCell

class Stiff(torch.nn.Module):
    def __init__(self, stiffness):
        super().__init__()
        self.stiffness = torch.nn.Parameter(torch.tensor(stiffness))
    def forward(self, dstrain, stress):
        return stress + self.stiffness * dstrain

def cell(seed):
    return ModuleCell(Stiff(1e6 * (1 + seed)), name="my stiff cell")

def folder_cell(model_dir, records):
    assert records.attrs["dataset"] == "synthetic"
    return ModuleCell(Stiff(float((model_dir / "stiffness").read_text())), name="from-folder")

def module():
    return Stiff(1.0)

def broken():
    return 1 / 0
"""


@pytest.fixture
def granbench(capsys, monkeypatch, tmp_path):
    """Run a command in a folder of its own; gives exit code, standard output and error."""
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.chdir(tmp_path)

    def run(*words):
        capsys.readouterr()
        with pytest.raises(SystemExit) as left:
            main([str(word) for word in words])
        captured = capsys.readouterr()
        return left.value.code, captured.out, captured.err

    return run


@pytest.fixture
def task(shelf, records):
    """The synthetic records as a registered dataset that is at hand, and its task."""
    shelf.add_task(shelf.publish(records))
    shelf.use_mirror(shelf.mirror)
    return "synthetic"


@pytest.fixture
def my_model(tmp_path, monkeypatch):
    """A user's module in the working directory."""
    monkeypatch.delitem(__import__("sys").modules, "stiff_model", raising=False)
    (tmp_path / "stiff_model.py").write_text(MODEL)
    return "stiff_model:cell"


def tables_of(out):
    """Lines of the output without notes, which are as long as they need to be."""
    return [line for line in out.splitlines() if not line.startswith("note: ")]


def refused(result, *parts):
    code, out, err = result
    assert (code, out) == (2, "")
    assert err.startswith("error: ") and err.count("\n") == 1, err
    for part in parts:
        assert part in err


def test_from_a_baseline_to_the_board(granbench, task, tmp_path):
    code, out, _ = granbench(
        "evaluate", "persistence", "--task", task, "--out", "runs/persistence.json"
    )
    assert code == 0
    assert "noise-1.0" in out and "split ood-psd" in out
    assert "…" not in out  # nothing is cut
    submission = read_submission(tmp_path / "runs" / "persistence.json")
    assert (submission.role, submission.seeds) == ("floor", (0, 1, 2))
    assert submission.authors == ("The GranBench authors",)
    assert submission.command == (
        "granbench evaluate persistence --task synthetic --seeds 0,1,2 --out persistence.json"
    )
    code, out, _ = granbench("submission", "validate", "runs/persistence.json")
    assert code == 0 and "is valid" in out
    code, out, _ = granbench("submission", "validate", "runs/persistence.json", "--json")
    assert json.loads(out)["badge"] == "rescored"
    code, out, _ = granbench("leaderboard", "add", "runs/persistence.json", "--board", "board")
    assert code == 0 and (tmp_path / "board/synthetic/persistence.nc").is_file()
    refused(
        granbench("leaderboard", "add", "runs/persistence.json", "--board", "board"),
        "is on the board",
    )
    granbench("evaluate", "linear-elastic", "--task", task, "--out", "mine.json", "--quiet")
    code, out, _ = granbench(
        "leaderboard", "build", "--board", "board", "--with", "mine.json", "--out", "site"
    )
    assert code == 0 and "shows 2 submissions" in out
    page = (tmp_path / "site" / "synthetic-1.0.0.html").read_text()
    assert '"badge claimed"' in page and '"badge rescored"' in page
    assert "replicate scatter" in page


def test_a_module_of_the_users_own_is_scored(granbench, task, my_model, tmp_path):
    code, out, _ = granbench(
        "evaluate", my_model, "--task", task, "--axis", "rollout", "--seeds", "4,7",
        "--authors", "A. Body, B. Else", "--code", "https://example.org/x",
        "--training-data", "none", "--json",
    )  # fmt: skip
    assert code == 0
    submission = read_submission(tmp_path / "submission.json")
    assert json.loads(out)["name"] == submission.name == "my stiff cell"
    assert submission.authors == ("A. Body", "B. Else")
    assert (submission.seeds, submission.parameters, submission.role) == ((4, 7), 1, "model")
    with open_predictions(tmp_path / "submission.nc") as predictions:
        assert list(predictions["protocol"].values) == ["rollout"]
    stresses = [score for score in submission.scores if score.metric == "stress_mse_mean"]
    assert {score.status for score in stresses if score.protocol == "rollout"} == {"scored"}
    assert {score.status for score in stresses if score.protocol == "window"} == {"not_run"}


PLANE_MODEL = """
import torch
from granbench.cells.contract import ModuleCell

class Stiff(torch.nn.Module):
    def forward(self, dstrain, stress):
        return stress + 1e6 * dstrain

def cell():
    return ModuleCell(Stiff(), name="ten lines", order="plane")
"""


@pytest.fixture
def plane_task(tmp_path):
    """Records that J2 made, in a file of the working directory."""
    write_records(plane_records(), tmp_path / "gp.nc")
    return "gp.nc"


@pytest.mark.parametrize("model", ["j2", "j2.json", "persistence", "linear-elastic", "plane:cell"])
def test_physics_is_checked_for_every_kind_of_model(
    granbench, plane_task, tmp_path, monkeypatch, model
):
    monkeypatch.delitem(__import__("sys").modules, "plane", raising=False)
    (tmp_path / "plane.py").write_text(PLANE_MODEL)
    write_parameters(find_model("j2")({"yield_stress": 5e4}), tmp_path / "j2.json")
    code, out, err = granbench("evaluate", model, "--task", plane_task, "--axis", "physics",
                               "--out", "out.json")  # fmt: skip
    assert code == 0, err
    assert not any("…" in line for line in tables_of(out))
    for check in CHECKS.values():
        assert check.title in out
    assert "passes" in out and "VIOLATED" not in out
    assert "Compression: n/a, the material of this task may carry tension." in out
    assert "Cost" not in out and "stress" not in out.lower().partition("physics")[0]


def test_a_violated_law_is_marked(granbench, plane_task, tmp_path, monkeypatch):
    monkeypatch.delitem(__import__("sys").modules, "lawless_cells", raising=False)
    (tmp_path / "creeping.py").write_text(
        "from lawless_cells import Relaxing, cell\n\ndef creeping():\n    return cell(Relaxing())\n"
    )
    code, out, _ = granbench("evaluate", "creeping:creeping", "--task", plane_task, "--axis",
                             "physics", "--axis", "cost", "--out", "out.json")  # fmt: skip
    assert code == 0
    assert re.search(r"Zero increment .* 100 %  VIOLATED", out)
    assert "Update over ground truth, 100 at once" in out
    assert not any("…" in line for line in tables_of(out))


def test_noise_is_scored_against_both_truths(granbench, plane_task):
    code, out, _ = granbench("evaluate", "j2", "--task", plane_task, "--axis", "noise",
                             "--seeds", "0", "--out", "out.json")  # fmt: skip
    assert code == 0
    assert "* against the ground truth, recomputed along the noised strain" in out
    for name in NOISE_PROTOCOLS:
        assert re.search(rf"{re.escape(name)}\*  +0 ", out), out


def test_models_in_folders_are_the_seeds(granbench, task, my_model, tmp_path):
    for seed, stiffness in enumerate(("1e6", "2e6")):
        (tmp_path / f"run{seed}").mkdir()
        (tmp_path / f"run{seed}" / "stiffness").write_text(stiffness)
    code, out, _ = granbench(
        "evaluate", "stiff_model:folder_cell", "--task", task, "--axis", "rollout",
        "--model-dir", "run0", "--model-dir", tmp_path / "run1", "--name", "two", "--quiet",
    )  # fmt: skip
    assert (code, out) == (0, "")
    submission = read_submission(tmp_path / "submission.json")
    assert submission.seeds == (0, 1)
    assert "--model-dir run0 --model-dir run1 --seeds 0,1 --name two" in submission.command
    first = next(score for score in submission.scores if score.status == "scored")
    assert first.by_seed[0] != first.by_seed[1]


def test_scores_are_shown_with_the_floors(granbench, task, my_model):
    granbench("evaluate", "persistence", "--task", task, "--out", "floor.json", "--quiet")
    code, out, _ = granbench(
        "evaluate", my_model, "--task", task, "--axis", "window", "--against", "floor.json",
        "--seeds", "0",
    )  # fmt: skip
    assert code == 0
    assert "Stress MSE compared with others" in out and "persistence" in out
    assert "window" in out and "single-step" not in out


def test_the_oracle_is_the_ceiling(granbench, task, tmp_path):
    granbench("evaluate", "oracle", "--task", task, "--quiet")
    submission = read_submission(tmp_path / "submission.json")
    assert submission.role == "ceiling"
    assert all(not score.value for score in submission.scores)


def test_a_wrong_argument_is_refused_in_one_sentence(granbench, task, my_model, tmp_path):
    refused(granbench("evaluate", "persistance", "--task", task), "persistence")
    refused(granbench("evaluate", "mlstm", "--task", task), "mlstm")
    refused(granbench("evaluate", "persistence", "--task", "nowhere"), "task", "nowhere")
    refused(granbench("evaluate", "persistence", "--task", task, "--axis", "sideways"),
            "axis", "sideways", "rollout")  # fmt: skip
    refused(granbench("evaluate", "persistence", "--task", task, "--seeds", "0,x"), "--seeds")
    refused(granbench("evaluate", "persistence", "--task", task, "--seeds", "1,1"), "--seeds")
    refused(granbench("evaluate", "persistence", "--task", task, "--out", "a.txt"), "--out")
    refused(granbench("evaluate", "persistence", "--task", task, "--model-dir", "x"),
            "--model-dir")  # fmt: skip
    refused(granbench("evaluate", "mlstm", "--task", task, "--model-dir", "x"), "model.json")
    refused(granbench("evaluate", "no_such_module:f", "--task", task), "no_such_module")
    refused(granbench("evaluate", "stiff_model:absent", "--task", task), "absent")
    refused(granbench("evaluate", "stiff_model:module", "--task", task), "ModuleCell")
    refused(granbench("evaluate", "stiff_model:broken", "--task", task),
            "ZeroDivisionError", "stiff_model.py line")  # fmt: skip
    refused(granbench("evaluate", my_model, "--task", task, "--code", "ftp://x"), "code")
    refused(granbench("submission", "validate", "absent.json"), "absent.json")
    refused(granbench("leaderboard", "add", "absent.json"), "absent.json")
    refused(granbench("leaderboard", "build", "--board", "absent", "--out", "site"), "--board")
    assert not list(tmp_path.glob("*.json")) and not list(tmp_path.glob("*.nc"))
    assert not list(tmp_path.glob(".*part*"))


def test_a_full_disk_leaves_nothing_half_written(granbench, task, tiny_disk):
    refused(
        granbench("evaluate", "persistence", "--task", task, "--out", tiny_disk / "s.json"),
        "cannot be written",
        "free some space",
    )
    assert list(tiny_disk.iterdir()) == []


def test_the_schema_is_printed(granbench):
    code, out, _ = granbench("submission", "schema")
    assert code == 0 and json.loads(out)["title"] == "GranBench submission"


def test_a_trained_baseline_states_its_seed_and_training_data(granbench, task, tmp_path):
    code, _, err = granbench("train", "lstm", "--task", task, "--epochs", "1", "--seed", "5",
                             "--out", "run", "--quiet")  # fmt: skip
    assert code == 0, err
    for model in (("run",), ("lstm", "--model-dir", "run")):
        code, _, err = granbench("evaluate", *model, "--task", task, "--axis", "window", "--quiet")
        assert code == 0, err
        submission = read_submission(tmp_path / "submission.json")
        assert (submission.name, submission.seeds, submission.role) == ("lstm", (5,), "model")
        assert submission.training_data.startswith("synthetic 1.0.0, split train, checkpoint")
        assert "content" not in submission.training_data
        assert submission.parameters > 1000
    refused(granbench("evaluate", "lstm", "--task", task, "--model-dir", "run",
                      "--model-dir", "run"), "seeds")  # fmt: skip
    refused(granbench("evaluate", "lstm", "--task", task, "--model-dir", "run",
                      "--seeds", "1,2"), "seeds")  # fmt: skip


def test_a_file_that_differs_from_its_hashes_is_neither_trained_on_nor_scored(
    granbench, records_file, tmp_path
):
    altered = tmp_path / "altered.nc"
    with xr.open_dataset(records_file) as records:
        changed = records.load().copy(deep=True)
    changed["stress"][0, 3, 0] += 1.0
    changed.to_netcdf(altered)
    refused(granbench("evaluate", "oracle", "--task", altered, "--out", "o.json"), "stress")
    refused(granbench("train", "mlstm", "--task", altered, "--out", "m", "--epochs", "1"), "stress")
    assert sorted(file.name for file in tmp_path.iterdir()) == [
        "altered.nc",
        "synthetic.nc",
    ]


def test_the_oracle_scores_zero_where_there_is_no_void_ratio(granbench, records, tmp_path):
    write_records(records.drop_vars("void_ratio"), tmp_path / "dry.nc")
    code, out, _ = granbench("evaluate", "oracle", "--task", "dry.nc", "--out", "o.json", "--json")
    assert code == 0
    errors = [row for row in json.loads(out)["scores"] if row["metric"] == "stress_mse_mean"]
    assert errors and all(row["value"] == 0.0 for row in errors if row["status"] == "scored")


def test_a_damaged_model_description_is_named(granbench, task, tmp_path):
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "model.json").write_text("{")
    refused(granbench("evaluate", "model", "--task", task, "--out", "m.json"), "model.json")


def test_a_model_is_kept_in_place_of_its_predictions_and_run_again(granbench, tmp_path):
    records = plane_records("gp-j2").drop_vars("tangent").isel(step=slice(0, 15))
    split = records["split"].values.astype(str)
    file = write_records(records.isel(path=np.isin(split, ["train", "test"])), tmp_path / "few.nc")
    (tmp_path / "cells.py").write_text(MODEL)
    parameters = write_parameters(find_model("j2")({"yield_stress": 7e4}), tmp_path / "soft.json")
    evaluate = ("evaluate", parameters, "--task", file, "--axis", "rollout", "--keep")
    code, out, _ = granbench(*evaluate, "model", "--role", "floor", "--out", "mine.json")
    assert code == 0
    assert "mine.json and the model in mine.model are written" in out.replace("\n", " ")
    assert not (tmp_path / "mine.nc").exists()
    written = read_submission(tmp_path / "mine.json")
    assert "--keep model" in written.command
    assert written.role == "floor"
    code, out, _ = granbench("submission", "validate", "mine.json", "--dataset", file, "--json")
    assert (code, json.loads(out)["badge"]) == (0, "rerun")
    code, out, _ = granbench("submission", "validate", "mine.json", "--dataset", file)
    assert "reproduced from the model, run again" in out.replace("\n", " ")
    code, _, error = granbench(*evaluate, "everything", "--out", "mine.json")
    assert code == 2
    assert "--keep" in error and "everything" in error
    code, _, error = granbench(*evaluate, "model", "--role", "ceiling", "--out", "mine.json")
    assert code == 2
    assert "--role" in error and "ceiling" in error
    code, _, error = granbench(
        "evaluate", "cells:cell", "--task", file, "--keep", "model", "--out", "own.json"
    )
    assert code == 2
    assert "predictions" in error
    assert not (tmp_path / "own.json").exists()


def test_a_model_is_put_in_place_of_the_ground_truth(granbench, tmp_path):
    """Both solvers, every analysis by name; a task without analyses has no such axis."""
    records = embedding_records()
    file = write_records(records, tmp_path / "records.nc")
    with open_records(file) as written:
        task = task_of(written).model_copy(update={"id": "toy"})
    content = task.model_dump(mode="json", exclude_none=True)
    content["dataset"]["file"] = file.name
    (tmp_path / "toy.yaml").write_text(yaml.safe_dump(content))
    words = ("--axis", "embedded", "--seeds", "0", "--out", "embedded.json")
    code, output, error = granbench("evaluate", "linear-elastic", "--task", "toy.yaml", *words)
    assert (code, error) == (0, "")
    for solver in ("explicit", "implicit"):
        assert f"linear-elastic in place of the ground truth, {solver}" in output
    assert "Steps before failure" in output and "smooth" in output and "rough" in output
    assert "embedded has 2 analyses" in " ".join(output.split())
    submission = read_submission(tmp_path / "embedded.json")
    assert submission.task == "toy"
    assert {s.axis for s in submission.scores if s.status == "scored"} == {"embedded"}
    code, output, error = granbench("submission", "validate", "embedded.json", "--task", "toy.yaml")
    assert code == 0 and "is valid" in output, error
    code, output, _ = granbench("evaluate", "oracle", "--task", "toy.yaml", *words)
    assert code == 0
    assert "Embedded, explicit: n/a, the model reads its answers" in " ".join(output.split())
    refused(granbench("evaluate", "linear-elastic", "--task", "records.nc", *words), "'embedded'")
