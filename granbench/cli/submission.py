"""`granbench submission`: check a submission before it goes to the board."""

import json
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(help="Submissions to the leaderboard.", no_args_is_help=True)

File = Annotated[Path, typer.Argument(help="Submission (JSON), its predictions beside it.")]
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
    """Score a submission again from its predictions; refuse what they do not bear out."""
    from granbench.data.verification import task_file
    from granbench.leaderboard.validation import validate as check
    from granbench.records import open_records

    if dataset is None:
        checked = check(file)
    else:
        with open_records(task_file(dataset)) as records:
            checked = check(file, records)
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
        typer.echo(json.dumps(answer, indent=2, ensure_ascii=False))
    elif not quiet:
        typer.echo(
            f"{file}: {checked.name} on {checked.task} {checked.dataset.version} is valid; all "
            f"{scored} values were reproduced from {checked.predictions.file}"
        )


@app.command()
def schema() -> None:
    """Print the JSON Schema of a submission."""
    from granbench.leaderboard.submission import schema_text

    typer.echo(schema_text(), nl=False)
