"""`granbench leaderboard`: accept submissions, build the site."""

from pathlib import Path
from typing import Annotated

import typer

from granbench.cli.printing import print_json, say
from granbench.cli.shared_options import Json, Quiet
from granbench.cli.submission import (
    Board,
    Dataset,
    File,
    TaskFile,
    records_to_score,
    rerun_bar,
    task_to_score,
)
from granbench.errors import ConfigurationError, SubmissionError

app = typer.Typer(help="The leaderboard: accept submissions, build the site.", no_args_is_help=True)


@app.command()
def add(
    file: File,
    dataset: Dataset = None,
    task: TaskFile = None,
    board: Board = None,
    replace: Annotated[
        bool, typer.Option("--replace", help="Replace a submission of the same name.")
    ] = False,
    reason: Annotated[
        str | None,
        typer.Option(
            "--reason",
            "--word",
            help="A maintainer's reason to accept a submission that is flagged as a copy; it is "
            "shown in the row.",
        ),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Validate a submission and add it to the leaderboard, with its predictions or its model.

    The leaderboard stores the recomputed numbers, not those of the file.
    """
    from granbench.leaderboard.board import accept, default_folder
    from granbench.leaderboard.submission import read_submission

    folder = board or default_folder()
    chosen = task_to_score(task)
    with (
        records_to_score(dataset) as records,
        rerun_bar(file, records, chosen, quiet or as_json) as progress,
    ):
        target = accept(
            file, folder, records, task=chosen, replace=replace, word=reason, progress=progress
        )
    badge = read_submission(target).badge
    if as_json:
        print_json({"accepted": str(target), "badge": badge})
    elif not quiet:
        say(f"{file} is accepted as {target}, {badge}")


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
    """Build the leaderboard as a static site that works offline."""
    from granbench.leaderboard.board import Row, accepted, default_folder
    from granbench.leaderboard.build import build as render
    from granbench.leaderboard.ranking import path_errors
    from granbench.leaderboard.reference import replicate_scatters
    from granbench.leaderboard.submission import read_submission

    if board is not None and not board.is_dir():
        raise ConfigurationError(f"--board {board} is not a folder; give one of submissions")
    rows = accepted(board or default_folder())
    for path in extra or ():
        claimed = read_submission(path).model_copy(update={"badge": "claimed"})
        rows.append(Row(claimed, path))
    by_task: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        by_task.setdefault(row.submission.board, []).append(row)
    errors = {place: path_errors(of_task) for place, of_task in by_task.items()}
    index = render(rows, out, replicate_scatters(row.submission.dataset for row in rows), errors)
    if as_json:
        print_json({"index": str(index), "submissions": len(rows)})
    elif not quiet:
        say(f"{index} shows {len(rows)} submissions")


@app.command()
def revalidate(
    board: Board = None,
    changed: Annotated[
        bool,
        typer.Option("--changed", help="Validate only rows that differ from an earlier commit."),
    ] = False,
    since: Annotated[
        str | None,
        typer.Option(
            "--since",
            help="Earlier commit for --changed; by default the last one shared with main or, on "
            "main, the previous one.",
        ),
    ] = None,
    state: Annotated[
        Path | None,
        typer.Option(
            "--state",
            help="File that lists the rows already validated; give it again to go on.",
        ),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Validate rows of the leaderboard again, and check the seals of all rows."""
    from granbench.leaderboard.revalidation import revalidate as run
    from granbench.leaderboard.revalidation import touched
    from granbench.leaderboard.rows import accepted, default_folder
    from granbench.leaderboard.sealing import require_seal

    if since is not None and not changed:
        raise ConfigurationError("--since is only for --changed; give both")
    folder = board or default_folder()
    if not folder.is_dir():
        raise ConfigurationError(f"--board {folder} is not a folder; give one of submissions")
    everything = accepted(folder)
    for row in everything:
        require_seal(row.submission, row.file)
    rows = touched(folder, since) if changed else everything
    refused = []
    for outcome in run(rows, folder, state):
        if outcome.complaint is not None:
            refused.append(outcome.complaint)
            say(f"REFUSED {outcome.complaint}", err=True)
        elif not quiet:
            say(f"valid   {outcome.file}{' (validated earlier)' if outcome.known else ''}")
    if not quiet:
        say(f"the seals of {len(everything)} rows are valid; {len(rows)} rows were validated again")
    if refused:
        raise SubmissionError(f"{len(refused)} of {len(rows)} rows are not valid: {refused[0]}")
