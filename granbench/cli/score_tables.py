"""Scores of a submission as tables for a terminal; 80 columns suffice."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.table import Table
from rich.text import Text

from granbench.benchmark.axes.physics.checks import CHECKS
from granbench.benchmark.protocols import COST, EMBEDDED, PHYSICS, PROTOCOLS

if TYPE_CHECKING:
    from granbench.benchmark.scorecard import Score
    from granbench.leaderboard.submission import Submission

SHOWN = (
    "stress_mse_mean",
    "stress_mse_worst",
    "void_ratio_mse_mean",
    "relative_error_mean",
    "error_point_share",
    "failed_share",
)
HEADINGS = ("worst\npath", "void\nMSE", "relative\nerror", "error\npoints")
RECOMPUTED = {
    "stress_mse_mean": "recomputed_mse_mean",
    "stress_mse_worst": "recomputed_mse_worst",
    "relative_error_mean": "recomputed_relative_error_mean",
    "error_point_share": "recomputed_error_point_share",
    "failed_share": "failed_share",
}
"""Metrics against the truth along the noised strain, and under which heading they are shown."""

TIED = "≈"

Found = dict[tuple[str, str], "Score"]


def tables(submission: "Submission", others: Sequence["Submission"]) -> Iterator[Table | Text]:
    """The scores of each split, beside them what the others scored, and what the model costs."""
    run = [score for score in submission.scores if score.status != "not_run"]
    for split in dict.fromkeys(score.split for score in run if score.axis not in (EMBEDDED, COST)):
        found: Found = {
            (score.protocol, score.metric): score
            for score in run
            if score.split == split and score.group == "all"
        }
        where = f"{submission.name} on {submission.task}, split {split}"
        protocols = [name for name in PROTOCOLS if (name, "stress_mse_mean") in found]
        if protocols:
            yield _errors(found, protocols, where, _seeds(submission))
            yield from _beside(submission, others, found, protocols, split)
        if any(score.axis == PHYSICS for score in found.values()):
            yield _physics(found, where)
    yield from _reasons(run)
    yield from _analyses(run, submission.name)
    costs = [score for score in run if score.axis == COST]
    if costs:
        yield _costs(costs, submission.name)


def _seeds(submission: "Submission") -> str:
    labels = ", ".join(map(str, submission.seeds))
    return f"one model, noise seeds {labels}" if submission.deterministic else f"seeds {labels}"


def _errors(found: Found, protocols: list[str], where: str, seeds: str) -> Table:
    paths = found[protocols[0], "stress_mse_mean"].n
    table = _plain_table(f"{where}: {paths} paths, {seeds}")
    rows: dict[str, list[Score | None]] = {}
    for name in protocols:
        rows[name] = [found[name, metric] for metric in SHOWN]
        recomputed = found.get((name, "recomputed_mse_mean"))
        if recomputed is not None and recomputed.value is not None:
            rows[f"{name}*"] = [found.get((name, RECOMPUTED.get(metric, ""))) for metric in SHOWN]
    broken = any(scores[-1] and scores[-1].value for scores in rows.values())
    table.add_column("protocol", no_wrap=True)
    for heading in ("stress\nMSE", "95 %\ninterval", *HEADINGS, *(["failed"] if broken else [])):
        table.add_column(heading, justify="right", no_wrap=True)
    for name, (main, worst, void_ratio, *shares, failed) in rows.items():
        table.add_row(
            name, _shown(main), _interval(main), _shown(worst), _shown(void_ratio),
            *(_shown(share, percent=True) for share in [*shares, *([failed] if broken else [])]),
        )  # fmt: skip
    if any(name.endswith("*") for name in rows):
        table.caption = "* against the ground truth, recomputed along the noised strain\n"
        table.caption_justify = "left"
    return table


def _beside(
    submission: "Submission",
    others: Sequence["Submission"],
    found: Found,
    protocols: list[str],
    split: str,
) -> Iterator[Table]:
    if not others:
        return
    from granbench.leaderboard.ranking import standing

    table = _plain_table(f"Stress MSE of others, split {split}")
    table.add_column("protocol")
    for one in (submission, *others):
        note = standing(one)
        table.add_column(f"{one.name}\n({note})" if note else one.name, justify="right")
    tied = False
    for name in protocols:
        main = found[name, "stress_mse_mean"]
        cells = [_of_other(other, main) for other in others]
        tied = tied or any(cell.startswith(TIED) for cell in cells)
        table.add_row(name, _shown(main), *cells)
    if tied:
        table.caption = f"{TIED} tied with {submission.name}: the 95 % intervals overlap\n"
        table.caption_justify = "left"
    yield table


def _physics(found: Found, where: str) -> Table:
    """One row a check: its violation, mean and worst path, what is allowed, and the verdict."""
    paths = found[next(iter(CHECKS)), "violation_worst"].n
    table = _plain_table(f"Physics of {where}: {paths} paths")
    for heading in ("check", "mean\nviolation", "worst\npath", "allowed", "paths\nbeyond", ""):
        table.add_column(heading, justify="left" if heading in ("check", "") else "right")
    for check in CHECKS.values():
        mean, worst, beyond = (
            found[check.name, metric]
            for metric in ("violation_mean", "violation_worst", "violated_share")
        )
        if worst.value is None:
            table.add_row(check.title, "n/a", "n/a", "–", "n/a", "does not apply")
            continue
        verdict = "passes" if not beyond.value else "VIOLATED"
        table.add_row(
            check.title, _shown(mean), _shown(worst), f"{check.tolerance:g}",
            _shown(beyond, percent=True), verdict,
        )  # fmt: skip
    kinks = found["tangent", "kink_share"].value
    if kinks:
        table.caption = f"{100.0 * kinks:.3g} % of the tangents are at kinks and left out\n"
        table.caption_justify = "left"
    return table


def _reasons(scores: Sequence["Score"]) -> Iterator[Text]:
    """Why checks do not apply, each once."""
    reasons = {
        CHECKS[score.protocol].title: score.reason
        for score in scores
        if score.axis == PHYSICS and score.status == "not_applicable"
    }
    for reason in dict.fromkeys(reasons.values()):
        titles = [title for title, text in reasons.items() if text == reason]
        named = "No check applies" if len(titles) == len(CHECKS) else f"{', '.join(titles)}: n/a"
        yield Text(f"{named}, {reason}.")


def _analyses(run: Sequence["Score"], name: str) -> Iterator[Table | Text]:
    """Of each solver a table of analyses, or why there is none."""
    from granbench.benchmark.axes.embedded.metrics import EMBEDDED_METRICS, TITLES

    if reason := next((score.reason for score in run if score.protocol == EMBEDDED), None):
        yield Text(f"Embedded: n/a, {reason}.")
    for solver, title in TITLES.items():
        scores = [score for score in run if score.protocol == f"{EMBEDDED}-{solver}"]
        if not any(score.value is not None for score in scores):
            reasons = dict.fromkeys(score.reason for score in scores)
            yield from (Text(f"{title}: n/a, {reason}.") for reason in reasons)
            continue
        table = _plain_table(f"{name} in place of the ground truth, {solver}")
        table.add_column("", no_wrap=True)
        groups = list(dict.fromkeys(score.group for score in scores))
        for group in groups:
            table.add_column(
                "mean" if group == "all" else group.replace("-", "\n"), justify="right"
            )
        found = {(score.metric, score.group): score for score in scores}
        for metric in EMBEDDED_METRICS.values():
            if (metric.name, "all") in found:
                cells = (_shown(found[metric.name, group], metric.percent) for group in groups)
                table.add_row(metric.title, *cells)
        yield table


def _costs(costs: Sequence["Score"], name: str) -> Table:
    from granbench.benchmark.axes.cost.scores import COST_METRICS

    table = _plain_table(f"Cost of {name}")
    table.add_column("", no_wrap=True)
    table.add_column("mean of\nseeds", justify="right", no_wrap=True)
    table.add_column("", overflow="fold")
    titles = {metric.name: metric.title for metric in COST_METRICS}
    for score in costs:
        table.add_row(titles[score.metric], _cost(score), score.reason or "")
    return table


def _cost(score: "Score") -> str:
    if score.value is None:
        return "n/a"
    if score.metric == "parameters":
        return f"{score.value:,.0f}"
    if score.unit != "s":
        return f"{score.value:.3g}"
    if score.value < 1e-3:
        return f"{1e6 * score.value:.3g} µs"
    return f"{score.value:,.0f} s" if score.value >= 100.0 else f"{score.value:.3g} s"


def _plain_table(title: str) -> Table:
    return Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))


def _shown(score: "Score | None", percent: bool = False) -> str:
    if score is None:
        return "–"
    if score.value is None:
        return "n/a"
    if not percent:
        return f"{score.value:.3g}"
    value = 100.0 * score.value
    return f"{value:.0f} %" if value >= 100.0 else f"{value:.3g} %"


def _interval(score: "Score | None") -> str:
    if score is None or score.low is None or score.high is None:
        return "–"
    return f"{score.low:.2g}–{score.high:.2g}"


def _of_other(other: "Submission", score: "Score") -> str:
    from granbench.leaderboard.ranking import overlapping

    same = [item for item in other.scores if item.key == score.key]
    if not same:
        return "–"
    known = same[0].value is not None and score.value is not None
    return f"{TIED} {_shown(same[0])}" if known and overlapping(same[0], score) else _shown(same[0])
