"""`granbench fem`: a boundary-value problem with any model at its Gauss points."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from granbench.cli.drive_options import scalars_at_start
from granbench.cli.model_options import named_start_options, one_model
from granbench.cli.options import refuse_overwriting, require_writable
from granbench.cli.pictures import draw_beside_results
from granbench.cli.printing import note, print_json, say
from granbench.cli.progress import progress_bar
from granbench.cli.termination import stopped_by_sigterm
from granbench.errors import AnalysisError, ConfigurationError, GranbenchError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from granbench.cells.contract import MaterialCell
    from granbench.fem import Analysis, ExplicitSettings, ImplicitSettings, Problem

MOST_OUTPUTS = 100_000
"""Each takes all that is recorded at every Gauss point."""

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
            help="Classical model such as j2 or its parameter file, baseline, folder of a trained "
            "model, or package.module:factory of a cell.",
        ),
    ],
    out: Annotated[Path, typer.Option("--out", help="netCDF file (.nc) to write.")],
    solver: Annotated[str, typer.Option("--solver", help="explicit or implicit.")] = "explicit",
    mesh: Annotated[
        str | None,
        typer.Option(
            "--mesh",
            metavar="NAME|FILE",
            help="coarse, medium, fine, another of the problem, or a file of Gmsh (.msh), Abaqus "
            "(.inp), VTK (.vtk, .vtu) or Medit (.mesh).",
        ),
    ] = None,
    choose: Annotated[
        list[str] | None,
        typer.Option(
            "--choose",
            metavar="NAME=VALUE",
            help="A choice of the problem, as cycles=cyclic, end_strain=0.05, ends=smooth, "
            "confinement=random:3:1 (v_c and seed) or load_path=FILE.csv (time, displacement).",
        ),
    ] = None,
    params: Annotated[
        Path | None, typer.Option("--params", help="Parameters (JSON) as `granbench fit` writes.")
    ] = None,
    parameter_set: Annotated[
        str | None, typer.Option("--set", help="Published parameters of a classical model.")
    ] = None,
    ocr: Annotated[
        float | None, typer.Option("--ocr", help="Overconsolidation ratio at the start.")
    ] = None,
    e0: Annotated[float | None, typer.Option("--e0", help="Void ratio at the start.")] = None,
    start: Annotated[
        list[str] | None,
        typer.Option("--start", metavar="NAME=VALUE", help="Else known, as grading_index=1.06."),
    ] = None,
    outputs: Annotated[
        int | None,
        typer.Option(
            "--outputs", max=MOST_OUTPUTS, help="Output steps; implicit: load steps. 100."
        ),
    ] = None,
    damping: Annotated[
        float | None, typer.Option("--damping", help="gamma of the explicit solver; 1.")
    ] = None,
    time_step: Annotated[
        float | None, typer.Option("--time-step", metavar="SECONDS", help="Explicit; by Eq 5.8.")
    ] = None,
    safety: Annotated[
        float | None, typer.Option("--safety", help="Of the explicit time step; 0.2.")
    ] = None,
    modulus: Annotated[
        str | None,
        typer.Option("--modulus", metavar="PA", help="For the time step, not that of the model."),
    ] = None,
    scheme: Annotated[
        str | None,
        typer.Option("--scheme", help="Implicit: newton, restart or initial-stiffness."),
    ] = None,
    task: Annotated[
        str, typer.Option("--task", help="Dataset that a baseline without training is fitted to.")
    ] = "gp-j2-mini",
    vtu: Annotated[
        Path | None, typer.Option("--vtu", metavar="DIR", help="Folder for a ParaView series.")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Picture to draw as well (.png, .pdf or .svg).")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON instead of a sentence.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Analyse a boundary-value problem with a model, and write all that happened in it."""
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
    chosen.mesh(mesh)  # an unknown one is said before a model is made

    import torch

    from granbench.fem import run
    from granbench.fem.remarks import remarks

    # Threads that wait for each other cost more than they do, at some hundred points.
    torch.set_num_threads(1)
    made = one_model(cell, parameter_set, params, task, order="plane").cell
    scalars = scalars_at_start(e0, ocr, start)
    _refuse_unused(scalars, made, chosen)
    with stopped_by_sigterm("to begin anew"):
        with progress_bar(f"steps with {made.name}", hidden=quiet or as_json) as bar:
            analysis = run(
                chosen, made, solver=settings, mesh=mesh, scalars=scalars, on_step=bar.move
            )
        analysis.write(out)
        series, plot = _write_pictures(analysis, vtu, plot)
        _end(analysis, out)
    if as_json:
        print_json(_summary(analysis, out, series, plot))
    elif not quiet:
        say(_sentence(analysis, out))
        for remark in remarks(analysis.dataset):
            say(f"note: {remark}")


def _check_targets(out: Path, vtu: Path | None, plot: Path | None) -> None:
    """Refuse files that cannot be written before anything is computed."""
    if out.suffix != ".nc":
        raise ConfigurationError(f"--out {out}: an analysis is a netCDF file; end its name in .nc")
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
                f"--{name.replace('_', '-')} is not of the {solver} solver; leave it out"
            )
    if outputs is not None:
        if outputs < 1:
            raise ConfigurationError(f"--outputs {outputs}: give 1 or more")
        given["outputs" if solver == "explicit" else "steps"] = outputs
    return replace(settings, **given)


def _refuse_unused(scalars: dict[str, float], cell: "MaterialCell", problem: "Problem") -> None:
    """Refuse what the model makes no use of: it would be believed to count."""
    from granbench.element_test.start import Start

    if scalars:
        pressure = problem.confined_for(cell).initial_pressure or None
        start = Start(pressure, scalars)
        with named_start_options(start):
            start.state(cell)


def _end(analysis: "Analysis", out: Path) -> None:
    """Say what is kept of an analysis that ended early, and raise why it did."""
    reason = analysis.failure
    if reason is None:
        return
    reached = _output_steps(analysis)
    kept = f"{out} holds the start alone"
    if reached > 0:
        last = float(analysis.dataset["driving_strain"][-1])
        kept = f"{out} holds the output up to driving strain {last:.4g} ({reached + 1} steps)"
    if isinstance(reason, AnalysisError):
        raise AnalysisError(f"{reason}; {kept}") from reason
    say(kept, err=True)
    raise reason


def _output_steps(analysis: "Analysis") -> int:
    """How many output steps were reached after the first."""
    return max(0, analysis.dataset.sizes.get("step", 0) - 1)


def _write_pictures(
    analysis: "Analysis", vtu: Path | None, plot: Path | None
) -> tuple[Path | None, Path | None]:
    """The series and the picture that are asked for, of a run that ended early as well.

    Returns
    -------
    index of the series, picture : None where there is none, as of a run that has nothing but its
        start
    """
    if _output_steps(analysis) == 0:
        return None, None
    index = None
    if vtu is not None:
        from granbench.plotting.paraview import write_series

        try:
            index = write_series(analysis.dataset, vtu)
        except GranbenchError as error:
            note(f"{error}. The results in the netCDF file are complete without the series")
    if plot is not None:
        plot = draw_beside_results(plot, lambda: _figure(analysis))
    return index, plot


def _figure(analysis: "Analysis") -> "Figure":
    from granbench.plotting.fem import analysis_figure

    return analysis_figure(analysis.dataset)


def _summary(
    analysis: "Analysis", out: Path, series: Path | None, plot: Path | None
) -> dict[str, object]:
    """What a program wants to know."""
    from granbench.fem.remarks import first_implausible_step, first_turned_step, remarks

    found = analysis.dataset
    imbalance = float(found.attrs["initial_imbalance"])
    attributes = found.attrs
    last = found.isel(step=-1)
    summary: dict[str, object] = {
        **{name: attributes[name] for name in ("problem", "cell", "solver", "mesh", "element")},
        "choices": json.loads(attributes["choices"]),
        "settings": json.loads(attributes["settings"]),
        "gauss_points": found.sizes["point"],
        "nodes": found.sizes["node"],
        "output_steps": _output_steps(analysis),
        "driving_strain": float(last["driving_strain"]),
        "reaction": float(last["reaction"]),
        "largest_reaction": float(found["reaction"].max()),
        "volumetric_strain": float(last["volumetric_strain"]),
        "energy_error": float(abs(found["energy_error"]).max()),
        "initial_imbalance": imbalance if math.isfinite(imbalance) else None,
        "first_turned_step": first_turned_step(found),
        "first_implausible_step": first_implausible_step(found),
        "turned_elements": int(found["turned_elements"].max()),
        "warnings": remarks(found),
        "cell_seconds": float(last["cell_seconds"]),
        "solver_seconds": float(last["solver_seconds"]),
    }
    if "iterations" in found:
        summary["iterations"] = int(found["iterations"].sum())
    else:
        summary["maximum_acceleration"] = float(found["maximum_acceleration"].max())
    files = {"out": out, "vtu": series, "plot": plot}
    return summary | {name: None if file is None else str(file) for name, file in files.items()}


def _sentence(analysis: "Analysis", out: Path) -> str:
    found = analysis.dataset
    last = found.isel(step=-1)
    cell_seconds = float(last["cell_seconds"])
    seconds = cell_seconds + float(last["solver_seconds"])
    points = f"{found.sizes['point']} Gauss points of {found.attrs['element']} elements"
    return (
        f"{out}: {found.attrs['problem']} with {found.attrs['cell']}, {found.attrs['solver']}, "
        f"{points}, {seconds:.3g} s ({cell_seconds:.3g} s in the model); reaction at the end "
        f"{float(last['reaction']) / 1e3:.4g} kN/m, largest "
        f"{float(found['reaction'].max()) / 1e3:.4g} kN/m; volumetric strain "
        f"{100.0 * float(last['volumetric_strain']):.3g} %"
    )
