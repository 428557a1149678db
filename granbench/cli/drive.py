"""`granbench drive`: drive a model through an element test or along a path from a file."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from granbench.cli.drive_options import DriveRequest, scalars_at_start
from granbench.cli.model_options import one_model
from granbench.cli.options import refuse_overwriting, require_writable
from granbench.cli.pictures import draw_beside_results
from granbench.cli.printing import print_json, say
from granbench.cli.progress import progress_bar, progress_notes, shows_bar
from granbench.cli.shared_options import (
    MODEL_HELP,
    InitialScalars,
    InitialVoidRatio,
    Json,
    OverconsolidationRatio,
    ParameterSet,
    Params,
    Plot,
    Quiet,
)
from granbench.errors import ConfigurationError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from granbench.cells.contract import MaterialCell
    from granbench.element_test.driving import DriveResult

MOST_STEPS = 1_000_000
"""Largest number of steps of a test; its records take several hundred megabytes."""


def drive(
    model: Annotated[
        str,
        typer.Argument(help=MODEL_HELP),
    ],
    out: Annotated[Path, typer.Option("--out", help="CSV or netCDF (.nc) file to write.")],
    path: Annotated[
        Path | None,
        typer.Option(
            "--path",
            help="Path to follow: a table of strains (and stresses), or records in netCDF.",
        ),
    ] = None,
    control: Annotated[
        str | None,
        typer.Option("--control", help="Standard test, such as triaxial-drained or oedometer."),
    ] = None,
    strain: Annotated[
        str | None,
        typer.Option(
            "--strain",
            help="Driving strain at the end, such as 0.2 or 20%; negative for extension; 0.2 by "
            "default.",
        ),
    ] = None,
    turning_points: Annotated[
        str | None,
        typer.Option("--turning-points", help="Driving strains of reversals, such as 0.02,-0.02."),
    ] = None,
    steps: Annotated[
        int | None, typer.Option("--steps", max=MOST_STEPS, help="Number of steps; 200 by default.")
    ] = None,
    b: Annotated[
        float | None,
        typer.Option("--b", help="Intermediate stress ratio of a triaxial test; 0 by default."),
    ] = None,
    params: Params = None,
    parameter_set: ParameterSet = None,
    p0: Annotated[
        str | None,
        typer.Option(
            "--p0",
            metavar="PA",
            help="Isotropic stress at the start, such as 1e5 or 100kPa; 100kPa by default.",
        ),
    ] = None,
    ocr: OverconsolidationRatio = None,
    e0: InitialVoidRatio = None,
    start: InitialScalars = None,
    order: Annotated[
        str | None,
        typer.Option("--order", help="Components of a classical model: principal, plane or full."),
    ] = None,
    task: Annotated[
        str, typer.Option("--task", help="Dataset to which an untrained baseline is fitted.")
    ] = "dem-triaxial-mini",
    tolerance: Annotated[
        float | None,
        typer.Option(
            "--tolerance",
            help="Relative tolerance of held stresses; by default 1e-9, or 1.2e-5 in float32.",
        ),
    ] = None,
    patience: Annotated[
        float,
        typer.Option(
            "--patience", min=0.01, max=1e6, help="Factor on the permitted amount of computation."
        ),
    ] = 1.0,
    plot: Plot = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Run a standard test on a model, or drive it along a path, and write its stresses."""
    from granbench.element_test.driving import WorkLimitError
    from granbench.element_test.driving import drive as drive_cell
    from granbench.element_test.start import Start
    from granbench.units.quantity_text import pressure_from_text

    _check_targets(out, plot)
    for option, file in (("MODEL", Path(model)), ("--path", path), ("--params", params),
                         ("--task", Path(task))):  # fmt: skip
        refuse_overwriting(out, option, file)
    request = DriveRequest(path, control, strain, turning_points, steps, b, order)
    found = one_model(model, parameter_set, params, task)
    pressure = None if p0 is None else pressure_from_text("--p0 ", p0)
    cell, prescribed, state = request.prepared(
        found, Start(pressure, scalars_at_start(e0, ocr, start))
    )
    points = len(prescribed.control.driven)
    if out.suffix == ".csv" and points > 1:
        raise ConfigurationError(
            f"--out {out}: a CSV file holds one path, but {path} has {points}; end its name in .nc"
        )
    configuration = {
        "model": model if ":" in model else Path(model).name,
        "parameters": _parameters(cell),
        "course": control or (path and path.name),
    }
    with _progress(prescribed.control.steps - 1, cell.name, quiet or as_json) as advance:
        try:
            result = drive_cell(
                cell,
                prescribed,
                state,
                configuration=configuration,
                tolerance=tolerance,
                on_step=advance,
                work_factor=patience,
            )
        except WorkLimitError as error:
            raise ConfigurationError(
                f"{error}; --patience {10.0 * patience:g} allows ten times as much"
            ) from error
    _write(result, out)
    if plot is not None:
        plot = draw_beside_results(plot, lambda: _figure(result, cell.name, prescribed.component))
    if as_json:
        print_json(_summary(result, cell, out, plot))
    elif not quiet:
        say(_sentence(result, cell, out))
        for note in result.notes:
            say(f"note: {note}")
        if cell.pressure_dependent and (tension := result.tension()):
            say(f"note: {tension}")


def _figure(result: "DriveResult", name: str, component: str | None) -> "Figure":
    from granbench.plotting.element_test import element_test_figure

    return element_test_figure(result.records, name, component)


def _check_targets(out: Path, plot: Path | None) -> None:
    """Refuse files that cannot be written before anything is computed."""
    from granbench.plotting.style import figure_format

    if out.suffix not in (".csv", ".nc"):
        raise ConfigurationError(f"--out {out}: end its name in .csv or .nc")
    require_writable("--out", out)
    if plot is not None:
        figure_format(plot)
        require_writable("--plot", plot)


def _parameters(cell: "MaterialCell") -> dict[str, float] | None:
    from granbench.models import ClassicalCell

    return cell.values() if isinstance(cell, ClassicalCell) else None


def _write(result: "DriveResult", out: Path) -> None:
    from granbench.element_test.response_files import write_response
    from granbench.records import write_records

    if out.suffix == ".nc":
        write_records(result.records, out)
    else:
        write_response(out, result.order, *result.rows())


def _summary(
    result: "DriveResult", cell: "MaterialCell", out: Path, plot: Path | None
) -> dict[str, object]:
    """Results for programs: files, size, and the end of each path."""
    from granbench.plotting.element_test import path_invariants

    p, q, volumetric = path_invariants(result.records)
    return {
        "model": cell.name,
        "order": cell.order,
        "parameters": _parameters(cell),
        "out": str(out),
        "plot": None if plot is None else str(plot),
        "paths": result.records.sizes["path"],
        "rows": result.records.sizes["step"] - result.added,
        "mean_stress": p[:, -1].tolist(),
        "deviatoric_stress": q[:, -1].tolist(),
        "largest_deviatoric_stress": q.max(axis=1).tolist(),
        "volumetric_strain": volumetric[:, -1].tolist(),
        "most_increments_in_a_step": int(result.test.increments.max()),
    }


def _sentence(result: "DriveResult", cell: "MaterialCell", out: Path) -> str:
    from granbench.plotting.element_test import path_invariants

    sizes = result.records.sizes
    rows = f"{out}: {sizes['step'] - result.added} rows of {cell.name}"
    if sizes["path"] > 1:
        return f"{rows} along each of {sizes['path']} paths"
    (p,), (q,), (volumetric,) = path_invariants(result.records)
    return (
        f"{rows}; at the end p = {p[-1] / 1e3:.4g} kPa, q = {q[-1] / 1e3:.4g} kPa, volumetric "
        f"strain {100.0 * volumetric[-1]:.3g} %; largest q {q.max() / 1e3:.4g} kPa; started at "
        f"p = {p[0] / 1e3:.4g} kPa"
    )


@contextmanager
def _progress(steps: int, name: str, hidden: bool) -> Iterator[Callable[[int], None]]:
    """Show the progress of the paths, with a bar or, without a terminal, with notes."""
    done = 0

    def move(step: int) -> None:
        nonlocal done
        done = step
        bar.move(step)

    with (
        progress_bar(f"driving {name}", steps, hidden=hidden) as bar,
        progress_notes(
            lambda: f"driving {name}: {done} of {steps} steps", hidden or shows_bar(hidden)
        ),
    ):
        yield move
