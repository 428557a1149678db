"""Random strain paths before any model is driven along them."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from granbench.errors import DatasetError
from granbench.plotting.style import LINE_STYLES, MODEL_COLOURS, figure_grid, house_style
from granbench.tensors import component_order, frobenius_norm

PANEL = (3.1, 2.4)
BINS = np.geomspace(5e-5, 5e-2, 46)
"""Edges of the histogram: fifteen bins a decade, from rest at a turning point to the steepest."""


@house_style
def random_path_figure(paths: xr.Dataset, shown: Sequence[str]) -> Figure:
    """Strain components of some paths, and the norms of the increments of every split.

    Parameters
    ----------
    paths : `strain` (path, step, component) in the plane, with `path_id` and `split`
    shown : `path_id` of the paths that are drawn, an odd number of them

    Raises
    ------
    DatasetError
        If a path is not there, or the strain not in the plane.
    """
    labels = [str(label) for label in paths["component"].values]
    if component_order(labels) != "plane":
        raise DatasetError("random paths are drawn in the plane; give strains in xx, yy, xy")
    names = [str(name) for name in paths["path_id"].values]
    if missing := [name for name in shown if name not in names]:
        raise DatasetError(f"there is no path {missing[0]!r}; there are {names[0]!r} and others")
    rows = (len(shown) + 2) // 2
    figure, axes = figure_grid(rows, 2, panel=PANEL)
    for axis, name in zip(axes, shown, strict=False):
        strain = 100.0 * paths["strain"].values[names.index(name)]
        time = np.linspace(0.0, 1.0, len(strain))
        for number, label in enumerate(labels):
            axis.plot(
                time,
                strain[:, number],
                color=MODEL_COLOURS[number],
                linestyle=LINE_STYLES[number],
                label=rf"$\varepsilon_{{{label}}}$",
            )
        axis.set(title=name, xlabel="pseudo-time $t$ [–]", ylabel="strain [%]")
    axes[0].legend(handlelength=2.6, labelspacing=0.25)
    for axis in axes[len(shown) + 1 :]:
        axis.remove()
    _increments(axes[len(shown)], paths)
    return figure


def _increments(axis: Axes, paths: xr.Dataset) -> None:
    """Histogram of the norms, one outline a split; each has the same area."""
    of_paths = paths["split"].values.astype(str)
    for number, split in enumerate(dict.fromkeys(of_paths.tolist())):
        strain = paths["strain"].values[of_paths == split]
        norms = frobenius_norm(np.diff(strain, axis=1), "plane").ravel()
        counts, _ = np.histogram(norms, BINS)
        axis.stairs(
            100.0 * counts / norms.size,
            BINS,
            color=MODEL_COLOURS[number % len(MODEL_COLOURS)],
            linestyle=LINE_STYLES[number % len(LINE_STYLES)],
            linewidth=1.2,
            label=split,
        )
    axis.set_xscale("log")
    axis.xaxis.set_major_locator(LogLocator())
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set(
        title="Increments",
        xlabel=r"norm $\|\Delta\varepsilon\|_F$ of an increment [–]",
        ylabel="share of increments [%]",
    )
    axis.legend(fontsize=7.0, handlelength=2.2, labelspacing=0.2)
