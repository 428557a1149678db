"""`granbench task`: list and describe the tasks that models are scored on."""

from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from granbench.cli.printing import note, print_json, say, show
from granbench.cli.shared_options import Json

if TYPE_CHECKING:
    from collections.abc import Mapping

    from granbench.benchmark.task import Task
    from granbench.benchmark.task_summary import SplitSize

app = typer.Typer(help="Tasks: list and describe what models are scored on.", no_args_is_help=True)


@app.command("list")
def list_tasks(as_json: Json = False) -> None:
    """List the registered tasks, with a note for each that cannot be read."""
    from granbench.benchmark.task_registry import readable_tasks
    from granbench.benchmark.task_summary import task_as_json

    tasks, faults = readable_tasks()
    for fault in faults:
        note(f"not listed: {fault}")
    if as_json:
        print_json([task_as_json(task) for task in tasks])
        return
    table = Table("task", "version", "dataset", "axes", "content")
    for task in tasks:
        dataset = f"{task.dataset.name} {task.dataset.version}"
        table.add_row(task.id, task.version, dataset, ", ".join(task.axes), task.summary)
    show(table)


@app.command()
def info(
    name: Annotated[
        str, typer.Argument(metavar="TASK", help="Task name, NAME@VERSION, YAML or netCDF file.")
    ],
    as_json: Json = False,
) -> None:
    """Describe a task: splits, context, axes, analyses, ground truth and training data."""
    from granbench.benchmark.task_registry import find_task, records_at_hand
    from granbench.benchmark.task_summary import split_sizes, task_as_json

    task = find_task(name)
    with records_at_hand(task) as records:
        sizes = None if records is None else split_sizes(task, records)
    if as_json:
        print_json(task_as_json(task, sizes))
    else:
        _print(task, sizes)


def _print(task: "Task", sizes: "Mapping[str, SplitSize] | None") -> None:
    from granbench.benchmark.task_summary import shortages_of_task

    facts = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    facts.add_column()
    facts.add_column()
    facts.add_row("dataset", f"{task.dataset.name} {task.dataset.version}")
    facts.add_row("content_sha256", task.dataset.content_sha256)
    facts.add_row("axes", ", ".join(task.axes))
    facts.add_row("given at the start", ", ".join(task.context))
    truth = task.ground_truth
    facts.add_row("ground truth", "none" if truth is None else truth.model)
    for data in task.training_data:
        allowed = f"{data.dataset} {data.version}, {', '.join(data.splits)}"
        facts.add_row("allowed training data", allowed)
    table = Table("split", "used for", "paths", "specimens")
    for split, role in task.splits.roles().items():
        size = None if sizes is None else sizes[split]
        counts = ("?", "?") if size is None else (str(size.paths), str(size.specimens))
        table.add_row(split, _USES.get(role, "scoring, out of distribution"), *counts)
    say(f"{task.id} {task.version}: {task.summary}")
    show(facts, table)
    if task.analyses:
        analyses = Table("analysis", "problem", "mesh", "solvers", "choices")
        for one in task.analyses:
            choices = ", ".join(f"{key}={value}" for key, value in one.choices.items())
            analyses.add_row(one.name, one.problem, one.mesh, ", ".join(one.solvers), choices)
        show(analyses)
    if sizes is None:
        say("note: the records are not on this machine; get them with `granbench data fetch`")
    else:
        for sentence in shortages_of_task(task, sizes):
            say(f"note: {sentence}")


_USES = {"train": "training", "validation": "validation", "test": "scoring"}
