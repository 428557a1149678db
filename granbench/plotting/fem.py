"""Figures of finite-element analyses: curves, and the deformed body."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from granbench.fem.remarks import first_implausible_step, first_turned_step
from granbench.plotting.paraview import element_means
from granbench.plotting.style import figure_grid, house_style, model_styles
from granbench.tensors import principal_difference

SHADES = "cividis"
"""Colour map whose lightness rises evenly, readable in grey."""

SLENDER = 0.3
"""Width over height below which only the middle gets a tick."""

EDGE: dict[str, Any] = {"edgecolor": "0.35", "linewidth": 0.3}


@house_style
def analysis_figure(dataset: xr.Dataset) -> Figure:
    """Reaction, volumetric strain and effort against the driving strain, and the body at the end.

    Effort is the largest nodal acceleration since the last output (explicit), or the iterations of
    each load step (implicit). A dotted line marks the strain from which elements have turned over.

    Parameters
    ----------
    dataset : of an analysis, finished or not
    """
    name = str(dataset.attrs["cell"])
    line = model_styles([name])[name].line()
    strain = 100.0 * dataset["driving_strain"].values
    figure, (force, volume, effort, body) = figure_grid(2, 2)
    force.plot(strain, dataset["reaction"].values / 1e3, **line)
    force.set_ylabel("reaction [kN/m]")
    volume.plot(strain, 100.0 * dataset["volumetric_strain"].values, **line)
    volume.set_ylabel(r"volumetric strain $\varepsilon_v$ [%]")
    if "iterations" in dataset:
        effort.plot(strain, dataset["iterations"].values, **line)
        effort.set_ylabel("iterations [–]")
    else:
        # Nothing has moved yet at the first step.
        effort.semilogy(strain[1:], dataset["maximum_acceleration"].values[1:], **line)
        effort.set_ylabel(r"largest acceleration [m/s$^2$]")
    turned = first_turned_step(dataset)
    for axis in (force, volume, effort):
        axis.set_xlabel("driving strain [%]")
        if turned is not None:
            axis.axvline(strain[turned], color="0.35", linestyle=":")
    draw_body(body, dataset)
    title = f"{dataset.attrs['title']}: {name}, {dataset.attrs['solver']}"
    if not dataset.attrs["completed"]:
        title += " (ended early)"
    if turned is not None:
        title += f"\ndotted: elements have turned over, from {strain[turned]:.3g} % on"
    if (step := first_implausible_step(dataset)) is not None:
        title += f"\nvolumetric strains are not credible from {strain[step]:.3g} % on"
    figure.suptitle(title)
    return figure


def draw_body(axis: Axes, dataset: xr.Dataset, step: int = -1, *, bar: bool = True) -> None:
    """The deformed body, to scale; its elements are shaded by their shear strain.

    Parameters
    ----------
    axis : to draw on
    dataset : of an analysis
    step : output step
    bar : whether a colour bar is drawn
    """
    shear = principal_difference(element_means(dataset.isel(step=[step]), "strain")[0])
    faces = PolyCollection(list(outlines(dataset, step)), array=100.0 * shear, cmap=SHADES, **EDGE)
    axis.add_collection(faces)
    axis.autoscale()
    axis.set(aspect="equal", xlabel="$x$ [m]", ylabel="$y$ [m]")
    tame_ticks(axis, dataset["node_position"].values)
    if bar and axis.figure is not None:
        axis.figure.colorbar(faces, ax=axis, label=r"$\varepsilon_1 - \varepsilon_3$ [%]")


def tame_ticks(axis: Axes, nodes: NDArray[np.float64]) -> None:
    """No grid over a body, and so few ticks that those of a slender one do not overlap.

    Parameters
    ----------
    axis : on which a body is drawn to scale
    nodes : of the body, (node, direction), m
    """
    axis.grid(visible=False)
    axis.locator_params(axis="x", nbins=3)
    width, height = np.ptp(nodes, axis=0)
    if width < SLENDER * height:
        axis.set_xticks([0.0])


def outlines(dataset: xr.Dataset, step: int = -1) -> NDArray[np.float64]:
    """Corners of the deformed elements, (element, corner, direction), m."""
    nodes = dataset["node_position"].values + dataset["displacement"].values[step]
    corners = 3 if str(dataset.attrs["element"]).startswith("tri") else 4
    return np.asarray(nodes[dataset["element_nodes"].values[:, :corners]])
