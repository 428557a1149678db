"""Write the tables of scores into docs/scores.md from the accepted submissions.

Run ``python docs/scores_page.py`` from the root of the checkout; `make docs` does this. A test
checks that the tables in docs/scores.md are up to date.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from page_parts import table, with_part

from granbench.benchmark.axis import Highlight
from granbench.benchmark.registry import axes, headline_axis
from granbench.benchmark.score_text import number, share
from granbench.benchmark.scorecard import ALL, Score
from granbench.leaderboard.board import accepted, default_folder
from granbench.leaderboard.reference import replicate_scatters
from granbench.leaderboard.submission import Submission
from granbench.leaderboard.tables import headline_table

PAGE = Path(__file__).with_name("scores.md")
TASK, SPLIT = "dem-triaxial", "test"
LEAST = 1e-300
"""Replaces zero in a mean of logarithms."""
HEADLINE = headline_axis().headline or Highlight("", "", "", "")
COLUMNS = (HEADLINE, *(place for axis in axes() for place in axis.highlights))
"""Columns of the table of tasks with analyses."""
RANDOM_PATH_TASKS = ("gp-j2", "gp-dp", "gp-j2-hardening", "gp-ime", "gp-csuh")
ANALYSED_TASKS = ("fem-ime", "fem-csuh")


def scores_table(submissions: Sequence[Submission], floor: float | None) -> str:
    """Markdown table of one metric by protocol.

    Parameters
    ----------
    submissions : submissions to one task
    floor : normalised mean squared error due to the scatter between packings alone
    """
    board = headline_table(submissions, SPLIT, floor)
    assert board is not None  # every accepted submission has the score
    rows = []
    for row in board.rows:
        shown = (
            f"{cell.text} ({cell.interval})" if cell.interval else str(cell.text)
            for cell in row.cells
        )
        rows.append((row.name, *shown))
    return table(("model", *board.columns), rows)


def rollout_table(by_task: Mapping[str, Sequence[Submission]]) -> str:
    """Markdown table of rollout errors by model and task, in the order of the mean error.

    Parameters
    ----------
    by_task : submissions to each task; a model without a submission to a task gets a dash
    """
    known: dict[str, dict[str, Score]] = {}
    for task, submissions in by_task.items():
        for submission in submissions:
            if score := _score(submission, HEADLINE):
                known.setdefault(submission.name, {})[task] = score

    def rank(name: str) -> tuple[int, float, str]:
        """Models with scores on more tasks first, then by the geometric mean of their errors."""
        values = [score.value for score in known[name].values() if score.value is not None]
        mean = sum(math.log(max(value, LEAST)) for value in values) / max(len(values), 1)
        return -len(values), mean, name

    rows = [
        (name, *(_shown(known[name].get(task)) for task in by_task))
        for name in sorted(known, key=rank)
    ]
    return table(("model", *by_task), rows)


def analyses_table(by_task: Mapping[str, Sequence[Submission]]) -> str:
    """Markdown table of path and analysis errors, in the order of tasks and errors.

    Parameters
    ----------
    by_task : submissions to each task with analyses
    """
    header = ("task", "model", *(place.title for place in COLUMNS))
    rows = []
    for task, submissions in by_task.items():
        found = [
            (submission.name, [_score(submission, place) for place in COLUMNS])
            for submission in submissions
        ]
        for name, (rollout, *others) in sorted(found, key=lambda item: _error(item[1][1])):
            cells = [share(s.value) if s and s.value is not None else "–" for s in others]
            rows.append((task, name, _shown(rollout), *map(str, cells)))
    return table(header, rows)


def _score(submission: Submission, place: Highlight) -> Score | None:
    wanted = (place.protocol, place.split, ALL, place.metric)
    for score in submission.scores:
        if (score.protocol, score.split, score.group, score.metric) == wanted:
            return score
    return None


def _error(score: Score | None) -> float:
    return math.inf if score is None or score.value is None else score.value


def _shown(score: Score | None) -> str:
    if score is None or score.value is None:
        return "–"
    return str(number(score.value))


def scores_page() -> str:
    """Text of docs/scores.md with the scores on the newest version of each dataset."""
    page = PAGE.read_text(encoding="utf-8")
    if rows := newest(TASK):
        scatters = replicate_scatters(row.dataset for row in rows)
        scatter = scatters.get((TASK, rows[0].dataset.version))
        floor = scatter.floor_mse if scatter else None
        page = with_part(page, "scores", scores_table(rows, floor))
    by_task = {task: newest(task) for task in RANDOM_PATH_TASKS}
    page = with_part(page, "random-path-scores", rollout_table(by_task))
    analysed = {task: newest(task) for task in ANALYSED_TASKS}
    return with_part(page, "analyses-scores", analyses_table(analysed))


def newest(task: str) -> list[Submission]:
    """Accepted submissions on the newest version of a task's dataset."""
    found = [row.submission for row in accepted(default_folder()) if row.submission.task == task]
    versions = {row.dataset.version for row in found}
    last = max(versions, key=lambda v: tuple(map(int, v.split("."))), default="")
    return [row for row in found if row.dataset.version == last]


if __name__ == "__main__":
    PAGE.write_text(scores_page(), encoding="utf-8")
