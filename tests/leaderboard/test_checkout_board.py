"""Laws that hold on the board of this checkout: which model beats which."""

import pytest

from granbench.benchmark.scorecard import Score
from granbench.fem.statement import SOLVERS
from granbench.leaderboard.board import accepted, default_folder
from granbench.leaderboard.submission import Submission

MADE_BY = {
    "gp-j2": "j2-fitted",
    "gp-dp": None,
    "gp-j2-hardening": None,
    "gp-ime": "ime-fitted",
    "gp-csuh": "csuh-fitted",
}
"""The fitted model of the same law as the truth, where there is one."""

ANALYSED = {"fem-ime": "ime-fitted", "fem-csuh": "csuh-fitted"}
"""The same for the tasks that have analyses."""

FRAME = ("oracle", "persistence", "linear-elastic", "j2-fitted", "ime-fitted")


@pytest.fixture(scope="module")
def board() -> dict[str, dict[str, Submission]]:
    by_task: dict[str, dict[str, Submission]] = {}
    for row in accepted(default_folder()):
        by_task.setdefault(row.submission.task, {})[row.submission.name] = row.submission
    return by_task


def score_at(submission: Submission, *place: str) -> Score:
    """The score of a protocol, split, group and metric."""
    (score,) = [
        score
        for score in submission.scores
        if (score.protocol, score.split, score.group, score.metric) == place
    ]
    return score


def rollout_error(submission: Submission, split: str = "test") -> float:
    value = score_at(submission, "rollout", split, "all", "stress_mse_mean").value
    assert value is not None
    return value


def reaction_error(submission: Submission, solver: str) -> float:
    value = score_at(submission, f"embedded-{solver}", "all", "all", "reaction_error").value
    assert value is not None
    return value


@pytest.mark.parametrize("task", [*MADE_BY, *ANALYSED])
def test_every_task_has_its_ceiling_and_floors(board, task: str) -> None:
    assert set(FRAME) <= set(board[task])
    errors = {name: rollout_error(row) for name, row in board[task].items()}
    assert errors["oracle"] == 0.0
    roles = {name: row.role for name, row in board[task].items() if name != "oracle"}
    assert {name for name, role in roles.items() if role == "floor"} >= set(FRAME) - {"oracle"}
    assert all(error > 0.0 for name, error in errors.items() if name != "oracle")


@pytest.mark.parametrize("task", MADE_BY)
def test_persistence_is_worst_on_random_paths(board, task: str) -> None:
    errors = {name: rollout_error(row) for name, row in board[task].items()}
    others = [
        error for name, error in errors.items() if name not in ("persistence", "linear-elastic")
    ]
    assert errors["persistence"] > max(others)


@pytest.mark.parametrize("task", [task for task, name in MADE_BY.items() if name])
def test_the_law_of_the_truth_is_fitted_exactly_and_no_other_is_close(board, task: str) -> None:
    errors = {name: rollout_error(row) for name, row in board[task].items()}
    truth = errors.pop(MADE_BY[task])
    # The rest is the rounding of the records, 2e-10, and of the fit.
    assert truth < 1e-8
    assert min(error for name, error in errors.items() if name != "oracle") > 1e4 * truth


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("task", ANALYSED)
def test_the_law_of_the_truth_is_best_in_analyses(board, task: str, solver: str) -> None:
    errors = {
        name: reaction_error(row, solver) for name, row in board[task].items() if name != "oracle"
    }
    truth = errors.pop(ANALYSED[task])
    assert truth < 2e-3 and min(errors.values()) > 50.0 * truth


@pytest.mark.parametrize("task", ANALYSED)
def test_analyses_do_not_apply_to_the_oracle(board, task: str) -> None:
    place = (f"embedded-{SOLVERS[0]}", "all", "all", "reaction_error")
    score = score_at(board[task]["oracle"], *place)
    assert score.status == "not_applicable" and "reads its answers" in (score.reason or "")


@pytest.mark.parametrize("task", [*MADE_BY, *ANALYSED])
def test_scores_come_from_runs_on_record(board, task: str) -> None:
    for submission in board[task].values():
        assert submission.badge in ("rescored", "rerun")
        assert submission.command.startswith("granbench evaluate ")
