"""Boundary-value problems with a model, and with the ground truth, at every Gauss point.

Each analysis of the task is made with the model and, in the same way, with the ground truth: the
same mesh, loading, output steps and explicit time step, which follows from the ground truth's
stiffness. `granbench.benchmark.axes.embedded.analysis_errors` compares the two.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import torch
import xarray as xr

from granbench.benchmark.axes.embedded.timed_cell import TimedCell
from granbench.benchmark.scored_task import ScoredTask
from granbench.cells.check import POINTS
from granbench.cells.contract import Conditions, MaterialCell
from granbench.errors import ConfigurationError
from granbench.fem import ExplicitSettings, ImplicitSettings, run
from granbench.fem.analysis import settings_for
from granbench.fem.cell_failure import CellFailure
from granbench.fem.stated_problem import build_problem
from granbench.fem.statement import SOLVERS, EmbeddedAnalysis, spread_points
from granbench.models.classical import ClassicalCell
from granbench.models.isotropic_start import internals_at_start
from granbench.tensors import COMPONENT_ORDERS

ORDER = "plane"

UPDATES = 60
"""Calls of a model in an implicit analysis over the number of its load steps, beyond which it is
given up. Classical models need two to four."""

CUTS = 4
"""Number of times a load step may be halved; a model that needs more has failed in it."""

CURVES = {
    "reaction": "reaction",
    "volumetric_strain": "volumetric_strain",
    "acceleration": "maximum_acceleration",
}
"""What is kept of every output step, and what an analysis calls it."""

TIMES = ("seconds", "cell_seconds")
FAILURE = "failure"

REPEATS = 3
"""Number of runs of an analysis for its time."""

REPEAT_SECONDS = 2.0
"""CPU time of the runs of an analysis, s, after which it is not repeated."""


def analysis_start(cell: MaterialCell, task: ScoredTask) -> Conditions:
    """What is known of a few Gauss points where the first analysis of a task begins."""
    pressure = task.analyses[0].confinement
    start = internals_at_start(task.require_ground_truth(), pressure)
    scalars = {"initial_mean_stress": pressure, **start}
    stress = torch.tensor([[pressure, pressure, 0.0]] * POINTS, dtype=cell.dtype)
    known = {
        name: torch.full((POINTS,), value, dtype=cell.dtype) for name, value in scalars.items()
    }
    return Conditions(stress, known)


def embedded(cell: MaterialCell, task: ScoredTask) -> xr.Dataset:
    """Every analysis of a task, with a model.

    Parameters
    ----------
    cell : the model, in plane components
    task : its `analyses` are made

    Returns
    -------
    Dataset over `solver` and `analysis`: `embedded_reaction`, `embedded_volumetric_strain` and
    `embedded_acceleration` (.., output), `embedded_stress` (.., output, gauss_point, component),
    NaN from where an analysis failed; `embedded_seconds` and `embedded_cell_seconds`, CPU time of
    the fastest run; and `failure`, why it ended early, "" where it did not
    """
    return _every_analysis(cell, task, "embedded_")


def embedded_truth(task: ScoredTask) -> xr.Dataset:
    """Every analysis of a task, with the ground truth: as `embedded`, named `embedded_truth_...`.

    Raises
    ------
    DatasetError
        If no model made the records.
    """
    found = _every_analysis(task.require_ground_truth(), task, "embedded_truth_")
    return found.drop_vars(FAILURE)


def _every_analysis(cell: MaterialCell, task: ScoredTask, prefix: str) -> xr.Dataset:
    truth, analyses = task.require_ground_truth(), task.analyses
    with _one_thread():
        _warm_up(cell, analyses[0], truth)
        by_solver = [
            xr.concat([_timed(cell, each, solver, truth) for each in analyses], "analysis")
            for solver in SOLVERS
        ]
    found = xr.concat(by_solver, "solver").transpose("solver", "analysis", ...)
    found = found.assign_coords(
        solver=np.array(SOLVERS, dtype=object),
        analysis=np.array([each.name for each in analyses], dtype=object),
        output=np.arange(found.sizes["output"]),
        gauss_point=np.arange(found.sizes["gauss_point"]),
        component=np.array(task.components, dtype=object),
    )
    return found.rename({name: f"{prefix}{name}" for name in found.data_vars if name != FAILURE})


def _timed(
    cell: MaterialCell, analysis: EmbeddedAnalysis, solver: str, truth: ClassicalCell
) -> xr.Dataset:
    """One analysis, with the CPU times of its fastest run: other work on a machine only adds."""
    if solver not in analysis.solvers:
        return _without_outputs(analysis)
    runs = [_analysed(cell, analysis, solver, truth)]
    while len(runs) < REPEATS and sum(float(run["seconds"]) for run in runs) < REPEAT_SECONDS:
        runs.append(_analysed(cell, analysis, solver, truth))
    fastest = {name: min(float(run[name]) for run in runs) for name in TIMES}
    return runs[0].assign(fastest)


def _analysed(
    cell: MaterialCell, analysis: EmbeddedAnalysis, solver: str, truth: ClassicalCell
) -> xr.Dataset:
    """What is kept of one analysis, see `embedded`."""
    problem = build_problem(analysis)
    settings = settings_for(problem, solver)
    if isinstance(settings, ExplicitSettings):
        # The stated number of outputs, so that all analyses of a dataset have one shape.
        settings = replace(
            settings, outputs=analysis.outputs, modulus=analysis.modulus, turning_points=False
        )
    else:
        settings = replace(settings, steps=analysis.outputs, cuts=CUTS)
    limit = UPDATES * analysis.outputs if isinstance(settings, ImplicitSettings) else None
    metered = TimedCell(cell, limit)
    start = internals_at_start(truth, analysis.confinement)
    begin = time.process_time()
    # The cell was checked before; a check here would count as calls and time of the analysis.
    result = run(problem, metered, solver=settings, mesh=analysis.mesh, scalars=start, check=False)
    seconds = time.process_time() - begin
    if isinstance(result.failure, KeyboardInterrupt):
        raise result.failure
    if isinstance(result.failure, CellFailure):  # a mistake in a program is no score
        raise result.failure.__cause__ or result.failure
    found, kept = result.dataset, _without_outputs(analysis)
    reached = found.sizes.get("step", 0)
    if reached > kept.sizes["output"]:
        raise ConfigurationError(
            f"{analysis.name}: the {solver} analysis has {reached - 1} steps, not "
            f"{analysis.outputs}; choose a number that its turning points divide"
        )
    for name, variable in CURVES.items():
        if variable in found:
            kept[name][:reached] = found[variable].values
    if reached:
        chosen = spread_points(found.sizes["point"], analysis.points)
        kept["stress"][:reached] = found["stress"].values[:, chosen]
    return kept.assign(
        seconds=seconds,
        cell_seconds=metered.seconds,
        failure="" if result.failure is None else str(result.failure),
    )


def _without_outputs(analysis: EmbeddedAnalysis) -> xr.Dataset:
    """What is kept of an analysis that has reached no output step."""
    outputs, components = analysis.outputs + 1, len(COMPONENT_ORDERS[ORDER])
    stress = np.full((outputs, analysis.points, components), np.nan)
    return xr.Dataset(
        {name: ("output", np.full(outputs, np.nan)) for name in CURVES}
        | {"stress": (("output", "gauss_point", "component"), stress)}
        | dict.fromkeys(TIMES, np.nan)
        | {FAILURE: ""}
    )


def _warm_up(cell: MaterialCell, analysis: EmbeddedAnalysis, truth: ClassicalCell) -> None:
    """What libraries do once, before anything is timed."""
    problem = replace(build_problem(analysis), end_strain=1e-6)
    start = internals_at_start(truth, analysis.confinement)
    explicit = replace(problem.explicit(), outputs=1, modulus=analysis.modulus)
    for settings in (explicit, replace(problem.implicit(), steps=1, cuts=0)):
        run(
            problem, TimedCell(cell), solver=settings, mesh=analysis.mesh, scalars=start,
            check=False,
        )  # fmt: skip


@contextmanager
def _one_thread() -> Iterator[None]:
    """At some hundred points, threads that wait for each other cost more than they do."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
