"""The job of a `fem-*` campaign: one explicit analysis."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
import xarray as xr
from numpy.typing import ArrayLike

from granbench.errors import AnalysisError
from granbench.fem import run
from granbench.fem.problems.biaxial import HEIGHT, Biaxial
from granbench.fem.stated_problem import build_problem
from granbench.fem.statement import spread_points
from granbench.generators.fem.plan import AnalysisPlan
from granbench.generators.rounding import recorded
from granbench.models.ground_truth import recording_cell

RECORD_FILE = "record.npz"
PERMANENT_FAILURES = (AnalysisError,)
POSITION = ("position_x", "position_y")
POINT = "point"
"""Array of the numbers of the Gauss points in the file; it is not a variable of the dataset."""


def run_analysis(
    configuration: Mapping[str, Any], seed: int, inputs: Mapping[str, Path], out: Path
) -> None:
    """Write the histories of some Gauss points of an explicit analysis, rounded.

    Parameters
    ----------
    configuration : of the job, see `granbench.generators.fem.generator.jobs`
    seed, inputs : not used; the seed of the confining pressure is in the configuration
    out : folder for the file

    Raises
    ------
    AnalysisError
        If the analysis fails before its end.
    """
    plan = AnalysisPlan.model_validate(configuration["plan"])
    cell = recording_cell(configuration["model"], configuration["parameters"])
    problem = build_problem(plan)
    # All paths of a dataset have the same number of steps, wherever a loading turns.
    settings = replace(problem.explicit(), outputs=configuration["steps"], turning_points=False)
    # At some hundred points, several threads would cost more than they save.
    torch.set_num_threads(1)
    histories = run(problem, cell, solver=settings, mesh=plan.mesh).check()
    points = different_points(plan, histories["point_position"].values)
    points = points[spread_points(len(points), min(plan.points, len(points)))]
    record = records_of(histories.isel(point=points), cell.internals)
    # mypy matches the names with savez's own allow_pickle.
    np.savez(out / RECORD_FILE, point=points, **record)  # type: ignore[arg-type]


def different_points(plan: AnalysisPlan, positions: np.ndarray) -> np.ndarray:
    """Numbers of the Gauss points whose histories do not repeat those of another point.

    A biaxial test is symmetric under half a turn, which does not change plane tensors: the points
    of its upper half repeat those of its lower half. Its left and right halves differ in the sign
    of the shear.

    Parameters
    ----------
    plan : the analysis
    positions : (point, direction), m
    """
    if plan.problem != Biaxial.name:
        return np.arange(len(positions))
    return np.flatnonzero(positions[:, 1] < 0.5 * HEIGHT)


def records_of(histories: xr.Dataset, internals: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Histories under their dataset names, rounded, (path, step, ...); a path is a Gauss point.

    Parameters
    ----------
    histories : of some Gauss points
    internals : names of the internal variables among them

    Returns
    -------
    The series, and the positions of the points, (path,), m
    """
    series: dict[str, ArrayLike] = {
        name: histories[name].transpose("point", "step", ...).values
        for name in ("strain", "stress", *internals)
    }
    x, y = histories["point_position"].transpose("direction", "point").values
    return {
        **{name: recorded(name, values) for name, values in series.items()},
        **dict(zip(POSITION, (x, y), strict=True)),
    }
