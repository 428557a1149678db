"""`granbench submission`: check a submission before it is sent to the leaderboard."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from granbench.cli.printing import print_json, say
from granbench.cli.shared_options import Json, Quiet
from granbench.errors import ConfigurationError, SubmissionError

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr

    from granbench.benchmark.task import Task
    from granbench.leaderboard.admission import Examination

app = typer.Typer(help="Submissions to the leaderboard.", no_args_is_help=True)

File = Annotated[
    Path,
    typer.Argument(
        help="Submission (JSON); its predictions or model must be in the same folder.",
    ),
]
Dataset = Annotated[
    str | None,
    typer.Option(
        "--dataset",
        help="Records to score against; by default those of the task.",
    ),
]
TaskFile = Annotated[
    str | None,
    typer.Option(
        "--task",
        help="Task to score on, by name or YAML file; by default the one in the submission.",
    ),
]
Board = Annotated[
    Path | None,
    typer.Option(
        "--board",
        help="Folder of accepted submissions; by default that of the checkout.",
    ),
]


@app.callback()
def submission() -> None:
    """Submissions to the leaderboard."""


@app.command()
def validate(
    file: File,
    dataset: Dataset = None,
    task: TaskFile = None,
    board: Board = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Score a submission again from its predictions, or by running its model again.

    The submission is refused if a number is not reproduced, or if it is a copy of the truth or of
    another row. Other reasons why the leaderboard would refuse it are listed.
    """
    from granbench.leaderboard.admission import examine

    folder = board_or_default(board)
    chosen = task_to_score(task)
    with (
        records_to_score(dataset) as records,
        rerun_bar(file, records, chosen, quiet or as_json) as progress,
    ):
        examination = examine(file, folder, records, task=chosen, progress=progress)
    for objection in examination.objections:
        if objection.flagged:
            raise SubmissionError(f"{file}: {objection.text}")
    if as_json:
        print_json(_as_json(file, examination))
    elif not quiet:
        for line in _sentences(file, examination):
            say(line)


def _as_json(file: Path, examination: "Examination") -> dict[str, object]:
    checked = examination.submission
    scored = sum(score.status == "scored" for score in checked.scores)
    return {
        "file": str(file),
        "valid": True,
        "name": checked.name,
        "task": checked.task,
        "badge": checked.badge,
        "deterministic": bool(checked.deterministic),
        "scores": len(checked.scores),
        "reproduced": scored - len(_scores_of_lost(examination)),
        "not_reproduced": list(examination.validated.not_reproduced),
        "accepted_by_board": not examination.objections,
        "objections": [objection.text for objection in examination.objections],
    }


def _scores_of_lost(examination: "Examination") -> list[str]:
    """Labels of scores that were not reproduced, without those of curves."""
    labels = examination.validated.not_reproduced
    return [label for label in labels if not label.startswith("curve ")]


def _sentences(file: Path, examination: "Examination") -> Iterator[str]:
    checked = examination.submission
    scored = sum(score.status == "scored" for score in checked.scores)
    source = checked.predictions.file if checked.predictions else "the model, run again"
    where = f"{file}: {checked.name} on {checked.task} {checked.dataset.version}"
    lost = _scores_of_lost(examination)
    if examination.validated.not_reproduced:
        yield (
            f"{where}: {scored - len(lost)} of {scored} values were reproduced from {source}; "
            f"{len(lost)} were NOT, because after a large error in the reaction an analysis is "
            "chaotic. The leaderboard shows the recomputed values, not those of the file."
        )
        for label in lost[:5]:
            yield f"  not reproduced: {label}"
    else:
        yield f"{where} is valid; all {scored} values were reproduced from {source}"
    if checked.deterministic and len(checked.seeds) > 1:
        yield "All seeds give the same answers: it is shown as one deterministic model."
    if not examination.objections:
        yield "The leaderboard would accept it."
    for objection in examination.objections:
        yield f"The leaderboard would refuse it: {objection.text}."


def board_or_default(board: Path | None) -> Path | None:
    """The leaderboard's folder; by default that of the checkout; None without a checkout."""
    from granbench.leaderboard.rows import default_folder

    if board is not None:
        if not board.is_dir():
            raise ConfigurationError(f"--board {board} is not a folder; give one of submissions")
        return board
    try:
        return default_folder()
    except ConfigurationError:
        return None


@contextmanager
def records_to_score(dataset: str | None) -> "Iterator[xr.Dataset | None]":
    """The records that `--dataset` names, verified; None where the option is left out."""
    if dataset is None:
        yield None
        return
    from granbench.data.verification import task_file
    from granbench.records import open_records

    with open_records(task_file(dataset)) as records:
        yield records


def task_to_score(task: str | None) -> "Task | None":
    """The task that `--task` names; None where the option is left out."""
    if task is None:
        return None
    from granbench.benchmark.task_registry import find_task

    return find_task(task)


@contextmanager
def rerun_bar(
    file: Path, records: "xr.Dataset | None", task: "Task | None", hidden: bool
) -> Iterator["Callable[[int, str], None] | None"]:
    """Progress of a model that is run again; None if the scores come from predictions."""
    from granbench.benchmark.evaluation import progress_parts
    from granbench.cli.evaluation_progress import evaluation_bar
    from granbench.leaderboard.rerunning import run_axes
    from granbench.leaderboard.submission import read_submission
    from granbench.leaderboard.submitted_task import task_of

    submission = read_submission(file)
    if submission.model is None:
        yield None
        return
    axes = run_axes(submission, task or task_of(submission, file, records))
    runs = len(submission.seeds) * progress_parts(axes)
    with evaluation_bar(runs, submission.name, hidden) as advance:
        yield advance


@app.command()
def schema() -> None:
    """Print the JSON Schema of a submission."""
    from granbench.leaderboard.submission import schema_text

    say(schema_text().rstrip("\n"))
