"""Response of a model in an element test: strength, volume and stress path."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from granbench.plotting.style import figure_grid, house_style, model_styles
from granbench.tensors import (
    component_order,
    deviatoric_stress,
    full_components,
    mean_stress,
    volumetric_strain,
)

MOST_CURVES = 12
"""Paths that are drawn; of more, as many spread evenly over the file."""


def path_invariants(
    answer: xr.Dataset,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Mean stress, deviatoric stress and volumetric strain of records.

    Where plane records carry `out_of_plane_stress`, the stress is three-dimensional: p = tr/3.

    Parameters
    ----------
    answer : records, or what has their `strain`, `stress` and `component`

    Returns
    -------
    p, q (path, step), Pa; volumetric strain (path, step), compression positive
    """
    order = component_order(answer["component"].values)
    stress = answer["stress"].values.astype(np.float64)
    strain = answer["strain"].values.astype(np.float64)
    stress_order = order
    if order == "plane" and "out_of_plane_stress" in answer:
        zz = answer["out_of_plane_stress"].values.astype(np.float64)
        stress, stress_order = full_components(stress, zz), "full"
    return (
        mean_stress(stress, stress_order),
        deviatoric_stress(stress, stress_order),
        volumetric_strain(strain, order),
    )


@house_style
def element_test_figure(answer: xr.Dataset, name: str, component: str | None = None) -> Figure:
    """q and volumetric strain against a strain, and q against p.

    Parameters
    ----------
    answer : records of the paths; of many, a dozen are drawn
    name : of the model, which gives the line its colour
    component : label of the strain on the abscissa; the one that goes furthest by default
    """
    rows = np.linspace(0, answer.sizes["path"] - 1, min(MOST_CURVES, answer.sizes["path"]))
    answer = answer.isel(path=rows.round().astype(int))
    labels = [str(label) for label in answer["component"].values]
    if component is None:
        component = labels[int(np.abs(answer["strain"].values).max(axis=(0, 1)).argmax())]
    strain = 100.0 * answer["strain"].values[..., labels.index(component)]
    p, q, volumetric = path_invariants(answer)
    figure, (strength, volume, stress_path) = figure_grid(1, 3, panel=(3.2, 2.7))
    line = model_styles([name])[name].line()
    for path in range(answer.sizes["path"]):
        strength.plot(strain[path], q[path] / 1e3, **line)
        volume.plot(strain[path], 100.0 * volumetric[path], **line)
        stress_path.plot(p[path] / 1e3, q[path] / 1e3, **line)
    abscissa = rf"strain $\varepsilon_{{{component}}}$ [%]"
    strength.set(xlabel=abscissa, ylabel="deviatoric stress $q$ [kPa]")
    volume.set(xlabel=abscissa, ylabel=r"volumetric strain $\varepsilon_v$ [%]")
    stress_path.set(xlabel="mean stress $p$ [kPa]", ylabel="deviatoric stress $q$ [kPa]")
    figure.suptitle(name)
    return figure
