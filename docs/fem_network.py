"""The part of docs/fem.md on a trained network inside the problems: its table and its figure.

The networks are those of the board: `gru` on `gp-j2`, a folder a seed.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from page_parts import table

from granbench.cell import MaterialCell
from granbench.driven_model import ModelChoice
from granbench.fem import find_problem, run
from granbench.leaderboard.board import default_folder
from granbench.models import MODELS
from granbench.plotting.style import figure_grid, house_style, model_styles

TRUTH, NETWORK, TASK = "j2", "gru", "gp-j2"
SHOWN = {"biaxial": "medium", "strip-footing": "coarse"}
"""Problem and mesh."""

SOLVERS = ("implicit", "explicit")

Runs = Mapping[tuple[str, str], Mapping[str, xr.Dataset]]
"""By problem and solver: the analysis with the ground truth, and that with each seed."""


def networks() -> dict[str, MaterialCell]:
    """The networks of the board by their seeds."""
    folders = sorted((default_folder() / TASK / f"{NETWORK}.model").iterdir(), key=_number)
    return {folder.name: ModelChoice(str(folder)).cell("plane") for folder in folders}


def _number(folder: Path) -> int:
    return int(folder.name)


def analyses() -> Runs:
    """Both problems with both solvers, with the ground truth and with every network."""
    cells: dict[str, MaterialCell] = {TRUTH: MODELS[TRUTH](), **networks()}
    return {
        (name, solver): {
            label: run(find_problem(name), cell, solver=solver, mesh=mesh).dataset
            for label, cell in cells.items()
        }
        for name, mesh in SHOWN.items()
        for solver in SOLVERS
    }


def network_part(found: Runs) -> str:
    """How far reaction and volumetric strain of the networks are from those of the truth."""
    rows = []
    for (problem, solver), runs in found.items():
        truth = runs[TRUTH]
        row = [f"`{problem}`", solver, f"{float(truth['reaction'][-1]) / 1e3:.4g}"]
        for label, analysis in runs.items():
            if label == TRUTH:
                continue
            if not analysis.attrs["completed"]:
                row.append(f"fails at step {analysis.attrs['failed_step']}")
                continue
            errors = [
                _percent(_distance(analysis[name], truth[name]))
                for name in ("reaction", "volumetric_strain")
            ]
            row.append(", ".join(errors))
        rows.append(row)
    seeds = [f"seed {label}" for label in next(iter(found.values())) if label != TRUTH]
    return table(("problem", "solver", "reaction with `j2`, kN/m", *seeds), rows)


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %" if share >= 0.1 else f"{100.0 * share:.2g} %"


def _distance(series: xr.DataArray, truth: xr.DataArray) -> float:
    """Relative L2 distance of two curves with the same steps."""
    return float(np.linalg.norm(series.values - truth.values) / np.linalg.norm(truth.values))


@house_style
def network_figure(found: Runs) -> Figure:
    """Reaction against driving strain: the truth as dots, a line for each seed."""
    figure, axes = figure_grid(len(SHOWN), len(SOLVERS), panel=(3.6, 2.6))
    style = model_styles([NETWORK])[NETWORK]
    for axis, ((problem, solver), runs) in zip(axes, found.items(), strict=True):
        for label, analysis in runs.items():
            strain = 100.0 * analysis["driving_strain"].values
            reaction = analysis["reaction"].values / 1e3
            if label == TRUTH:
                axis.plot(strain[::4], reaction[::4], ".", color="0.25", markersize=4, label=TRUTH)
            else:
                axis.plot(strain, reaction, **style.line(), alpha=0.8)
        axis.set_title(f"{problem}, {solver}", fontsize=9)
        axis.set(xlabel="driving strain [%]", ylabel="reaction [kN/m]")
    axes[0].plot([], [], **style.line(), label=f"{NETWORK}, each seed")
    axes[0].legend()
    return figure
