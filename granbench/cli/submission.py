"""`granbench submission`: check a submission before it goes to the board."""

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

    from granbench.leaderboard.admission import Examination

app = typer.Typer(help="Submissions to the leaderboard.", no_args_is_help=True)

File = Annotated[
    Path, typer.Argument(help="Submission (JSON), its predictions or model beside it.")
]
Dataset = Annotated[
    str | None,
    typer.Option("--dataset", help="Records to score against; those it names by default."),
]
Board = Annotated[
    Path | None,
    typer.Option("--board", help="Folder of accepted submissions; the checkout's by default."),
]


@app.callback()
def submission() -> None:
    """Submissions to the leaderboard."""


@app.command()
def validate(
    file: File,
    dataset: Dataset = None,
    board: Board = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Score a submission again from its predictions, or run its model again; refuse the rest.

    Says as well whether the board would take it. A copy of the truth or of another row is refused,
    as by `granbench leaderboard add`.
    """
    from granbench.data.verification import task_file
    from granbench.leaderboard.admission import examine
    from granbench.records import open_records

    folder = board_or_default(board)
    with rerun_bar(file, quiet or as_json) as progress:
        if dataset is None:
            examination = examine(file, folder, progress=progress)
        else:
            with open_records(task_file(dataset)) as records:
                examination = examine(file, folder, records, progress=progress)
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
    """Labels of scores that did not come out again, without those of curves."""
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
            f"{len(lost)} were NOT, of analyses that the model has lost. The board shows the "
            "recomputed ones, not those of the file."
        )
        for label in lost[:5]:
            yield f"  not reproduced: {label}"
    else:
        yield f"{where} is valid; all {scored} values were reproduced from {source}"
    if checked.deterministic and len(checked.seeds) > 1:
        yield "Its seeds have one answer: it is one deterministic model, and is shown so."
    if not examination.objections:
        yield "The board would take it."
    for objection in examination.objections:
        yield f"The board would not take it: {objection.text}."


def board_or_default(board: Path | None) -> Path | None:
    """The board's folder; that of the checkout by default, None where there is none."""
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
def rerun_bar(file: Path, hidden: bool) -> Iterator["Callable[[int, str], None] | None"]:
    """Progress of a model that is run again; nothing where the scores come from predictions."""
    from granbench.benchmark.evaluation import progress_parts
    from granbench.cli.evaluate import evaluation_bar
    from granbench.leaderboard.rerunning import run_axes
    from granbench.leaderboard.submission import read_submission

    submission = read_submission(file)
    if submission.model is None:
        yield None
        return
    runs = len(submission.seeds) * progress_parts(run_axes(submission))
    with evaluation_bar(runs, submission.name, hidden) as advance:
        yield advance


@app.command()
def schema() -> None:
    """Print the JSON Schema of a submission."""
    from granbench.leaderboard.submission import schema_text

    say(schema_text().rstrip("\n"))
