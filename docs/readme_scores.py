"""Write the table of scores into README.md, between its markers, from the accepted submissions.

``python docs/readme_scores.py`` from the root of the checkout; `make docs` does it. A test checks
that the table in README.md is the one that this makes.
"""

from collections.abc import Sequence
from pathlib import Path

from page_parts import table, with_part

from granbench.leaderboard.board import accepted, default_folder
from granbench.leaderboard.reference import replicate_scatters
from granbench.leaderboard.submission import Submission
from granbench.leaderboard.tables import main_table

README = Path(__file__).parents[1] / "README.md"
TASK, SPLIT, METRIC = "dem-triaxial", "test", "stress_mse_mean"


def scores_table(submissions: Sequence[Submission], floor: float | None) -> str:
    """Markdown table of one metric by protocol.

    Parameters
    ----------
    submissions : of one task
    floor : normalised MSE that scatter between packings alone gives
    """
    board = main_table(submissions, SPLIT, METRIC, floor)
    rows = []
    for row in board.rows:
        shown = (
            f"{cell.text} ({cell.interval})" if cell.interval else str(cell.text)
            for cell in row.cells
        )
        rows.append((row.name, *shown))
    return table(("model", *board.columns), rows)


def readme() -> str:
    """README.md as it should read: the scores on the newest version of the dataset."""
    page = README.read_text(encoding="utf-8")
    rows = [row.submission for row in accepted(default_folder()) if row.submission.task == TASK]
    if not rows:
        return page
    newest = max((row.dataset.version for row in rows), key=lambda v: tuple(map(int, v.split("."))))
    submissions = [row for row in rows if row.dataset.version == newest]
    scatters = replicate_scatters(row.dataset for row in submissions)
    scatter = scatters.get((TASK, newest))
    floor = scatter.floor_mse if scatter else None
    return with_part(page, "scores", scores_table(submissions, floor))


if __name__ == "__main__":
    README.write_text(readme(), encoding="utf-8")
