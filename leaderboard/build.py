"""The static site: one page a task, an index, `leaderboard.json`; it needs no network."""

import json
import os
import shutil
import uuid
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from granbench import __version__
from granbench.benchmark.axes.embedded.metrics import EMBEDDED_METRICS
from granbench.benchmark.axes.physics.checks import CHECKS
from granbench.benchmark.metrics import METRIC_VERSION
from granbench.benchmark.protocols import EMBEDDED, PROTOCOLS
from granbench.benchmark.scorecard import ALL
from granbench.benchmark.task_summary import shortages_of_scores
from granbench.data.replicates import ReplicateScatter
from granbench.errors import ConfigurationError, SubmissionError
from granbench.files.whole_file import cannot_write
from granbench.leaderboard.agreement import lost_analyses
from granbench.leaderboard.analyses import analyses_charts, analyses_tables
from granbench.leaderboard.chart import horizon_chart
from granbench.leaderboard.laws_and_cost import cost_table, physics_table
from granbench.leaderboard.ranking import PathErrorsByName, answers_once, standing
from granbench.leaderboard.rows import Row, slug
from granbench.leaderboard.sealing import require_seal
from granbench.leaderboard.showable import require_showable
from granbench.leaderboard.submission import Submission
from granbench.leaderboard.tables import (
    FAMILY_METRICS,
    family_table,
    lines_of,
    main_table,
    metrics_shown,
)

STATIC_FILES = ("board.css", "board.js")
BOARD_FILE = "leaderboard.json"


def build(
    rows: Sequence[Row],
    out: Path,
    scatter: Mapping[tuple[str, str], ReplicateScatter] | None = None,
    errors: Mapping[tuple[str, str], PathErrorsByName] | None = None,
) -> Path:
    """Render the board into a folder, whole or not at all.

    Parameters
    ----------
    rows : the submissions to show
    out : folder of the site; an older site there is replaced
    scatter : scatter between packings by dataset name and version, shown as a reference
    errors : of single paths by `Submission.board`, for ranks; without them the intervals of
        the rows decide who shares one

    Returns
    -------
    The index page

    Raises
    ------
    ConfigurationError
        If `out` holds something that is not a board, or cannot be written to.
    SubmissionError
        If a submission follows another metric version, a name appears twice in a task, a row was
        changed after the board had accepted it, or a claimed one cannot be shown.
    """
    _check_target(out)
    boards = _by_board(rows)
    for row in rows:
        if row.submission.badge == "claimed":
            require_showable(row.submission, row.file)
        else:
            require_seal(row.submission, row.file)
    scatter, errors = scatter or {}, errors or {}
    partial = out.with_name(f".{out.name}.{uuid.uuid4().hex[:8]}.part")
    try:
        partial.mkdir(parents=True)
        _render(boards, partial, scatter, errors)
        _swap(partial, out)
    except OSError as error:
        raise ConfigurationError(f"the site: {cannot_write(out, error)}") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return out / "index.html"


def _check_target(out: Path) -> None:
    if out.exists() and not out.is_dir():
        raise ConfigurationError(f"--out {out} is a file; give a folder")
    if out.is_dir() and any(out.iterdir()) and not (out / BOARD_FILE).is_file():
        raise ConfigurationError(
            f"--out {out} holds files that are not a leaderboard; give an empty or new folder"
        )


def _swap(partial: Path, out: Path) -> None:
    old = out.with_name(f"{partial.name}.old")
    if out.exists():
        os.replace(out, old)
    try:
        os.replace(partial, out)
    except OSError:
        if old.exists():
            os.replace(old, out)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _by_board(rows: Iterable[Row]) -> dict[tuple[str, str], list[Row]]:
    boards: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        submission = row.submission
        if submission.metric_version != METRIC_VERSION:
            raise SubmissionError(
                f"{row.file}: follows metric version {submission.metric_version}, this board "
                f"{METRIC_VERSION}; evaluate the model again"
            )
        board = boards.setdefault(submission.board, [])
        if any(slug(other.submission.name) == slug(submission.name) for other in board):
            raise SubmissionError(
                f"{row.file}: {submission.name!r} is on the board of {submission.task} already; "
                "choose another name"
            )
        board.append(row)
    return dict(sorted(boards.items()))


def _render(
    boards: dict[tuple[str, str], list[Row]],
    folder: Path,
    scatter: Mapping[tuple[str, str], ReplicateScatter],
    errors: Mapping[tuple[str, str], PathErrorsByName],
) -> None:
    environment = Environment(
        loader=PackageLoader("granbench.leaderboard", "site"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["anchor"] = slug
    environment.filters["standing"] = standing
    environment.filters["answers_once"] = answers_once
    shared = {"granbench_version": __version__, "metric_version": METRIC_VERSION}
    pages = []
    for (task, version), board in boards.items():
        dataset = board[0].submission.dataset
        floor = scatter.get((dataset.name, dataset.version))
        page = _page(task, version, board, floor, errors.get((task, version), {}))
        pages.append(page)
        html = environment.get_template("task.html.j2").render(**shared, page=page)
        (folder / page["file"]).write_text(html, encoding="utf-8")
        for row in board:
            target = folder / page["slug"] / f"{slug(row.submission.name)}.json"
            target.parent.mkdir(exist_ok=True)
            shutil.copyfile(row.file, target)
    index = environment.get_template("index.html.j2").render(**shared, pages=pages)
    (folder / "index.html").write_text(index, encoding="utf-8")
    site = Path(__file__).parent / "site"
    for name in STATIC_FILES:
        shutil.copyfile(site / name, folder / name)
    content = {**shared, "tasks": [_summary(page, boards) for page in pages]}
    text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
    (folder / BOARD_FILE).write_text(text + "\n", encoding="utf-8")


def _page(
    task: str,
    version: str,
    board: list[Row],
    scatter: ReplicateScatter | None,
    errors: PathErrorsByName,
) -> dict[str, Any]:
    submissions = [row.submission for row in board]
    scores = [score for submission in submissions for score in submission.scores]
    splits = list(dict.fromkeys(score.split for score in scores if score.split != ALL))
    shown = metrics_shown(submissions)
    name = slug(f"{task}-{version}")
    floor = scatter.floor_mse if scatter else None
    views = [
        main_table(submissions, split, metric, floor, errors)
        for split in splits
        for metric in shown
    ]
    return {
        "task": task,
        "version": version,
        "slug": name,
        "file": f"{name}.html",
        "splits": [
            {
                "name": split,
                "paths": max(s.n for s in scores if s.split == split and s.group == ALL),
                "charts": _charts(submissions, split, floor),
                "physics": physics_table(submissions, split),
                "families": [
                    table
                    for metric in FAMILY_METRICS
                    if (table := family_table(submissions, split, metric)) is not None
                ],
            }
            for split in splits
        ],
        "metrics": shown,
        "analyses": analyses_tables(submissions),
        "analyses_charts": analyses_charts(submissions),
        "embedded_metrics": EMBEDDED_METRICS.values(),
        "checks": CHECKS.values(),
        "cost": cost_table(submissions),
        "views": views,
        "submissions": sorted(submissions, key=lambda item: (item.role != "model", item.name)),
        "dataset": submissions[0].dataset,
        "scatter": scatter,
        "void_ratio": any(
            score.metric == "void_ratio_mse_mean" and score.value for score in scores
        ),
        "leader": views[0].leader,
        "notes": shortages_of_scores(scores),
        "lost": {
            submission.name: _lost(submission)
            for submission in submissions
            if submission.badge == "rerun"
        },
    }


def _lost(submission: Submission) -> list[str]:
    """Analyses that a model has lost, so that rounding decides what comes out."""
    return sorted(
        f"{group.replace('-', ' ')} ({protocol.removeprefix(f'{EMBEDDED}-')})"
        for protocol, group in lost_analyses(submission.scores)
        if group != ALL
    )


def _charts(submissions: list[Any], split: str, floor: float | None) -> list[dict[str, Any]]:
    charts = []
    for spec in PROTOCOLS.values():
        lines = lines_of(submissions, split, spec.name)
        # A window starts from this packing's own truth, so scatter between packings is no
        # floor for it.
        reference = floor if spec.restart is None else None
        title = f"{spec.title}, split {split}: stress error against horizon"
        chart: Markup | None = horizon_chart(lines, title, reference)
        if chart is not None:
            zero = [line.name for line in lines if not any(line.value)]
            charts.append({"title": spec.title, "svg": chart, "zero": zero})
    return charts


def _summary(page: dict[str, Any], boards: dict[tuple[str, str], list[Row]]) -> dict[str, Any]:
    rows = boards[(page["task"], page["version"])]
    return {
        "task": page["task"],
        "dataset": page["dataset"].model_dump(mode="json"),
        "page": page["file"],
        "replicate_scatter": page["scatter"].as_dict() if page["scatter"] else None,
        "submissions": [
            row.submission.model_dump(
                mode="json", exclude={"scores", "curves", "normalisation"}, exclude_none=True
            )
            | {
                "file": f"{page['slug']}/{slug(row.submission.name)}.json",
                "scores": [
                    score.model_dump(mode="json", exclude_none=True)
                    for score in row.submission.scores
                    if score.group == ALL
                ],
            }
            for row in rows
        ],
    }
