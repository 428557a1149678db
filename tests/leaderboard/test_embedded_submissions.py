"""Submissions with analyses: reproduced from predictions or model, refused where tampered with."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from embedded_tasks import Elastic, cell, embedding_records, task_of
from small_submissions import about, submitted

from granbench.benchmark.evaluation import predict
from granbench.benchmark.predictions import evaluated, open_predictions, write_predictions
from granbench.benchmark.scorecard import Score, Scorecard
from granbench.benchmark.scoring import score
from granbench.cells.find import find_cells
from granbench.data.normalisation import Normalisation
from granbench.errors import SubmissionError
from granbench.leaderboard.agreement import RERUN, RESCORED, compare
from granbench.leaderboard.board import Row
from granbench.leaderboard.build import build
from granbench.leaderboard.composition import compose
from granbench.leaderboard.submission import Submission, file_digest, read_submission
from granbench.leaderboard.validation import validate
from granbench.records import open_records, write_records


@pytest.fixture(scope="module")
def records(tmp_path_factory) -> xr.Dataset:
    file = write_records(embedding_records(), tmp_path_factory.mktemp("task") / "task.nc")
    with open_records(file) as written:
        return written.load()


@pytest.fixture(scope="module")
def _submission(tmp_path_factory, records) -> Path:
    out = tmp_path_factory.mktemp("submission") / "soft.json"
    return submitted(
        cell(Elastic(0.8)), records, out, task=task_of(records), axes=["embedded"], seeds=(0, 1)
    )


@pytest.fixture
def submission(_submission, tmp_path) -> Path:
    """A fresh copy with its predictions."""
    for suffix in (".json", ".nc"):
        source = _submission.with_suffix(suffix)
        (tmp_path / source.name).write_bytes(source.read_bytes())
    return tmp_path / _submission.name


def rewritten(file: Path, change: Callable[[xr.Dataset], xr.Dataset]) -> Path:
    """The submission with other predictions, whose digest is right."""
    predictions = file.with_suffix(".nc")
    write_predictions(change(open_predictions(predictions)), predictions)
    content = json.loads(file.read_text())
    content["predictions"].update(sha256=file_digest(predictions), bytes=predictions.stat().st_size)
    file.write_text(json.dumps(content))
    return file


def test_scores_are_reproduced_from_the_predictions(submission, records) -> None:
    checked = validate(submission, records, task=task_of(records))
    assert checked.badge == "rescored"
    keys = {curve.key for curve in checked.curves}
    assert ("embedded-implicit", "all", "smooth", "error_point_share") in keys


@pytest.mark.parametrize("metric", ["reaction_error", "reached_share", "analysis_speed_ratio"])
def test_a_tampered_score_is_refused(submission, records, metric) -> None:
    content = json.loads(submission.read_text())
    score = next(s for s in content["scores"] if s["metric"] == metric and s["group"] == "smooth")
    score["value"] = 0.5 * score["value"]
    submission.write_text(json.dumps(content))
    with pytest.raises(SubmissionError, match=f"{metric} cannot be reproduced"):
        validate(submission, records, task=task_of(records))


def test_a_tampered_curve_is_refused(submission, records) -> None:
    content = json.loads(submission.read_text())
    content["curves"][-1]["value"][0] = 0.25
    submission.write_text(json.dumps(content))
    with pytest.raises(SubmissionError, match="curve embedded-implicit / all / rough"):
        validate(submission, records, task=task_of(records))


def test_a_ground_truth_moved_towards_the_model_is_refused(submission, records) -> None:
    """With scores that follow from it, so that only the ground truth itself can tell."""

    def moved(predictions: xr.Dataset) -> xr.Dataset:
        nearer = 0.9 * predictions["embedded_truth_reaction"]
        return predictions.assign(embedded_truth_reaction=nearer)

    rewritten(submission, moved)
    predictions = open_predictions(submission.with_suffix(".nc"))
    given = read_submission(submission)
    compose(predictions, records, about(given.name), submission, task=task_of(records))
    with pytest.raises(SubmissionError, match="embedded_truth_reaction is not what"):
        validate(submission, records, task=task_of(records))


SPOILED: dict[str, tuple[Callable[[xr.Dataset], xr.Dataset], str]] = {
    "analyses exchanged": (
        lambda p: p.isel(analysis=[1, 0]), "analysis labels are not those of the embedded",
    ),
    "an output left out": (
        lambda p: p.isel(output=slice(0, -1)), "output labels are not those of the embedded",
    ),
    "components exchanged": (
        lambda p: p.assign_coords(component=["yy", "xx", "xy"]), "component",
    ),
    "solver unheard of": (
        lambda p: p.assign_coords(solver=["explicit", "guessed"]), "solver may be explicit",
    ),
    "an excuse": (
        lambda p: p.assign_attrs(embedded_not_applicable="my model is above that"),
        "embedded_not_applicable",
    ),
    "no stress": (lambda p: p.drop_vars("embedded_stress"), "lack 'embedded_stress'"),
    "another shape": (
        lambda p: p.assign(embedded_seconds=p["embedded_seconds"].isel(seed=0)), "dimensions",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", SPOILED)
def test_predictions_of_other_analyses_are_refused(submission, records, case) -> None:
    change, complaint = SPOILED[case]
    with pytest.raises(SubmissionError, match=complaint):
        validate(rewritten(submission, change), records, task=task_of(records))


def test_a_kept_model_is_analysed_again(tmp_path, records) -> None:
    candidate = find_cells("linear-elastic", records)
    predictions = predict(candidate.cells, evaluated(records), ["embedded"], task=task_of(records))
    out = tmp_path / "elastic.json"
    facts = about("elastic", parameters=candidate.parameters, role="floor")
    compose(predictions, records, facts, out, task=task_of(records), model=candidate)
    assert validate(out, records, task=task_of(records)).badge == "rerun"


def numbers(metric: str) -> Score:
    return Score(
        axis="embedded", protocol="embedded-explicit", split="all", metric=metric, status="scored",
        value=1.0, n=1,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("metric", "claimed", "again", "agree"),
    [
        ("reaction_error", 0.1, 0.1015, True),
        ("reaction_error", 0.1, 0.104, False),
        ("reaction_error", 0.0, 1e-3, False),  # only the truth is exact
        ("reached_share", 1.0, 89.0 / 90.0, True),
        ("reached_share", 1.0, 87.0 / 90.0, False),
        ("analysis_speed_ratio", 10.0, 2.0, True),
        ("analysis_speed_ratio", 100.0, 2.0, False),
    ],
)
def test_analyses_agree_as_far_as_machines_do(metric, claimed, again, agree) -> None:
    assert RERUN.holds(numbers(metric), claimed, again) is agree
    assert not RESCORED.holds(numbers(metric), claimed, again)


def evaluated_twice(
    stiffness: float, records: xr.Dataset, folder: Path
) -> tuple[Submission, Scorecard, Path]:
    """What is claimed of an elastic model of that stiffness, what is found again, and the file."""
    out = folder / "model.json"
    task = task_of(records)
    submitted(cell(Elastic(stiffness)), records, out, task=task, axes=["embedded"], seeds=(0,))
    card = score(
        open_predictions(out.with_suffix(".nc")), evaluated(records),
        Normalisation.from_training(records), task,
    )  # fmt: skip
    return read_submission(out), card, out


@pytest.mark.parametrize(
    ("stiffness", "factor", "agree"),
    [(0.9, 1.0, True), (0.9, 1.05, False), (0.5, 1.05, True), (0.5, 2.5, True), (0.5, 4.0, False)],
    ids=["same", "off", "lost", "lost and off", "lost and far off"],
)
def test_errors_of_a_lost_analysis_need_not_agree_closely(
    records, tmp_path, stiffness: float, factor: float, agree: bool
) -> None:
    """Where half of the reaction is missing rounding may decide what follows."""
    found, card, out = evaluated_twice(stiffness, records, tmp_path)

    def changed(item: Score) -> Score:
        if item.metric != "reaction_error" or item.value is None:
            return item
        by_seed = tuple(factor * value for value in item.by_seed)
        return item.model_copy(update={"value": factor * item.value, "by_seed": by_seed})

    claimed = found.model_copy(update={"scores": tuple(map(changed, found.scores))})
    for how, agrees in ((RERUN, agree), (RESCORED, factor == 1.0)):
        if agrees:
            compare(claimed, card, out, how)
            continue
        with pytest.raises(SubmissionError, match="reaction_error cannot be reproduced"):
            compare(claimed, card, out, how)


@pytest.mark.parametrize(
    ("stiffness", "metric", "claim"),
    [
        # A claim of being lost, of a model that is not, excuses nothing.
        (0.9, "reaction_error", {"by_seed": (0.5,)}),
        (0.5, "reaction_error", {"by_seed": (0.1,)}),
        (0.5, "reached_share", {"value": 7.0, "by_seed": (7.0,)}),
        (0.5, "reaction_error", {"n": 77}),
        (0.5, "reaction_error", {"unit": "banana"}),
        (0.5, "analysis_speed_ratio", {"value": 1e3, "by_seed": (1e3,)}),
    ],
)
def test_scores_of_a_lost_analysis_must_still_be_plausible(
    records, tmp_path, stiffness: float, metric: str, claim: dict
) -> None:
    found, card, out = evaluated_twice(stiffness, records, tmp_path)
    scores = tuple(
        item.model_copy(update=claim) if item.metric == metric and item.value else item
        for item in found.scores
    )
    with pytest.raises(SubmissionError, match=f"{metric} cannot be reproduced"):
        compare(found.model_copy(update={"scores": scores}), card, out, RERUN)


def test_the_board_shows_analyses_against_models(submission, records, tmp_path) -> None:
    other = submitted(
        cell(Elastic(0.9)), records, tmp_path / "stiffer.json", task=task_of(records),
        axes=["embedded"], seeds=(0,), name="stiffer",
    )  # fmt: skip
    rows = [Row(read_submission(file), file) for file in (submission, other)]
    page = build(rows, tmp_path / "site").parent / "gp-j2-0.0.0-smoke.html"
    text = page.read_text()
    assert "In place of the ground truth" in text
    for solver in ("explicit", "implicit"):
        assert f"Embedded, {solver}" in text
    assert "smooth" in text and "rough" in text
    assert text.index("stiffer") < text.index("test-cell")  # the better one stands above
    assert "Without an error point: " in text and ">error points</text>" not in text
    assert np.isfinite([score.value for score in rows[0].submission.scores
                        if score.metric == "reaction_error"]).all()  # fmt: skip


def test_the_board_draws_error_points_along_the_analyses(submission, records, tmp_path) -> None:
    far_off = submitted(
        cell(Elastic(4.0)), records, tmp_path / "far-off.json", task=task_of(records),
        axes=["embedded"], seeds=(0,), name="far-off",
    )  # fmt: skip
    rows = [Row(read_submission(file), file) for file in (submission, far_off)]
    text = (build(rows, tmp_path / "site").parent / "gp-j2-0.0.0-smoke.html").read_text()
    curves = [c for c in rows[1].submission.curves if c.metric == "error_point_share"]
    shown = [curve for curve in curves if any(curve.value)]
    assert shown
    assert text.count(">error points</text>") == len(shown)
    for curve in shown:
        ends = f"far-off: {curve.value[0]:.3g} at 1, {curve.value[-1]:.3g} at {curve.horizon[-1]}"
        assert f"<title>{ends}</title>" in text
        assert f"{curve.group}: error points" in text
