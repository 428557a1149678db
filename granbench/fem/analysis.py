"""One way in: a problem, a cell and a solver make an analysis."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from contextlib import nullcontext, redirect_stdout
from dataclasses import asdict

import torch

from granbench.cells.check import checked_cell, spread_rows
from granbench.cells.contract import MaterialCell
from granbench.errors import AnalysisError, ConfigurationError
from granbench.fem.assembled_loading import AssembledLoading, assemble_loading
from granbench.fem.cell_failure import CellFailure
from granbench.fem.explicit import OnStep, solve_explicit
from granbench.fem.gauss_points import GaussPoints, MaterialFailure
from granbench.fem.implicit import solve_implicit
from granbench.fem.implicit_settings import ImplicitSettings
from granbench.fem.mesh import Floats, PlaneMesh
from granbench.fem.operators import ORDER, Operators, build_operators
from granbench.fem.problems import Problem, find_problem
from granbench.fem.remarks import remarks
from granbench.fem.result import Analysis, Recorder
from granbench.fem.statement import SOLVERS
from granbench.fem.time_step import ExplicitSettings
from granbench.tensors import mean_stress

Settings = ExplicitSettings | ImplicitSettings


def run(
    problem: Problem | str,
    cell: MaterialCell,
    *,
    solver: str | Settings = "explicit",
    mesh: str | PlaneMesh | None = None,
    scalars: Mapping[str, float | Floats] | None = None,
    on_step: OnStep | None = None,
    check: bool = True,
) -> Analysis:
    """Analyse a boundary-value problem with a cell as its material.

    Parameters
    ----------
    problem : a problem, or the name of one with its default choices
    cell : a model in plane components
    solver : explicit or implicit as the problem sets it, or settings of your own
    mesh : name of one of the problem's meshes, or a mesh with the boundaries that it names
    scalars : what the cell may want to know at the start, such as `initial_void_ratio`
    on_step : called at output steps
    check : whether the cell is checked before and after, see `granbench.cells.check`; of one that
        was checked, or whose steps cost much, it may be left out

    Returns
    -------
    Analysis; where the material or the solver fails, the cell raises, or Ctrl-C stops the run, with
    all output so far and the reason in `failure`

    Raises
    ------
    ConfigurationError
        If problem, solver, mesh and cell do not fit each other or are none, or the time step is
        unstable.
    ModelError
        If the cell cannot start so, or does not pass the check.
    """
    if not isinstance(cell, MaterialCell):
        raise ConfigurationError(
            f"an object of type {type(cell).__name__} is not a material; give a MaterialCell, such "
            "as granbench.models.MODELS['j2']() or a ModuleCell of your network"
        )
    if isinstance(problem, str):
        problem = find_problem(problem)
    problem = problem.confined_for(cell)
    settings = solver if not isinstance(solver, str) else settings_for(problem, solver)
    if isinstance(settings, ImplicitSettings):
        settings = settings.suited_to(cell)
    mesh_name = mesh if isinstance(mesh, str) else None if mesh else problem.default_mesh
    if not isinstance(mesh, PlaneMesh):
        mesh = problem.mesh(mesh)
    operators = build_operators(mesh, b_bar=problem.b_bar)
    loading = assemble_loading(problem.loading(mesh), operators, settings.density)
    stress = problem.initial_stress(operators.points, settings.density)
    known = {"initial_mean_stress": mean_stress(stress.T, ORDER), **(scalars or {})}
    points = GaussPoints(cell, stress, operators.points, known)
    recorder = Recorder(operators, points, problem.drive_length)
    checked = checked_cell(cell, points.state[spread_rows(points.count)])
    with checked if check else nullcontext() as passed:
        failure = _solved(operators, loading, points, settings, recorder, on_step)
    attributes = {
        "problem": problem.name,
        "title": problem.title,
        "drive": problem.drive,
        "reaction": problem.reaction,
        "length": problem.length,
        "choices": problem.configuration(),
        "cell": cell.name,
        "solver": "explicit" if isinstance(settings, ExplicitSettings) else "implicit",
        "settings": asdict(settings),
        "mesh": mesh_name or "given",
        "mesh_notes": json.dumps(mesh.notes),
        "completed": int(failure is None),
        "failed_step": failure.step if isinstance(failure, CellFailure | MaterialFailure) else -1,
        "initial_imbalance": points.initial_imbalance,
        "notes": "\n".join(passed.notes) if passed else "",
    }
    dataset = recorder.dataset(attributes)
    if isinstance(failure, AnalysisError):
        failure.args = ("; ".join([str(failure), *remarks(dataset)]),)
    dataset.attrs["failure"] = "" if failure is None else str(failure) or "interrupted"
    return Analysis(dataset, failure)


def _solved(
    operators: Operators,
    loading: AssembledLoading,
    points: GaussPoints,
    settings: Settings,
    recorder: Recorder,
    on_step: OnStep | None,
) -> AnalysisError | KeyboardInterrupt | None:
    """Run the solver; what goes into the recorder stays there when it fails.

    Returns
    -------
    Why it ended early, or None
    """
    parts = (operators, loading, points)
    try:
        # What a model prints is not part of what a command prints.
        with torch.no_grad(), redirect_stdout(sys.stderr):
            if isinstance(settings, ExplicitSettings):
                solve_explicit(*parts, settings, recorder, on_step)
            else:
                solve_implicit(*parts, settings, recorder, on_step)
    except (AnalysisError, KeyboardInterrupt) as reason:
        return reason
    return None


def settings_for(problem: Problem, solver: str) -> Settings:
    """Settings of a solver by its name, as the problem has them.

    Raises
    ------
    ConfigurationError
        If there is no such solver.
    """
    if solver not in SOLVERS:
        raise ConfigurationError(f"unknown solver {solver!r}; there are {' and '.join(SOLVERS)}")
    return problem.explicit() if solver == "explicit" else problem.implicit()
