import json
import math
from collections.abc import Callable
from pathlib import Path

import jsonschema
import pytest
import xarray as xr
from lawless_cells import Elastic, cell
from plane_records import plane_records
from small_submissions import submitted

from granbench.benchmark.registry import axis_names
from granbench.errors import SubmissionError
from granbench.leaderboard.rescoring import rescored
from granbench.leaderboard.submission import (
    SCHEMA_FILE,
    file_digest,
    read_submission,
    schema_text,
    write_submission,
)
from granbench.leaderboard.validation import validate
from granbench.records import open_records, write_records

Change = Callable[[dict], object]


def changed(file: Path, change: Change) -> Path:
    content = json.loads(file.read_text())
    change(content)
    file.write_text(json.dumps(content))
    return file


def first_scored(content: dict) -> dict:
    return next(score for score in content["scores"] if score["status"] == "scored")


def test_a_submission_is_reproduced_from_its_predictions(submission_file, sealed):
    for name in ("secant", "persistence", "oracle"):
        checked = validate(submission_file(name), sealed)
        assert (checked.name, checked.badge) == (name, "rescored")


def test_a_model_whose_errors_are_all_zero_is_the_ceiling(submission_file, sealed):
    assert read_submission(submission_file("oracle")).role == "ceiling"
    assert read_submission(submission_file("secant")).role == "model"
    claimed = changed(submission_file("oracle"), lambda c: c.update(role="model"))
    with pytest.raises(SubmissionError, match="role"):
        validate(claimed, sealed)
    claimed = changed(submission_file("secant"), lambda c: c.update(role="ceiling"))
    with pytest.raises(SubmissionError, match="role"):
        validate(claimed, sealed)


def test_reading_and_writing_change_nothing(submission_file, tmp_path):
    submission = read_submission(submission_file())
    write_submission(submission, tmp_path / "again.json")
    assert read_submission(tmp_path / "again.json") == submission
    assert (tmp_path / "again.json").read_text() == submission_file().read_text()


def test_the_published_schema_is_that_of_the_code(submission_file):
    assert SCHEMA_FILE.read_text() == schema_text(), "run `granbench submission schema`"
    schema = json.loads(SCHEMA_FILE.read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    content = json.loads(submission_file().read_text())
    jsonschema.validate(content, schema)
    content["surprise"] = 1
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(content, schema)


def test_submissions_name_no_machine_and_no_path(submission_file):
    import getpass
    import platform

    text = submission_file().read_text()
    assert platform.node() not in text
    assert str(Path.cwd()) not in text
    assert f"/{getpass.getuser()}/" not in text


REFUSED: dict[str, tuple[Change, str]] = {
    "better value": (
        lambda c: first_scored(c).update(value=first_scored(c)["value"] * 0.99),
        "stress_mse_mean",
    ),
    "narrower interval": (
        lambda c: first_scored(c).update(low=first_scored(c)["value"]),
        "low",
    ),
    "one seed better": (
        lambda c: first_scored(c).update(by_seed=[0.0, 0.0, 0.0]),
        "seed",
    ),
    "fewer paths": (lambda c: first_scored(c).update(n=1), " n "),
    "hidden failure": (
        lambda c: first_scored(c).update(status="not_applicable", reason="x", value=None),
        "status",
    ),
    "score left out": (lambda c: c["scores"].pop(), "score"),
    "score twice": (lambda c: c["scores"].append(c["scores"][0]), "score"),
    "score invented": (
        lambda c: c["scores"].append({**c["scores"][0], "metric": "beauty"}),
        "beauty",
    ),
    "curve bent": (
        lambda c: c["curves"][0]["value"].__setitem__(3, 1e-9),
        "curve",
    ),
    "curve left out": (lambda c: c["curves"].pop(), "curve"),
    "other scales": (
        lambda c: c["normalisation"]["stress"].update({"11": 1e9}),
        "normalisation",
    ),
    "other content": (
        lambda c: c["dataset"].update(content_sha256="0" * 64),
        "dataset.content_sha256",
    ),
    "other split": (lambda c: c["dataset"].update(split_sha256="0" * 64), "dataset.split_sha256"),
    "other version": (lambda c: c["dataset"].update(version="1.0.1"), "dataset.version"),
    "other task": (lambda c: c.update(task="easier"), "task.*easier"),
    "other metrics": (lambda c: c.update(metric_version="0.9"), "metric version 0.9"),
    "wrong digest": (
        lambda c: c["predictions"].update(sha256="0" * 64),
        "predictions.sha256",
    ),
    "predictions elsewhere": (
        lambda c: c["predictions"].update(file="../secant.nc"),
        "predictions.file",
    ),
    "predictions missing": (
        lambda c: c["predictions"].update(file="other.nc"),
        r"other\.nc",
    ),
    "seed added": (lambda c: c["seeds"].append(7), "seeds are"),
    "seed twice": (lambda c: c["seeds"].append(0), "seed 0"),
    "NaN": (lambda c: first_scored(c).update(value=math.nan), "NaN"),
    "infinity": (lambda c: first_scored(c).update(high=math.inf), "Infinity"),
    "unknown field": (lambda c: c.update(score=1.0), "field score"),
    "list as dataset": (lambda c: c.update(dataset=[]), "dataset"),
    "list as scales": (
        lambda c: c["normalisation"].update(stress=[]),
        r"normalisation\.stress",
    ),
    "no authors": (lambda c: c.update(authors=[]), "field authors"),
    "script as code": (lambda c: c.update(code="javascript:alert(1)"), "field code"),
    "value as text": (lambda c: first_scored(c).update(value="good"), r"field scores\.\d+"),
    "no reason": (lambda c: first_scored(c).update(status="not_run", value=None), "reason"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_claim_that_is_wrong_is_refused(submission_file, sealed, case):
    change, complaint = REFUSED[case]
    with pytest.raises(SubmissionError, match=complaint) as refusal:
        validate(changed(submission_file(), change), sealed)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", "not JSON"),
        (b"<html>", "not JSON"),
        (b"[]", r"s\.json.*JSON object"),
        (b"[1, 2]", "JSON object"),
        (b"null", "JSON object"),
        (b'{"name": "a", "name": "b"}', "'name'"),
        (b"\xff\xfe", "UTF-8"),
        (b"[" * 100_000, r"s\.json"),
    ],
)
def test_a_file_that_is_not_a_submission_is_refused(tmp_path, content, complaint):
    (tmp_path / "s.json").write_bytes(content)
    with pytest.raises(SubmissionError, match=complaint):
        read_submission(tmp_path / "s.json")
    with pytest.raises(SubmissionError, match=str(tmp_path)):
        read_submission(tmp_path)


def tampered(file: Path, change: Callable[[xr.Dataset], xr.Dataset]) -> Path:
    """Changed predictions with the right digest, so that only their content shows the change."""
    predictions = file.with_suffix(".nc")
    with xr.open_dataset(predictions) as handle:
        content = change(handle.load())
    content.to_netcdf(predictions)
    return changed(file, lambda c: c["predictions"].update(digest_of(predictions)))


def digest_of(predictions: Path) -> dict[str, str | int]:
    return {"sha256": file_digest(predictions), "bytes": predictions.stat().st_size}


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda p: p.isel(path=slice(1, None)), "path|lack"),
        (lambda p: p.isel(seed=slice(0, 2)), "seeds are"),
        (lambda p: p.drop_vars("void_ratio"), "score|void_ratio"),
        (lambda p: p.drop_vars("stress"), "'stress'"),
        (lambda p: p.drop_vars("specimen"), "'specimen'"),
        (lambda p: p.transpose("path", ...), "dimensions"),
        (lambda p: p.assign(stress=p["stress"] * 0.999), "stress_mse_mean"),
        (lambda p: p.assign_coords(first_predicted_step=p["first_predicted_step"] + 9),
         "step 10"),
        (lambda p: p.isel(path=[0, *range(p.sizes["path"])]), "path_id"),
        (lambda p: p.assign_attrs(dataset_content_sha256="0"), "content hash 0"),
    ],
)  # fmt: skip
def test_tampered_predictions_are_refused(submission_file, sealed, change, complaint):
    with pytest.raises(SubmissionError, match=complaint):
        validate(tampered(submission_file(), change), sealed)


def test_predictions_that_are_not_netcdf_are_refused(submission_file, sealed):
    file = submission_file()
    file.with_suffix(".nc").write_bytes(b"<html>not found</html>")
    digest = digest_of(file.with_suffix(".nc"))
    changed(file, lambda c: c["predictions"].update(digest))
    with pytest.raises(SubmissionError, match=r"secant\.nc"):
        validate(file, sealed)


def test_an_unregistered_task_is_refused(submission_file):
    with pytest.raises(SubmissionError, match="task: .*'synthetic'"):
        validate(submission_file())


@pytest.fixture
def plane_submission(tmp_path) -> tuple[Path, xr.Dataset]:
    """Linear elasticity on a task that a model made, and its records."""
    sealed = open_records(write_records(plane_records(), tmp_path / "gp.nc")).load()
    return submitted(cell(Elastic()), sealed, tmp_path / "elastic.json", seeds=(0, 1)), sealed


def test_a_task_with_a_ground_truth_is_reproduced_on_every_axis(plane_submission):
    file, sealed = plane_submission
    checked = validate(file, sealed)
    scored = {score.axis for score in checked.scores if score.status == "scored"}
    unscored = {"embedded"}  # the records alone have no boundary-value problem
    assert scored == set(axis_names()) - unscored


def test_a_forged_ground_truth_is_refused(plane_submission):
    """Scores that fit the predictions exactly, of predictions that hold another truth."""
    file, sealed = plane_submission
    predictions = file.with_suffix(".nc")
    with xr.open_dataset(predictions) as handle:
        content = handle.load()
    content["noised_truth"][:] = content["stress"].sel(protocol=content["noise"].values).values
    content.to_netcdf(predictions)
    honest = read_submission(file)
    reference = honest.predictions.model_copy(update=digest_of(predictions))
    forged = rescored(honest.model_copy(update={"predictions": reference}), file, sealed)
    write_submission(forged, file)
    best = next(score for score in forged.scores if score.metric == "recomputed_mse_worst")
    assert best.value == 0.0
    with pytest.raises(SubmissionError, match=r"noise-0\.2, seed 0"):
        validate(file, sealed)
