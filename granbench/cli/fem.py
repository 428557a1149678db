"""`granbench fem`: a boundary-value problem with any model at its Gauss points."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from granbench.cli.drive_options import scalars_at_start
from granbench.cli.fem_summary import output_steps, sentence, summary
from granbench.cli.model_options import named_start_options, one_model
from granbench.cli.options import refuse_overwriting, require_writable
from granbench.cli.pictures import draw_beside_results
from granbench.cli.printing import note, print_json, say
from granbench.cli.progress import progress_bar
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
from granbench.cli.termination import stopped_by_sigterm
from granbench.errors import AnalysisError, ConfigurationError, GranbenchError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from granbench.cells.contract import MaterialCell
    from granbench.fem import Analysis, ExplicitSettings, ImplicitSettings, Problem

MOST_OUTPUTS = 100_000
"""Largest number of output steps; each stores all variables at all Gauss points."""

EXPLICIT_ONLY = ("damping", "safety", "time_step", "modulus")
IMPLICIT_ONLY = ("scheme",)


def fem(
    problem: Annotated[
        str,
        typer.Argument(help="One of {problems}."),
    ],
    cell: Annotated[
        str,
        typer.Option(
            "--cell",
            metavar="MODEL",
            help=MODEL_HELP,
        ),
    ],
    out: Annotated[Path, typer.Option("--out", help="netCDF file (.nc) to write.")],
    solver: Annotated[str, typer.Option("--solver", help="explicit or implicit.")] = "explicit",
    mesh: Annotated[
        str | None,
        typer.Option(
            "--mesh",
            metavar="NAME|FILE",
            help="Mesh of the problem, such as coarse, medium or fine, or a file of Gmsh (.msh), "
            "Abaqus (.inp), VTK (.vtk, .vtu) or Medit (.mesh).",
        ),
    ] = None,
    choose: Annotated[
        list[str] | None,
        typer.Option(
            "--choose",
            metavar="NAME=VALUE",
            help="Setting of the problem, such as cycles=cyclic, end_strain=0.05, ends=smooth, "
            "confinement=random:3:1 (v_c and seed) or load_path=FILE.csv (time, displacement).",
        ),
    ] = None,
    params: Params = None,
    parameter_set: ParameterSet = None,
    ocr: OverconsolidationRatio = None,
    e0: InitialVoidRatio = None,
    start: InitialScalars = None,
    outputs: Annotated[
        int | None,
        typer.Option(
            "--outputs",
            max=MOST_OUTPUTS,
            help="Number of output steps, or of load steps (implicit); 100 by default.",
        ),
    ] = None,
    damping: Annotated[
        float | None,
        typer.Option(
            "--damping", help="Damping gamma of the explicit solver (Eq 5.9); 1 by default."
        ),
    ] = None,
    time_step: Annotated[
        float | None,
        typer.Option(
            "--time-step",
            metavar="SECONDS",
            help="Time step of the explicit solver; by default from Eq 5.8.",
        ),
    ] = None,
    safety: Annotated[
        float | None,
        typer.Option(
            "--safety",
            help="Safety factor of the explicit time step; 0.2 by default.",
        ),
    ] = None,
    modulus: Annotated[
        str | None,
        typer.Option(
            "--modulus", metavar="PA", help="Modulus for the time step; the model's by default."
        ),
    ] = None,
    scheme: Annotated[
        str | None,
        typer.Option(
            "--scheme", help="Scheme of the implicit solver: newton, restart or initial-stiffness."
        ),
    ] = None,
    task: Annotated[
        str, typer.Option("--task", help="Dataset to which an untrained baseline is fitted.")
    ] = "gp-j2-mini",
    vtu: Annotated[
        Path | None, typer.Option("--vtu", metavar="DIR", help="Folder for a ParaView series.")
    ] = None,
    plot: Plot = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Analyse a boundary-value problem with a model at its Gauss points."""
    _check_targets(out, vtu, plot)
    load_path = next((word[10:] for word in choose or () if word.startswith("load_path=")), None)
    sources = {
        "--mesh": mesh, "--choose load_path": load_path, "--params": params, "--cell": cell,
        "--task": task,
    }  # fmt: skip
    for option, source in sources.items():
        for target in (out, plot):
            if source is not None and target is not None:
                refuse_overwriting(target, option, Path(source))
    from granbench.fem.problems import chosen_from_text
    from granbench.units.quantity_text import pressure_from_text

    chosen = chosen_from_text(problem, choose or ())
    settings = _settings(
        chosen, solver, damping=damping, time_step=time_step, safety=safety,
        modulus=None if modulus is None else pressure_from_text("--modulus ", modulus),
        scheme=scheme, outputs=outputs,
    )  # fmt: skip
    chosen.mesh(mesh)  # refuse an unknown mesh before a model is made

    import torch

    from granbench.fem import run
    from granbench.fem.remarks import remarks

    # With a few hundred points, threads take longer than one thread.
    torch.set_num_threads(1)
    made = one_model(cell, parameter_set, params, task, order="plane").cell
    scalars = scalars_at_start(e0, ocr, start)
    _refuse_unused(scalars, made, chosen)
    with stopped_by_sigterm("to start from the beginning"):
        with progress_bar(f"steps with {made.name}", hidden=quiet or as_json) as bar:
            analysis = run(
                chosen, made, solver=settings, mesh=mesh, scalars=scalars, on_step=bar.move
            )
        analysis.write(out)
        series, plot = _write_pictures(analysis, vtu, plot)
        _end(analysis, out)
    if as_json:
        print_json(summary(analysis, out, series, plot))
    elif not quiet:
        say(sentence(analysis, out))
        for remark in remarks(analysis.dataset):
            say(f"note: {remark}")


def _check_targets(out: Path, vtu: Path | None, plot: Path | None) -> None:
    """Refuse files that cannot be written before anything is computed."""
    if out.suffix != ".nc":
        raise ConfigurationError(
            f"--out {out}: an analysis is written as netCDF; end the name in .nc"
        )
    if out.is_dir():
        raise ConfigurationError(f"--out {out} is a folder; name a file in it")
    require_writable("--out", out)
    if vtu is not None:
        if vtu.exists() and not vtu.is_dir():
            raise ConfigurationError(f"--vtu {vtu} is a file; give a folder for the series")
        require_writable("--vtu", vtu / "series" if vtu.exists() else vtu)
    if plot is not None:
        from granbench.plotting.style import figure_format

        figure_format(plot)
        require_writable("--plot", plot)


def _settings(
    problem: "Problem", solver: str, *, outputs: int | None, **options: Any
) -> "ExplicitSettings | ImplicitSettings":
    """Settings of the solver; options of the other one are refused."""
    from granbench.fem.analysis import settings_for

    settings = settings_for(problem, solver)
    given = {name: value for name, value in options.items() if value is not None}
    foreign = IMPLICIT_ONLY if solver == "explicit" else EXPLICIT_ONLY
    for name in given:
        if name in foreign:
            raise ConfigurationError(
                f"--{name.replace('_', '-')} is not an option of the {solver} solver; leave it out"
            )
    if outputs is not None:
        if outputs < 1:
            raise ConfigurationError(f"--outputs {outputs}: give 1 or more")
        given["outputs" if solver == "explicit" else "steps"] = outputs
    return replace(settings, **given)


def _refuse_unused(scalars: dict[str, float], cell: "MaterialCell", problem: "Problem") -> None:
    """Refuse quantities at the start that the model does not use."""
    from granbench.element_test.start import Start

    if scalars:
        pressure = problem.confined_for(cell).initial_pressure or None
        start = Start(pressure, scalars)
        with named_start_options(start):
            start.state(cell)


def _end(analysis: "Analysis", out: Path) -> None:
    """Raise the failure of an analysis that ended early, and name the file with its output."""
    reason = analysis.failure
    if reason is None:
        return
    reached = output_steps(analysis)
    kept = f"{out} holds only the start"
    if reached > 0:
        last = float(analysis.dataset["driving_strain"][-1])
        kept = f"{out} holds the output up to driving strain {last:.4g} ({reached + 1} steps)"
    if isinstance(reason, AnalysisError):
        raise AnalysisError(f"{reason}; {kept}") from reason
    say(kept, err=True)
    raise reason


def _write_pictures(
    analysis: "Analysis", vtu: Path | None, plot: Path | None
) -> tuple[Path | None, Path | None]:
    """Write the series and the picture, also for a run that ended early.

    Returns
    -------
    index of the series, picture : None if not asked for, or if the run has its start only
    """
    if output_steps(analysis) == 0:
        return None, None
    index = None
    if vtu is not None:
        from granbench.plotting.paraview import write_series

        try:
            index = write_series(analysis.dataset, vtu)
        except GranbenchError as error:
            note(f"{error}. The netCDF file is complete without the series")
    if plot is not None:
        plot = draw_beside_results(plot, lambda: _figure(analysis))
    return index, plot


def _figure(analysis: "Analysis") -> "Figure":
    from granbench.plotting.fem import analysis_figure

    return analysis_figure(analysis.dataset)
