"""Write the generated parts of docs/scoring.md.

``python docs/scoring_page.py`` from the root of the checkout writes the tables of checks
and of the metrics of analyses from their definitions; a test checks it. With submissions of the
physics and cost axes as arguments (``python docs/scoring_page.py j2.json ...``) it also
writes the measured tables from them.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from page_parts import table, with_part

from granbench.benchmark.axes.along_paths.protocols import COST
from granbench.benchmark.axes.embedded.metrics import EMBEDDED_METRICS, SPEED, EmbeddedMetric
from granbench.benchmark.axes.physics.checks import CHECKS
from granbench.benchmark.scorecard import ALL
from granbench.leaderboard.submission import Submission, read_submission

PAGE = Path(__file__).parent / "scoring.md"


def checks_table() -> str:
    """What every check measures and allows."""
    return table(
        ("check", "violation of a path", "allowed", "reason of the tolerance"),
        [
            (f"`{check.name}`", check.definition, f"{check.tolerance:g}", check.reason)
            for check in CHECKS.values()
        ],
    )


def embedded_table() -> str:
    """What every metric of an analysis is."""
    return table(
        ("metric", "definition", "the ground truth has"),
        [
            (f"`{metric.name}`", metric.definition, _of_the_truth(metric))
            for metric in EMBEDDED_METRICS.values()
        ],
    )


def _of_the_truth(metric: EmbeddedMetric) -> str:
    if metric.name.endswith(SPEED):
        return "1, up to the clock"
    return "exactly 0" if metric.error else "1"


def physics_table(submissions: Sequence[Submission]) -> str:
    """Worst violation of every check over all scored splits, one column a model."""
    rows = []
    for check in CHECKS.values():
        cells = [f"`{check.name}`"]
        for submission in submissions:
            worst = [
                score.value
                for score in submission.scores
                if (score.protocol, score.metric) == (check.name, "violation_worst")
                and score.value is not None
            ]
            shown = f"{max(worst):.1e}" if worst and max(worst) else "0"
            beyond = worst and max(worst) > check.tolerance
            cells.append(f"**{shown}**" if beyond else shown if worst else "n/a")
        rows.append(cells)
    names = [f"`{submission.name}` on `{submission.task}`" for submission in submissions]
    return table(["check", *names], rows)


def cost_table(submissions: Sequence[Submission]) -> str:
    """Time of an update and its ratio to the ground truth, one row a model."""
    rows = []
    for submission in submissions:
        found = {s.metric: s.value for s in submission.scores if (s.axis, s.split) == (COST, ALL)}
        times = [found[f"update_seconds_{points}"] for points in (100, 10_000)]
        ratios = [found[f"update_ratio_{points}"] for points in (100, 10_000)]
        rows.append(
            [
                f"`{submission.name}` on `{submission.task}`",
                *("n/a" if time is None else f"{1e6 * time:.3g} µs" for time in times),
                *("n/a" if ratio is None else f"{ratio:.3g}" for ratio in ratios),
            ]
        )
    header = ["model", "update, 100 points", "update, 10,000 points", "over ground truth, 100",
              "over ground truth, 10,000"]  # fmt: skip
    return table(header, rows)


def page(submissions: Sequence[Submission] = ()) -> str:
    """docs/scoring.md as it should read; what was measured stays unless it is given anew."""
    text = with_part(PAGE.read_text(encoding="utf-8"), "checks", checks_table())
    text = with_part(text, "embedded", embedded_table())
    if submissions:
        text = with_part(text, "physics", physics_table(submissions))
        text = with_part(text, "cost", cost_table(submissions))
    return text


if __name__ == "__main__":
    given = [read_submission(Path(name)) for name in sys.argv[1:]]
    PAGE.write_text(page(given), encoding="utf-8")
