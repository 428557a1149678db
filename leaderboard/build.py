"""The static site: one page a task, an index, `leaderboard.json`; it needs no network."""

import json
import os
import shutil
import uuid
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from granbench import __version__
from granbench.benchmark.metric import METRIC_VERSION
from granbench.benchmark.scorecard import ALL
from granbench.data.replicates import ReplicateScatter
from granbench.errors import ConfigurationError, SubmissionError
from granbench.files.whole_file import cannot_write
from granbench.leaderboard.ranking import RankedErrorsByName, answers_once, standing
from granbench.leaderboard.rows import Row, slug
from granbench.leaderboard.sealing import require_seal
from granbench.leaderboard.showable import require_showable
from granbench.leaderboard.task_page import task_page

STATIC_FILES = ("board.css", "board.js")
BOARD_FILE = "leaderboard.json"


def build(
    rows: Sequence[Row],
    out: Path,
    scatter: Mapping[tuple[str, str], ReplicateScatter] | None = None,
    errors: Mapping[tuple[str, str], RankedErrorsByName] | None = None,
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
        raise ConfigurationError(f"{out} is a file; give a folder for the site")
    if out.is_dir() and any(out.iterdir()) and not (out / BOARD_FILE).is_file():
        raise ConfigurationError(
            f"{out} holds files that are not a leaderboard; give an empty or new folder"
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
    errors: Mapping[tuple[str, str], RankedErrorsByName],
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
        page = task_page(task, version, board, floor, errors.get((task, version), {}))
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
