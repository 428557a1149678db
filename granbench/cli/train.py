"""`granbench train`: train a baseline, or continue an earlier run."""

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from granbench.cli.options import default_task, require_cores, require_folder, seed_option
from granbench.cli.pictures import draw_beside_results
from granbench.cli.printing import print_json, say
from granbench.cli.progress import progress_bar
from granbench.cli.task_option import TaskName
from granbench.cli.termination import stopped_by_sigterm
from granbench.errors import ConfigurationError, GranbenchError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from granbench.cells.baseline import EpochReport

SECONDS_PER_MINUTE = 60.0


def train(
    baseline: Annotated[str, typer.Argument(metavar="BASELINE", help="One of {baselines}.")],
    out: Annotated[
        Path, typer.Option("--out", help="Folder of the run; an earlier run in it is continued.")
    ],
    task: TaskName = None,
    seed: Annotated[int, seed_option("Seed of weights and batches.")] = 0,
    preset: Annotated[
        str | None, typer.Option("--preset", help="Training settings, such as reference or paper.")
    ] = None,
    budget: Annotated[
        float | None,
        typer.Option(
            "--budget",
            metavar="MINUTES",
            help="Largest training time, in total over all runs of the command.",
        ),
    ] = None,
    epochs: Annotated[
        int | None,
        typer.Option("--epochs", min=1, help="Largest number of epochs; the preset's by default."),
    ] = None,
    device: Annotated[str, typer.Option("--device", help="cpu or cuda.")] = "cpu",
    threads: Annotated[
        int,
        typer.Option(
            "--threads", min=1, help="CPU threads; more are faster only if the cores are idle."
        ),
    ] = 1,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON instead of a sentence.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Train a baseline on a task; run the same command again to continue.

    The model is given only the training and validation splits of the task. The folder then holds
    model.safetensors and model.json, history.csv and learning_curve.png, and training.safetensors,
    from which a run continues.
    """
    seconds = None if budget is None else _seconds(budget)
    require_cores("--threads", threads)
    require_folder("--out", out)

    import torch

    from granbench.baselines.training.history import CURVE_FILE, HISTORY_FILE
    from granbench.benchmark.task_registry import find_task, task_records
    from granbench.cells.baseline import DESCRIPTION_FILE, TrainingRequest, find_baseline

    model = find_baseline(baseline)
    chosen = find_task(task or default_task())
    # One by default: the last digits of a result depend on the number of threads, and threads that
    # wait for a busy core made an epoch twenty times slower.
    torch.set_num_threads(threads)
    with (
        stopped_by_sigterm(),
        task_records(chosen) as dataset,
        progress_bar(f"training {baseline}", 1.0, shown="share", hidden=quiet) as bar,
        _removed_if_empty(out),
        chosen.naming_missing_splits(),
    ):
        folder = model.train(
            TrainingRequest(
                records=chosen.trainable(dataset),
                out=out,
                seed=seed,
                preset=preset,
                epochs=epochs,
                seconds=seconds,
                device=device,
                on_epoch=lambda report: bar.move(
                    report.progress, text=f"training {baseline}: {_losses(report)}"
                ),
            )
        )
    if (folder / HISTORY_FILE).exists():  # a fit of a classical model has none
        draw_beside_results(
            folder / CURVE_FILE, lambda: _figure(folder, f"{baseline}, seed {seed}")
        )
    description = json.loads((folder / DESCRIPTION_FILE).read_text())
    if as_json:
        print_json(description | {"folder": str(folder)})
    elif not quiet:
        run = description["training"]
        say(
            f"{baseline}, seed {seed}: validation loss {run['best_validation_loss']:.3g} at epoch "
            f"{run['best_epoch']} of {run['epochs']} (ended by {run['ended_by']}, "
            f"{run['seconds'] / SECONDS_PER_MINUTE:.1f} minutes); the model is in {folder}"
        )


def _figure(folder: Path, title: str) -> "Figure":
    from granbench.baselines.training.history import learning_curve, read_history
    from granbench.plotting import learning_curve_figure

    return learning_curve_figure(learning_curve(read_history(folder)), title=title)


@contextmanager
def _removed_if_empty(out: Path) -> Iterator[None]:
    """Remove a new folder if an error came before anything was written into it."""
    fresh = not out.exists()
    try:
        yield
    except GranbenchError:
        if fresh:
            with suppress(OSError):
                out.rmdir()
        raise


def _seconds(budget: float) -> float:
    seconds = budget * SECONDS_PER_MINUTE
    if not 0.0 < seconds < math.inf:
        raise ConfigurationError(f"--budget must be a number of minutes above 0, not {budget:g}")
    return seconds


def _losses(report: "EpochReport") -> str:
    if math.isnan(report.validation_loss):  # a fit, which uses the validation split at its end
        return f"iteration {report.epoch}, training {report.training_loss:.2e}"
    return (
        f"epoch {report.epoch}, validation {report.validation_loss:.2e}, "
        f"best {report.best_loss:.2e}"
    )
