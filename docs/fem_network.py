"""Tables and figures of the part of docs/fem.md on trained networks in the problems.

The networks are those of the leaderboard, with one folder for each seed.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from page_parts import table

from granbench.cells import MaterialCell
from granbench.cells.find import find_cells
from granbench.fem import Problem, find_problem, run
from granbench.leaderboard.board import default_folder
from granbench.models import MODELS
from granbench.plotting.style import LINE_STYLES, figure_grid, house_style, model_styles


@dataclass(frozen=True)
class Exhibit:
    """A network of the leaderboard that takes the place of the model that made its data.

    Parameters
    ----------
    task : task that it was trained on
    truth : the model that made the data
    network : its name on the leaderboard
    problems : problem and mesh of each analysis, by name
    """

    task: str
    truth: str
    network: str
    problems: Mapping[str, tuple[Problem, str]]

    def networks(self) -> dict[str, MaterialCell]:
        """The networks by their seeds."""
        folders = (default_folder() / self.task / f"{self.network}.model").iterdir()
        return {
            folder.name: find_cells(str(folder)).cell
            for folder in sorted(folders, key=lambda folder: int(folder.name))
        }


CONFINEMENT = 1e5
"""Confining stress in Pa, in the middle of the range of `fem-ime`."""

EXHIBITS: Mapping[str, Exhibit] = {
    "network": Exhibit(
        "gp-j2",
        "j2",
        "gru",
        {
            "biaxial": (find_problem("biaxial"), "medium"),
            "strip-footing": (find_problem("strip-footing"), "coarse"),
        },
    ),
    "network-fem-ime": Exhibit(
        "fem-ime",
        "ime",
        "gru-change",
        {
            "biaxial": (find_problem("biaxial", confinement=CONFINEMENT), "medium"),
            "retaining-wall": (
                find_problem("retaining-wall", confinement=CONFINEMENT, end_strain=0.05),
                "coarse",
            ),
        },
    ),
}
"""Exhibits by the name of their part of the page."""

SOLVERS = ("implicit", "explicit")

Runs = Mapping[tuple[str, str], Mapping[str, xr.Dataset]]
"""Analyses with the ground truth and with each seed, by problem and solver."""


def analyses(exhibit: Exhibit) -> Runs:
    """Every problem with both solvers, with the ground truth and with every network."""
    truth: dict[str, MaterialCell] = {exhibit.truth: MODELS[exhibit.truth]()}
    cells = truth | exhibit.networks()
    return {
        (name, solver): {
            label: run(problem, cell, solver=solver, mesh=mesh).dataset
            for label, cell in cells.items()
        }
        for name, (problem, mesh) in exhibit.problems.items()
        for solver in SOLVERS
    }


def network_part(exhibit: Exhibit, found: Runs) -> str:
    """Table of the errors of reaction and volumetric strain with the networks."""
    rows = []
    for (problem, solver), runs in found.items():
        truth = runs[exhibit.truth]
        row = [f"`{problem}`", solver, f"{float(truth['reaction'][-1]) / 1e3:.4g}"]
        for label, analysis in runs.items():
            if label == exhibit.truth:
                continue
            if not analysis.attrs["completed"]:
                row.append(
                    f"fails after {analysis.sizes['step'] - 1} of {truth.sizes['step'] - 1} steps"
                )
                continue
            errors = [
                _percent(_distance(analysis[name], truth[name]))
                for name in ("reaction", "volumetric_strain")
            ]
            row.append(", ".join(errors))
        rows.append(row)
    seeds = [f"seed {label}" for label in next(iter(found.values())) if label != exhibit.truth]
    return table(("problem", "solver", f"reaction with `{exhibit.truth}`, kN/m", *seeds), rows)


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %" if share >= 0.1 else f"{100.0 * share:.2g} %"


def _distance(series: xr.DataArray, truth: xr.DataArray) -> float:
    """Relative L2 distance of two curves with the same steps."""
    return float(np.linalg.norm(series.values - truth.values) / np.linalg.norm(truth.values))


@house_style
def network_figure(exhibit: Exhibit, found: Runs) -> Figure:
    """Reaction against driving strain: dots for the truth, a different line style for each seed."""
    figure, axes = figure_grid(len(exhibit.problems), len(SOLVERS), panel=(3.6, 2.6))
    colour = model_styles([exhibit.network])[exhibit.network].colour
    seeds = [label for label in next(iter(found.values())) if label != exhibit.truth]
    dashes = dict(zip(seeds, LINE_STYLES, strict=False))
    for axis, ((problem, solver), runs) in zip(axes, found.items(), strict=True):
        for label, analysis in runs.items():
            strain = 100.0 * analysis["driving_strain"].values
            reaction = analysis["reaction"].values / 1e3
            if label == exhibit.truth:
                axis.plot(strain[::4], reaction[::4], ".", color="0.25", markersize=4, label=label)
                continue
            named = f"{exhibit.network}, seed {label}"
            axis.plot(strain, reaction, color=colour, linestyle=dashes[label], label=named)
        axis.set_title(f"{problem}, {solver}", fontsize=9)
        axis.set(xlabel="driving strain [%]", ylabel="reaction [kN/m]")
    axes[0].legend()
    return figure
