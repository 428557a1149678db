"""Laws that the board of this checkout has to obey, whoever filled it: who beats whom on gp-*."""

import pytest

from granbench.leaderboard.board import accepted, default_folder
from granbench.leaderboard.submission import Submission

MADE_BY = {
    "gp-j2": "j2-fitted",
    "gp-dp": None,
    "gp-j2-hardening": None,
    "gp-ime": "ime-fitted",
    "gp-csuh": "csuh-fitted",
}
"""The fitted model that has the form of the truth, where there is one."""

FRAME = ("oracle", "persistence", "linear-elastic", "j2-fitted", "ime-fitted")


@pytest.fixture(scope="module")
def board() -> dict[str, dict[str, Submission]]:
    by_task: dict[str, dict[str, Submission]] = {}
    for row in accepted(default_folder()):
        by_task.setdefault(row.submission.task, {})[row.submission.name] = row.submission
    return by_task


def rollout_error(submission: Submission, split: str = "test") -> float:
    place = ("rollout", split, "all", "stress_mse_mean")
    (score,) = [
        score
        for score in submission.scores
        if (score.protocol, score.split, score.group, score.metric) == place
    ]
    assert score.value is not None
    return score.value


@pytest.mark.parametrize("task", MADE_BY)
def test_ceiling_and_floors_frame_every_task(board, task: str) -> None:
    assert set(FRAME) <= set(board[task])
    errors = {name: rollout_error(row) for name, row in board[task].items()}
    assert errors["oracle"] == 0.0
    roles = {name: row.role for name, row in board[task].items() if name != "oracle"}
    assert {name for name, role in roles.items() if role == "floor"} >= set(FRAME) - {"oracle"}
    assert all(error > 0.0 for name, error in errors.items() if name != "oracle")


@pytest.mark.parametrize("task", MADE_BY)
def test_persistence_knows_least_of_a_random_path(board, task: str) -> None:
    errors = {name: rollout_error(row) for name, row in board[task].items()}
    others = [
        error for name, error in errors.items() if name not in ("persistence", "linear-elastic")
    ]
    assert errors["persistence"] > max(others)


@pytest.mark.parametrize("task", [task for task, name in MADE_BY.items() if name])
def test_the_form_of_the_truth_is_found_and_no_other_comes_near(board, task: str) -> None:
    errors = {name: rollout_error(row) for name, row in board[task].items()}
    truth = errors.pop(MADE_BY[task])
    # What is left is the rounding of the records, 2e-10, and of the fit.
    assert truth < 1e-8
    assert min(error for name, error in errors.items() if name != "oracle") > 1e4 * truth


@pytest.mark.parametrize("task", MADE_BY)
def test_scores_come_from_runs_on_record(board, task: str) -> None:
    for submission in board[task].values():
        assert submission.badge in ("rescored", "rerun")
        assert submission.command.startswith("granbench evaluate ")
