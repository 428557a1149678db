"""`granbench evaluate`: score a model on a task and write its submission."""

import json
import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from granbench.cli.options import (
    default_task,
    listed_seeds,
    refuse_overwriting,
    require_one_of,
    require_writable,
)
from granbench.cli.printing import print_json, say, show

if TYPE_CHECKING:
    from collections.abc import Callable

    from granbench.cells.find import FoundModel
    from granbench.leaderboard.submission import Submission

MODEL_FILES = ("model.json", "model.safetensors", "training.safetensors", "parameters.json")
"""Of a trained model's folder."""

KEPT = ("predictions", "model")
ROLES = ("model", "floor")

HOUSE_AUTHORS = "The GranBench authors"
HOUSE_LICENCE = "BSD-3-Clause"


def evaluate(
    model: Annotated[
        str,
        typer.Argument(
            help="Baseline name, folder of a trained model, or package.module:factory of a cell."
        ),
    ],
    task: Annotated[
        str | None,
        typer.Option(
            "--task",
            help="Dataset name, NAME@VERSION or netCDF file; dem-triaxial by default, or "
            "dem-triaxial-mini where that is not on this machine.",
        ),
    ] = None,
    axis: Annotated[
        list[str] | None,
        typer.Option(
            "--axis",
            help="Axis to evaluate, such as one named in docs/scoring.md; repeat for several. "
            "All that apply by default.",
        ),
    ] = None,
    model_dir: Annotated[
        list[Path] | None, typer.Option("--model-dir", help="Trained model; once for each seed.")
    ] = None,
    seeds: Annotated[
        str | None, typer.Option("--seeds", help="Comma-separated; of the models or the noise.")
    ] = None,
    out: Annotated[Path, typer.Option("--out", help="Submission to write.")] = Path(
        "submission.json"
    ),
    name: Annotated[str | None, typer.Option("--name", help="Name on the leaderboard.")] = None,
    title: Annotated[str | None, typer.Option("--title", help="One line about it.")] = None,
    authors: Annotated[
        str | None, typer.Option("--authors", help="Comma-separated; 'anonymous' by default.")
    ] = None,
    code: Annotated[str | None, typer.Option("--code", help="Address of the model's code.")] = None,
    licence: Annotated[str | None, typer.Option("--licence", help="Of the model.")] = None,
    training_data: Annotated[
        str | None, typer.Option("--training-data", help="What it was trained on.")
    ] = None,
    role: Annotated[
        str | None,
        typer.Option("--role", help="model or floor; a floor frames the table and is not ranked."),
    ] = None,
    keep: Annotated[
        str,
        typer.Option("--keep", help="What bears the scores out: predictions, or the model itself."),
    ] = "predictions",
    against: Annotated[
        list[Path] | None,
        typer.Option("--against", help="Submission to compare with in the table."),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the submission instead of a table.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Score a model on every axis of a task and write its submission and predictions.

    With --keep model the model is written in place of its predictions; for baselines of
    GranBench and classical models, which are run again wherever the scores are checked.
    """
    from granbench.benchmark.evaluation import predict, progress_parts
    from granbench.benchmark.predictions import CELL_NOTES, evaluated
    from granbench.benchmark.registry import chosen_axes
    from granbench.cells.find import find_cells
    from granbench.cli.score_tables import tables
    from granbench.data.verification import task_file
    from granbench.leaderboard.composition import check_target, compose
    from granbench.leaderboard.model_files import require_data_only
    from granbench.leaderboard.submission import About, read_submission
    from granbench.records import open_records

    task = task or default_task()
    numbers = None if seeds is None else listed_seeds(seeds)
    axes = chosen_axes(axis or None)
    for target in (out, check_target(out)):
        require_writable("--out", target)
        refuse_overwriting(target, "MODEL", Path(model))
        refuse_overwriting(target, "--task", Path(task))
        for other in against or ():
            refuse_overwriting(target, "--against", other)
        for folder in (Path(model), *(model_dir or ())):
            for file in MODEL_FILES:
                refuse_overwriting(target, f"the model in {folder}", folder / file)
    require_one_of("--keep", keep, KEPT)
    require_one_of("--role", role or ROLES[0], ROLES)
    others = [read_submission(path) for path in against or ()]
    with open_records(task_file(task)) as records:
        candidate = find_cells(model, records, folders=model_dir or (), seeds=numbers)
        kept = candidate if keep == "model" else None
        if kept is not None:
            require_data_only(kept)  # before minutes of work
        about = About.checked(
            name=name or candidate.name,
            title=title or getattr(candidate.baseline, "title", None),
            authors=_authors(authors, candidate),
            code=code,
            role=role or ("floor" if candidate.floor else "model"),
            parameters=candidate.parameters,
            training_data=training_data or _training_data(candidate, records.attrs),
            licence=licence or (HOUSE_LICENCE if candidate.baseline else "not stated"),
            command=_command(model, task, axis, model_dir, candidate.cells, name, keep, out),
        )
        runs = len(candidate.cells) * progress_parts(axes)
        with evaluation_bar(runs, about.name, quiet or as_json) as advance:
            predictions = predict(
                candidate.cells, evaluated(records).load(), axes,
                training_seconds=candidate.training_seconds, progress=advance,
            )  # fmt: skip
        submission = compose(predictions, records, about, out, model=kept)
    if as_json:
        print_json(json.loads(out.read_text(encoding="utf-8")))
    elif not quiet:
        show(*tables(submission, others))
        for note in json.loads(predictions.attrs.get(CELL_NOTES, "[]")):
            say(f"note: {note}")
        say(_written(submission, out))


def _written(submission: "Submission", out: Path) -> str:
    if submission.predictions is not None:
        megabytes = submission.predictions.bytes / 1e6
        return f"{out} and {submission.predictions.file} ({megabytes:.1f} MB) are written"
    if submission.model is not None and submission.model.files:
        folder = submission.model.files[0].path.split("/")[0]
        return f"{out} and the model in {folder} are written"
    return f"{out} is written; its model needs no file"


def _authors(authors: str | None, candidate: "FoundModel") -> tuple[str, ...]:
    named = tuple(author.strip() for author in (authors or "").split(",") if author.strip())
    return named or (HOUSE_AUTHORS if candidate.baseline else "anonymous",)


def _training_data(candidate: "FoundModel", attrs: dict[str, Any]) -> str:
    if candidate.training_data:
        return candidate.training_data
    if not candidate.trained:
        return f"{attrs.get('dataset')} {attrs.get('version')}, split train at most"
    return "not stated"


def _command(
    model: str,
    task: str,
    axes: Sequence[str] | None,
    folders: Sequence[Path] | None,
    seeds: Any,
    name: str | None,
    keep: str,
    out: Path,
) -> str:
    """The command as it can be shown: folders by their last name only."""
    model_name = model if ":" in model else Path(model).name
    words = ["granbench", "evaluate", model_name, "--task", Path(task).name]
    for axis in axes or ():
        words += ["--axis", axis]
    for folder in folders or ():
        words += ["--model-dir", folder.resolve().name]
    words += ["--seeds", ",".join(map(str, seeds))]
    if name:
        words += ["--name", name]
    if keep != KEPT[0]:
        words += ["--keep", keep]
    words += ["--out", out.name]
    return shlex.join(words)


@contextmanager
def evaluation_bar(runs: int, name: str, hidden: bool) -> Iterator["Callable[[int, str], None]"]:
    """A bar on the terminal's stderr that moves with every part of an evaluation."""
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    )  # fmt: skip
    hidden = hidden or not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=hidden) as progress:
        job = progress.add_task(f"evaluating {name}", total=runs)

        def advance(seed: int, done: str) -> None:
            progress.update(job, advance=1, description=f"{name}, seed {seed}: {done}")

        yield advance
