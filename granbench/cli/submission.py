"""`granbench submission`: check a submission before it goes to the board."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from granbench.cli.printing import print_json

if TYPE_CHECKING:
    from collections.abc import Callable

app = typer.Typer(help="Submissions to the leaderboard.", no_args_is_help=True)

File = Annotated[
    Path, typer.Argument(help="Submission (JSON), its predictions or model beside it.")
]
Dataset = Annotated[
    str | None,
    typer.Option("--dataset", help="Records to score against; those it names by default."),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]


@app.callback()
def submission() -> None:
    """Submissions to the leaderboard."""


@app.command()
def validate(
    file: File, dataset: Dataset = None, as_json: Json = False, quiet: Quiet = False
) -> None:
    """Score a submission again from its predictions, or run its model again; refuse the rest."""
    from granbench.data.verification import task_file
    from granbench.leaderboard.validation import validate as check
    from granbench.records import open_records

    with rerun_bar(file, quiet or as_json) as progress:
        if dataset is None:
            checked = check(file, progress=progress)
        else:
            with open_records(task_file(dataset)) as records:
                checked = check(file, records, progress=progress)
    scored = sum(score.status == "scored" for score in checked.scores)
    if as_json:
        answer = {
            "file": str(file),
            "valid": True,
            "name": checked.name,
            "task": checked.task,
            "badge": checked.badge,
            "scores": len(checked.scores),
            "reproduced": scored,
        }
        print_json(answer)
    elif not quiet:
        source = checked.predictions.file if checked.predictions else "the model, run again"
        typer.echo(
            f"{file}: {checked.name} on {checked.task} {checked.dataset.version} is valid; all "
            f"{scored} values were reproduced from {source}"
        )


@contextmanager
def rerun_bar(file: Path, hidden: bool) -> Iterator["Callable[[int, str], None] | None"]:
    """Progress of a model that is run again; nothing where the scores come from predictions."""
    from granbench.cli.evaluate import evaluation_bar
    from granbench.leaderboard.rerunning import run_axes
    from granbench.leaderboard.submission import read_submission
    from granbench.protocols import progress_parts

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

    typer.echo(schema_text(), nl=False)
