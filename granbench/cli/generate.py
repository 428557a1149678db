"""`granbench generate`: run, or continue, the campaign that makes a dataset."""

from pathlib import Path
from typing import Annotated

import typer

from granbench.cli.options import core_count, require_folder, seed_option
from granbench.cli.printing import note, print_json, say
from granbench.cli.termination import stopped_by_sigterm
from granbench.errors import EngineError


def generate(
    dataset: Annotated[str, typer.Argument(help="Dataset to generate, such as dem-triaxial.")],
    out: Annotated[Path, typer.Option(help="Folder of the campaign and of the dataset.")],
    preset: Annotated[
        str,
        typer.Option(help="Size of the dataset, such as smoke, core or paper."),
    ] = "smoke",
    workers: Annotated[
        int, typer.Option(min=1, help="Number of jobs that run at the same time on this machine.")
    ] = 1,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler that runs the jobs instead.")
    ] = None,
    seed: Annotated[int, seed_option("Seed of every random choice.")] = 0,
    retry_failed: Annotated[
        bool,
        typer.Option("--retry-failed", help="Also repeat jobs that failed permanently."),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the outcome as JSON.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress bar.")] = False,
) -> None:
    """Generate a dataset; run the same command again to continue one that was interrupted."""
    from granbench.generators.campaign.report import MissingResults
    from granbench.generators.find import find_generator
    from granbench.generators.generator import require_netcdf_name

    generator = find_generator(dataset)
    require_netcdf_name(out)
    require_folder("--out", out)
    if scheduler is None and workers > (cores := core_count()):
        note(f"--workers {workers}: this machine has {cores} cores, so {cores} jobs run at once")
        workers = cores
    try:
        with stopped_by_sigterm():
            path, report = generator.generate(
                dataset,
                preset,
                out,
                seed=seed,
                workers=workers,
                scheduler=scheduler,
                progress="quiet" if quiet or as_json else "bar",
                retry_failed=retry_failed,
            )
    except MissingResults as error:
        if error.permanent and not retry_failed:
            raise EngineError(f"{error}, or try them again with --retry-failed") from error
        raise
    if as_json:
        outcome = {
            "dataset": str(path),
            "done": len(report.done),
            "continued": len(report.skipped),
            "failed": report.failed,
            "damaged": report.damaged,
        }
        print_json(outcome)
        return
    if quiet:
        return
    say(f"{len(report.done)} jobs are done, {len(report.skipped)} of them in earlier runs: {path}")
    for key, reason in report.damaged.items():
        say(f"damaged result, computed again: {key}: {reason}")
    for key, reason in report.failed.items():
        say(f"failed, not in the dataset: {key}: {reason}")
