"""A submission that carries its model instead of predictions: run again, or refused."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from plane_records import plane_records
from small_cells import secant
from small_submissions import about

from granbench.baselines.mlstm import BASELINE as MLSTM
from granbench.baselines.recurrent_network import RecurrentConfiguration
from granbench.baselines.training.model_files import ModelDescription, write_model
from granbench.benchmark.axes.physics.checks import CHECKS
from granbench.benchmark.evaluation import predict
from granbench.benchmark.predictions import evaluated
from granbench.benchmark.registry import axis_names
from granbench.benchmark.scorecard import Score
from granbench.cells.find import FoundModel, find_cells
from granbench.errors import SubmissionError
from granbench.leaderboard.agreement import RERUN
from granbench.leaderboard.board import Row, accept, accepted
from granbench.leaderboard.build import build
from granbench.leaderboard.composition import compose
from granbench.leaderboard.model_files import require_data_only
from granbench.leaderboard.rescoring import rescored
from granbench.leaderboard.submission import file_digest, read_submission, write_submission
from granbench.leaderboard.validation import validate
from granbench.models.j2 import J2
from granbench.models.parameter_file import write_parameters
from granbench.records import open_records, write_records

SEEDS = (0, 1, 2)


@pytest.fixture(autouse=True, scope="module")
def _hasty_clock() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("granbench.benchmark.axes.cost.predict.SECONDS", 1e-3)
        patch.setattr("granbench.benchmark.axes.cost.predict.ROUNDS", 2)
        yield


@pytest.fixture(scope="module")
def plane(tmp_path_factory) -> xr.Dataset:
    """Few and short records of J2 plasticity as they come from a file."""
    records = plane_records("gp-j2").drop_vars("tangent")
    split = records["split"].values.astype(str)
    rows = np.r_[
        tuple(np.flatnonzero(split == name)[:4] for name in ("train", "test", "ood-cyclic"))
    ]
    few = records.isel(path=rows, step=slice(0, 25))
    file = write_records(few, tmp_path_factory.mktemp("plane") / "plane.nc")
    with open_records(file) as written:
        return written.load()


def kept(model: str, records: xr.Dataset, out: Path, axes=None, **given) -> Path:
    """A submission with its model, as `granbench evaluate --keep model` writes it."""
    candidate = find_cells(model, records, **given)
    predictions = predict(
        candidate.cells,
        evaluated(records),
        axes,
        training_seconds=candidate.training_seconds,
    )
    facts = about(
        candidate.name,
        parameters=candidate.parameters,
        role="model" if candidate.trained else "floor",
    )
    compose(predictions, records, facts, out, model=candidate)
    return out


@pytest.fixture(scope="module")
def submissions(tmp_path_factory, plane) -> Path:
    """A floor, the ceiling and a classical model with parameters of its own."""
    folder = tmp_path_factory.mktemp("kept")
    write_parameters(J2({"yield_stress": 8e4}), folder / "soft.json")
    kept("persistence", plane, folder / "persistence.json")
    kept("oracle", plane, folder / "oracle.json")
    kept(str(folder / "soft.json"), plane, folder / "soft-j2.json")
    return folder


@pytest.fixture
def submission(submissions, tmp_path) -> Callable[[str], Path]:
    """A fresh copy of one of them with its model."""

    def copy(name: str) -> Path:
        for file in [*submissions.glob(f"{name}.json"), *submissions.glob(f"{name}.model/*")]:
            target = tmp_path / file.relative_to(submissions)
            target.parent.mkdir(exist_ok=True)
            target.write_bytes(file.read_bytes())
        return tmp_path / f"{name}.json"

    return copy


def changed(file: Path, change: Callable[[dict], object]) -> Path:
    content = json.loads(file.read_text())
    change(content)
    file.write_text(json.dumps(content))
    return file


def score_of(content: dict, metric: str, protocol: str = "rollout") -> dict:
    return next(
        score
        for score in content["scores"]
        if (score["metric"], score["protocol"]) == (metric, protocol) and score["value"]
    )


def test_a_kept_model_gives_its_scores_again(submission, plane) -> None:
    for name, role in (("persistence", "floor"), ("oracle", "ceiling"), ("soft-j2", "model")):
        file = submission(name)
        checked = validate(file, plane)
        assert (checked.badge, checked.role) == ("rerun", role)
        assert not file.with_suffix(".nc").exists()


def test_a_submission_lists_the_files_of_its_model(submission) -> None:
    floor, soft = (read_submission(submission(name)).model for name in ("persistence", "soft-j2"))
    assert (floor.baseline, floor.files) == ("persistence", ())
    (parameters,) = soft.files
    assert (soft.baseline, parameters.path, parameters.seed) == (
        None, "soft-j2.model/parameters.json", None,
    )  # fmt: skip
    written = json.loads((submission("soft-j2").parent / parameters.path).read_text())
    assert written["model"] == "j2"
    assert written["parameters"]["yield_stress"] == pytest.approx(8e4)


def test_trained_networks_are_run_from_their_weights(sealed, tmp_path) -> None:
    """On records of particle tests; the weights are random and cannot be guessed."""
    folders = []
    architecture = RecurrentConfiguration(initial_layer=True)
    for seed in SEEDS:
        network = MLSTM.seeded_network(architecture, seed)
        facts = {"seed": seed, "seconds": 60.0 + seed}
        description = ModelDescription(
            "mlstm", architecture.as_dict(), network.parameters_count(), training=facts
        )
        folder = tmp_path / f"run-{seed}"
        folder.mkdir()
        write_model(folder, network.state_dict(), description)
        (folder / "training.safetensors").write_bytes(b"of no use to a reader")
        folders.append(folder)
    file = kept("mlstm", sealed, tmp_path / "net.json", ["rollout", "cost"], folders=folders)
    model = read_submission(file).model
    assert {one.path for one in model.files} == {
        f"net.model/{seed}/{name}" for seed in SEEDS for name in ("model.json", "model.safetensors")
    }
    assert validate(file, sealed).badge == "rerun"
    weights = tmp_path / "net.model" / "1" / "model.safetensors"
    weights.write_bytes((tmp_path / "net.model" / "2" / "model.safetensors").read_bytes())
    with pytest.raises(SubmissionError, match=r"1/model\.safetensors"):
        validate(file, sealed)
    changed(file, lambda c: c["model"]["files"][3].update(sha256=file_digest(weights)))
    with pytest.raises(SubmissionError, match=r"1/model\.safetensors"):
        validate(file, sealed)


REFUSED: dict[str, tuple[str, Callable[[dict], object], str]] = {
    "better value": (
        "persistence",
        lambda c: score_of(c, "stress_mse_mean").update(value=0.9),
        "stress_mse_mean.* 0.9",
    ),
    "faster by far": (
        "persistence",
        lambda c: score_of(c, "update_seconds_100", "cost").update(value=1e-12),
        "update_seconds_100",
    ),
    "more obedient to physics": (
        "soft-j2",
        lambda c: score_of(c, "violation_worst", "substeps-10").update(value=9.0),
        "violation_worst",
    ),
    "fewer parameters": (
        "soft-j2", lambda c: c.update(parameters=1), "parameters is 1",
    ),
    "curve bent": (
        "persistence", lambda c: c["curves"][0]["value"].__setitem__(3, 1e-9), "curve",
    ),
    "score left out": ("persistence", lambda c: c["scores"].pop(), "score"),
    "another model's name": (
        "persistence", lambda c: c["model"].update(baseline="linear-elastic"), "parameters is 0",
    ),
    "baseline of another package": (
        "persistence", lambda c: c["model"].update(baseline="their-plugin"), "their-plugin",
    ),
    "module as baseline": (
        "persistence", lambda c: c["model"].update(baseline="os:system"), r"model\.baseline",
    ),
    "file elsewhere": (
        "soft-j2",
        lambda c: c["model"]["files"][0].update(path="../soft-j2.model/parameters.json"),
        r"model\.files\.0\.path",
    ),
    "file that is code": (
        "soft-j2",
        lambda c: c["model"]["files"][0].update(path="soft-j2.model/model.py"),
        r"model\.files\.0\.path",
    ),
    "file of another name": (
        "soft-j2",
        lambda c: c["model"]["files"][0].update(path="soft-j2.model/other.json"),
        r"other\.json",
    ),
    "file missing": (
        "soft-j2",
        lambda c: c["model"]["files"][0].update(path="soft-j2.model/model.json"),
        r"model\.json",
    ),
    "other digest": (
        "soft-j2", lambda c: c["model"]["files"][0].update(sha256="0" * 64), r"parameters\.json",
    ),
    "no file": ("soft-j2", lambda c: c["model"].update(files=[]), "parameter file"),
    "file without its seed": (
        "soft-j2", lambda c: c["model"].update(baseline="mlstm"), "seed",
    ),
    "neither": ("persistence", lambda c: c.pop("model"), "predictions.*model"),
    "both": (
        "persistence",
        lambda c: c.update(predictions={"file": "a.nc", "sha256": "0" * 64, "bytes": 1}),
        "predictions.*model",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_claim_that_the_model_does_not_reproduce_is_refused(submission, plane, case) -> None:
    name, change, complaint = REFUSED[case]
    with pytest.raises(SubmissionError, match=complaint) as refusal:
        validate(changed(submission(name), change), plane)
    assert "\n" not in str(refusal.value)


def test_an_exchanged_model_is_refused_by_its_scores(submission, plane) -> None:
    file = submission("soft-j2")
    parameters = file.parent / "soft-j2.model" / "parameters.json"
    write_parameters(J2(), parameters)
    facts = {"sha256": file_digest(parameters), "bytes": parameters.stat().st_size}
    changed(file, lambda c: c["model"]["files"][0].update(facts))
    with pytest.raises(SubmissionError, match="score|curve"):
        validate(file, plane)


def test_a_parameter_file_that_names_no_model_runs_nothing(submission, plane, tmp_path) -> None:
    file = submission("soft-j2")
    parameters = file.parent / "soft-j2.model" / "parameters.json"
    parameters.write_text('{"model": "os:system", "parameters": {}}')
    facts = {"sha256": file_digest(parameters), "bytes": parameters.stat().st_size}
    changed(file, lambda c: c["model"]["files"][0].update(facts))
    with pytest.raises(SubmissionError, match=r"parameters\.json.*os:system") as no:
        validate(file, plane)
    assert "/tmp" not in str(no.value).replace(str(tmp_path), "")


def numbers(metric: str, unit: str = "1", axis: str = "rollout", protocol: str = "rollout", n=50):
    return Score(
        axis=axis, protocol=protocol, split="test", metric=metric, status="scored", value=1.0,
        unit=unit, n=n,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("score", "claimed", "again", "agree"),
    [
        (numbers("stress_mse_mean"), 0.1, 0.10009, True),  # rounding of another machine
        (numbers("stress_mse_mean"), 0.1, 0.1002, False),
        (numbers("stress_mse_mean"), 1e-10, 3e-10, True),  # both are the rounding to 15 bits
        (numbers("stress_mse_mean"), 0.0, 1e-7, False),
        (numbers("diverged_share"), 0.10, 0.12, True),  # one path of fifty
        (numbers("diverged_share"), 0.10, 0.13, False),
        (numbers("error_point_share"), 0.10, 0.1005, True),
        (numbers("error_point_share"), 0.10, 0.12, False),
        (numbers("divergence_step_median", unit="step"), 40.0, 41.0, True),
        (numbers("divergence_step_median", unit="step"), 40.0, 42.0, False),
        (numbers("violation_worst", axis="physics", protocol="rotation"), 1e-15, 5e-5, True),
        (numbers("violation_worst", axis="physics", protocol="rotation"), 1e-15, 5e-4, False),
        (numbers("update_seconds_100", "s", "cost", "cost"), 1e-6, 5e-6, True),
        (numbers("update_seconds_100", "s", "cost", "cost"), 1e-6, 5e-5, False),
        (numbers("parameters", axis="cost", protocol="cost"), 3.0, 4.0, False),
        (numbers("stress_mse_worst"), None, None, True),
        (numbers("stress_mse_worst"), 0.1, None, False),
    ],
)
def test_numbers_agree_as_far_as_machines_do(score, claimed, again, agree) -> None:
    assert RERUN.holds(score, claimed, again) is agree


def test_the_tolerance_of_physics_is_a_tenth_of_what_a_check_allows() -> None:
    for check in CHECKS.values():
        score = numbers("violation_worst", axis="physics", protocol=check.name)
        limit = check.tolerance or 0.1
        assert RERUN.holds(score, limit, 1.09 * limit)
        assert not RERUN.holds(score, limit, 1.2 * limit)


def test_only_data_and_the_projects_own_code_are_run_again(plane, records) -> None:
    require_data_only(find_cells("j2", plane))
    own = FoundModel("secant", dict.fromkeys(SEEDS, secant()))
    with pytest.raises(SubmissionError, match="secant"):
        require_data_only(own)

    class MyJ2(J2):
        """Could do anything."""

    derived = FoundModel("j2", dict.fromkeys(SEEDS, MyJ2()))
    with pytest.raises(SubmissionError, match="j2"):
        require_data_only(derived)
    different = FoundModel("j2", {seed: J2() for seed in SEEDS})
    with pytest.raises(SubmissionError, match="parameters"):
        require_data_only(different)


def test_the_board_copies_the_model_and_removes_files_of_an_older_row(
    submission, plane, tmp_path
) -> None:
    board = tmp_path / "board"
    target = accept(submission("soft-j2"), board, plane)
    target.with_suffix(".nc").write_bytes(b"predictions of an older row")
    accept(submission("soft-j2"), board, plane, replace=True)
    accept(submission("persistence"), board, plane)
    assert {str(file.relative_to(board)) for file in board.rglob("*") if file.is_file()} == {
        "gp-j2/soft.json",
        "gp-j2/soft.model/parameters.json",
        "gp-j2/persistence.json",
    }
    for row in accepted(board):
        assert row.submission.badge == "rerun"
        assert validate(row.file, plane).name == row.submission.name


def test_one_model_is_submitted_once(submission, plane, tmp_path) -> None:
    board = tmp_path / "board"
    accept(submission("soft-j2"), board, plane)
    with pytest.raises(SubmissionError, match="soft"):
        accept(submission("soft-j2"), board, plane)
    renamed = changed(submission("soft-j2"), lambda c: c.update(name="mine"))
    with pytest.raises(SubmissionError, match="soft"):
        accept(renamed, board, plane)


def test_the_page_shows_that_a_model_was_run_again(submission, plane, tmp_path) -> None:
    board = tmp_path / "board"
    for name in ("persistence", "soft-j2"):
        accept(submission(name), board, plane)
    build(accepted(board), tmp_path / "site")
    (page,) = (tmp_path / "site").glob("gp-j2-*.html")
    text = page.read_text()
    assert text.count('<span class="badge rerun">rerun</span>') >= 4
    (digest,) = read_submission(board / "gp-j2" / "soft.json").model.files
    assert digest.sha256 in text
    assert "<dt>Predictions</dt>" not in text


def test_a_page_shows_both_kinds_of_evidence(submission, plane, tmp_path) -> None:
    cell = find_cells("j2", plane).cell
    out = tmp_path / "told.json"
    predictions = predict(dict.fromkeys(SEEDS, cell), evaluated(plane), axis_names())
    compose(predictions, plane, about("told"), out)
    rows = [Row(read_submission(file), file) for file in (out, submission("persistence"))]
    build(rows, tmp_path / "site")
    (page,) = (tmp_path / "site").glob("gp-j2-*.html")
    assert "<dt>Predictions</dt>" in page.read_text()
    assert "<dt>Model</dt><dd>persistence" in page.read_text()


def test_under_new_metrics_a_model_is_run_again(submission, plane) -> None:
    file = submission("persistence")
    before = read_submission(file)
    older = before.model_copy(update={"metric_version": "0.9", "curves": ()})
    write_submission(older, file)
    again = rescored(older, file, plane)
    assert again.metric_version == before.metric_version
    assert again.curves == before.curves


def test_a_version_that_only_left_intervals_out_runs_nothing_again(submission, plane) -> None:
    """1.2 had intervals of two specimens; a rerun would miss the files."""
    few = plane.assign_coords(specimen=plane["specimen"].copy(data=two_specimens(plane)))
    written = read_submission(submission("persistence"))
    older = written.model_copy(update={"metric_version": "1.2"})
    nowhere = Path("nowhere.json")
    assert rescored(older, nowhere, plane) == written
    assert any(score.low is not None for score in written.scores)
    without = rescored(older, nowhere, few)
    assert all(score.low is None for score in without.scores)
    assert not any(curve.low for curve in without.curves)
    values = [[score.value for score in one.scores] for one in (without, written)]
    assert values[0] == values[1]


def two_specimens(records: xr.Dataset) -> np.ndarray:
    return np.array([f"s{path % 2}" for path in range(records.sizes["path"])], dtype=object)
