"""Write the table of scores into README.md, between its markers, from the accepted submissions.

``python docs/readme_scores.py`` from the root of the checkout; `make docs` does it. A test checks
that the table in README.md is the one that this makes.
"""

from collections.abc import Sequence
from pathlib import Path

from granbench.leaderboard.board import accepted, default_folder
from granbench.leaderboard.reference import replicate_scatters
from granbench.leaderboard.submission import Submission
from granbench.leaderboard.tables import main_table

README = Path(__file__).parents[1] / "README.md"
BEGIN, END = "<!-- scores:begin -->", "<!-- scores:end -->"
TASK, SPLIT, METRIC = "dem-triaxial", "test", "stress_mse_mean"


def scores_table(submissions: Sequence[Submission], floor: float | None) -> str:
    """Markdown table of one metric by protocol.

    Parameters
    ----------
    submissions : of one task
    floor : normalised MSE that scatter between packings alone gives
    """
    table = main_table(submissions, SPLIT, METRIC, floor)
    lines = [("model", *table.columns), ["---"] * (len(table.columns) + 1)]
    for row in table.rows:
        shown = (
            f"{cell.text} ({cell.interval})" if cell.interval else str(cell.text)
            for cell in row.cells
        )
        lines.append((row.name, *shown))
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def with_scores(page: str, table: str) -> str:
    """The page with the table between its markers."""
    before, rest = page.split(BEGIN)
    _, after = rest.split(END)
    return f"{before}{BEGIN}\n{table}\n{END}{after}"


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
    return with_scores(page, scores_table(submissions, scatter.floor_mse if scatter else None))


if __name__ == "__main__":
    README.write_text(readme(), encoding="utf-8")
