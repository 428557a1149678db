"""`granbench leaderboard`: accept submissions, build the site."""

from pathlib import Path
from typing import Annotated

import typer

from granbench.cli.printing import print_json
from granbench.cli.submission import Dataset, File, Json, Quiet, rerun_bar
from granbench.errors import ConfigurationError

app = typer.Typer(help="The leaderboard: accept submissions, build the site.", no_args_is_help=True)

Board = Annotated[
    Path | None,
    typer.Option("--board", help="Folder of accepted submissions; the checkout's by default."),
]


@app.command()
def add(
    file: File,
    dataset: Dataset = None,
    board: Board = None,
    replace: Annotated[
        bool, typer.Option("--replace", help="Replace a submission of the same name.")
    ] = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Validate a submission and copy it, with its predictions or its model, onto the board."""
    from granbench.data.verification import task_file
    from granbench.leaderboard.board import accept, default_folder
    from granbench.leaderboard.submission import read_submission
    from granbench.records import open_records

    folder = board or default_folder()
    with rerun_bar(file, quiet or as_json) as progress:
        if dataset is None:
            target = accept(file, folder, replace=replace, progress=progress)
        else:
            with open_records(task_file(dataset)) as records:
                target = accept(file, folder, records, replace=replace, progress=progress)
    badge = read_submission(target).badge
    if as_json:
        print_json({"accepted": str(target), "badge": badge})
    elif not quiet:
        typer.echo(f"{file} is accepted as {target}, {badge}")


@app.command()
def build(
    out: Annotated[Path, typer.Option("--out", help="Folder of the site.")],
    board: Board = None,
    extra: Annotated[
        list[Path] | None,
        typer.Option("--with", help="Submission to show as well, without accepting it."),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Render the board as a static site that works offline."""
    from granbench.leaderboard.board import Row, accepted, default_folder
    from granbench.leaderboard.build import build as render
    from granbench.leaderboard.reference import replicate_scatters
    from granbench.leaderboard.submission import read_submission

    if board is not None and not board.is_dir():
        raise ConfigurationError(f"--board {board} is no folder; give one of submissions")
    rows = accepted(board or default_folder())
    for path in extra or ():
        claimed = read_submission(path).model_copy(update={"badge": "claimed"})
        rows.append(Row(claimed, path))
    index = render(rows, out, replicate_scatters(row.submission.dataset for row in rows))
    if as_json:
        print_json({"index": str(index), "submissions": len(rows)})
    elif not quiet:
        typer.echo(f"{index} shows {len(rows)} submissions")
