"""Draw the picture in README.md: generated tests, a score, and a finite-element analysis.

Run ``python docs/first_page_picture.py`` from the root of the checkout; `make docs` does this.
"""

from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from page_parts import write_picture

import granbench.data
from granbench.cells.find import find_cells
from granbench.fem import find_problem, run
from granbench.leaderboard.board import accepted, default_folder
from granbench.plotting.style import (
    LINE_STYLES,
    MODEL_COLOURS,
    TRUTH,
    figure_grid,
    house_style,
    model_styles,
)
from granbench.tensors import deviatoric_stress

PICTURE = Path(__file__).with_name("first_page.png")

TESTS = ("constant-p", 5e5, "fractal-1.5")
"""Loading family, mean stress (Pa) and grading of the particle tests that are shown."""
NETWORKS = ("mlstm", "lstm", "persistence")
"""Models on the leaderboard whose rollouts are shown."""
FITTED, NETWORK = "j2-fitted", "gru-change"
"""Models of the board on `fem-ime` that take the place of the ground truth in an analysis."""
CONFINEMENT = 1e5
"""Confining stress in Pa, in the middle of the range of `fem-ime`."""


@house_style
def first_page_figure() -> Figure:
    """Particle tests, errors of rollouts, and a finite-element analysis, side by side."""
    figure, axes = figure_grid(1, 3, panel=(3.0, 2.7))
    _particle_tests(axes[0])
    _rollout_errors(axes[1])
    _analysis(axes[2])
    return figure


def _particle_tests(axis: Axes) -> None:
    """Deviatoric stress in triaxial compression of one grading, from dense to loose."""
    family, pressure, grading = TESTS
    records = granbench.data.load("dem-triaxial")
    start = records["initial_mean_stress"].values
    chosen = (
        (records["loading_family"].values == family)
        & (records["grading"].values == grading)
        & (abs(start / pressure - 1.0) < 0.05)
        & (records["intermediate_stress_ratio"].values == 0.0)
    )
    tests = records.isel(path=np.flatnonzero(chosen)).sortby("initial_void_ratio")
    for place, colour in zip(_spread(tests, 3), MODEL_COLOURS, strict=False):
        test = tests.isel(path=place)
        strain = 100.0 * test["strain"].sel(component="11")
        stress = deviatoric_stress(test["stress"].values, "principal") / 1e6
        label = f"$e_0$ = {float(test['initial_void_ratio']):.2f}"
        axis.plot(strain[::2], stress[::2], **TRUTH | {"color": colour}, label=label)
    axis.set(xlabel="axial strain [%]", ylabel="deviatoric stress $q$ [MPa]")
    axis.set_title("generate: particle tests")
    axis.legend()


def _spread(tests: xr.Dataset, count: int) -> list[int]:
    return sorted({round(place) for place in np.linspace(0, tests.sizes["path"] - 1, count)})


def _rollout_errors(axis: Axes) -> None:
    """Error of rollouts against the number of steps since the start."""
    rows = {row.submission.name: row.submission for row in accepted(default_folder())
            if row.submission.task == "dem-triaxial"}  # fmt: skip
    styles = model_styles(rows)
    for name in NETWORKS:
        (curve,) = (
            curve
            for curve in rows[name].curves
            if (curve.protocol, curve.split) == ("rollout", "test")
        )
        axis.plot(curve.horizon, curve.value, **styles[name].line(), label=name)
    axis.set(xlabel="steps since the start", ylabel="normalised squared error", yscale="log")
    axis.set_title("score: error along whole paths")
    axis.legend()


def _analysis(axis: Axes) -> None:
    """Reaction of a biaxial test with the ground truth, a fitted model, and a network."""
    problem = find_problem("biaxial", confinement=CONFINEMENT)
    styles = model_styles([FITTED, NETWORK])
    board = default_folder() / "fem-ime"

    def response(model: str) -> tuple[np.ndarray, np.ndarray]:
        cell = find_cells(model, "gp-j2-mini").cell
        found = run(problem, cell, solver="implicit", mesh="medium").dataset
        return 100.0 * found["driving_strain"].values, found["reaction"].values / 1e3

    strain, reaction = response("ime")
    axis.plot(strain[::4], reaction[::4], **TRUTH, label="ime (truth)")
    axis.plot(*response(str(board / f"{FITTED}.model/0")), **styles[FITTED].line(), label=FITTED)
    for seed, dashes in enumerate(LINE_STYLES[:3]):
        line = {"color": styles[NETWORK].colour, "linestyle": dashes}
        response_of_seed = response(str(board / f"{NETWORK}.model" / str(seed)))
        axis.plot(*response_of_seed, **line, label=f"{NETWORK}, seed {seed}")
    axis.set(xlabel="driving strain [%]", ylabel="reaction [kN/m]")
    axis.set_title("use: finite elements, model inside")
    axis.legend()


if __name__ == "__main__":
    write_picture(first_page_figure(), PICTURE)
