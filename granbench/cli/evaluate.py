"""`granbench evaluate`: score a model on a task and write its submission."""

import json
from pathlib import Path
from typing import Annotated

import typer

from granbench.cli.evaluation_facts import (
    KEPT,
    MODEL,
    PREDICTIONS,
    authors_of,
    licence_of,
    shown_command,
    training_data_of,
    what_was_written,
)
from granbench.cli.evaluation_progress import evaluation_bar
from granbench.cli.model_options import evaluated_model
from granbench.cli.options import (
    default_task,
    listed_seeds,
    naming_option,
    refuse_overwriting,
    require_one_of,
    require_writable,
)
from granbench.cli.printing import print_json, say, show
from granbench.cli.shared_options import MODEL_HELP
from granbench.cli.task_option import TaskName

MODEL_FILES = ("model.json", "model.safetensors", "training.safetensors", "parameters.json")
"""Files in the folder of a trained model."""

ROLES = ("model", "floor")


def evaluate(
    model: Annotated[
        str,
        typer.Argument(help=MODEL_HELP),
    ],
    task: TaskName = None,
    axis: Annotated[
        list[str] | None,
        typer.Option(
            "--axis",
            help="Axis of the task (`granbench task info` lists them), once for each; all axes by "
            "default.",
        ),
    ] = None,
    model_dir: Annotated[
        list[Path] | None,
        typer.Option("--model-dir", help="Folder of a trained model; repeat for each seed."),
    ] = None,
    seeds: Annotated[
        str | None,
        typer.Option("--seeds", help="Seeds of the models or of the noise, such as 0,1,2."),
    ] = None,
    out: Annotated[Path, typer.Option("--out", help="Submission to write.")] = Path(
        "submission.json"
    ),
    name: Annotated[str | None, typer.Option("--name", help="Name on the leaderboard.")] = None,
    title: Annotated[str | None, typer.Option("--title", help="One line about the model.")] = None,
    authors: Annotated[
        str | None,
        typer.Option("--authors", help="Authors, separated by commas; 'anonymous' by default."),
    ] = None,
    code: Annotated[str | None, typer.Option("--code", help="Address of the model's code.")] = None,
    licence: Annotated[str | None, typer.Option("--licence", help="Licence of the model.")] = None,
    training_data: Annotated[
        str | None, typer.Option("--training-data", help="Data that the model was trained on.")
    ] = None,
    role: Annotated[
        str | None,
        typer.Option(
            "--role", help="model or floor; a floor is shown for comparison and not ranked."
        ),
    ] = None,
    keep: Annotated[
        str,
        typer.Option(
            "--keep", help="Evidence kept with the submission: predictions, or the model itself."
        ),
    ] = PREDICTIONS,
    against: Annotated[
        list[Path] | None,
        typer.Option(
            "--against",
            help="Submission to show in the table as well; repeat for several.",
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the submission instead of a table.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Score a model on all axes of a task, and write its submission and predictions.

    With --keep model the model is written instead of its predictions. This is for baselines of
    GranBench and classical models, which are run again whenever the scores are checked.
    """
    from granbench.benchmark.evaluation import predict, progress_parts
    from granbench.benchmark.predictions import CELL_NOTES, evaluated
    from granbench.benchmark.task_registry import find_task, task_records
    from granbench.benchmark.task_summary import shortages_of_scores
    from granbench.cli.score_tables import tables
    from granbench.leaderboard.composition import check_target, compose
    from granbench.leaderboard.model_files import require_data_only
    from granbench.leaderboard.submission import About, read_submission

    task_name = task or default_task()
    numbers = None if seeds is None else listed_seeds(seeds)
    with naming_option("--out"):
        predictions_file = check_target(out)
    for target in (out, predictions_file):
        require_writable("--out", target)
        refuse_overwriting(target, "MODEL", Path(model))
        refuse_overwriting(target, "--task", Path(task_name))
        for other in against or ():
            refuse_overwriting(target, "--against", other)
        for folder in (Path(model), *(model_dir or ())):
            for file in MODEL_FILES:
                refuse_overwriting(target, f"the model in {folder}", folder / file)
    require_one_of("--keep", keep, KEPT)
    require_one_of("--role", role or ROLES[0], ROLES)
    others = [read_submission(path) for path in against or ()]
    chosen = find_task(task_name)
    axes = chosen.chosen_axes(axis or chosen.axes)
    with task_records(chosen) as dataset:
        records = chosen.view(dataset)
        candidate = evaluated_model(model, records, model_dir or (), numbers)
        kept = candidate if keep == MODEL else None
        if kept is not None:
            require_data_only(kept)  # before minutes of work
        about = About.checked(
            name=name or candidate.name,
            title=title or candidate.title,
            authors=authors_of(authors, candidate),
            code=code,
            role=role or ("floor" if candidate.floor else "model"),
            parameters=candidate.parameters,
            training_data=training_data_of(training_data, candidate, chosen),
            licence=licence_of(licence, candidate),
            command=shown_command(
                model, task_name, axes=axis, folders=model_dir, seeds=candidate.cells, name=name,
                keep=keep, out=out,
            ),
        )  # fmt: skip
        runs = len(candidate.cells) * progress_parts(axes)
        with evaluation_bar(runs, about.name, quiet or as_json) as advance:
            predictions = predict(
                candidate.cells, evaluated(records).load(), axes, task=chosen,
                training_seconds=candidate.training_seconds, progress=advance,
            )  # fmt: skip
        submission = compose(predictions, dataset, about, out, task=chosen, model=kept)
    if as_json:
        print_json(json.loads(out.read_text(encoding="utf-8")))
    elif not quiet:
        show(*tables(submission, others, axes))
        notes = json.loads(predictions.attrs.get(CELL_NOTES, "[]"))
        for text in [*notes, *shortages_of_scores(submission.scores)]:
            say(f"note: {text}")
        say(what_was_written(submission, out))
