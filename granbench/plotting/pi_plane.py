"""Strength in the deviatoric (pi) plane."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from granbench.plotting.dataset import require_paths
from granbench.plotting.style import figure_grid, house_style, ordered_colours
from granbench.records.observations import (
    critical_states,
    matsuoka_nakai_ratio,
    peak_stresses,
    principal_stress,
    select,
)
from granbench.tensors import deviatoric_stress, mean_stress, pi_plane


@house_style
def pi_plane_figure(records: xr.Dataset) -> Figure:
    """Peak and critical stresses in the deviatoric plane, divided by p, by b.

    The line is the Matsuoka-Nakai surface through the median critical state of triaxial
    compression.

    Raises
    ------
    DatasetError
        If there is no monotonic test.
    """
    peaks = peak_stresses(records)
    require_paths(peaks, records, "monotonic tests")
    states = critical_states(records)
    figure, axes = figure_grid(1, 2, share_x=True, share_y=True)
    _, scale = ordered_colours(np.array([0.0, 1.0]))
    panels = zip(axes, (peaks, states["stress"]), ("Peak", "Critical state"), strict=True)
    for axis, stress, title in panels:
        if stress.sizes["path"]:
            x, y = pi_plane(stress.values / mean_stress(stress.values)[..., None])
            axis.scatter(x, y, s=9, color=scale.to_rgba(stress["intermediate_stress_ratio"].values))
        _draw_sextant(axis)
        axis.set(title=title, xlabel=r"$(\sigma_{22}-\sigma_{33})/(\sqrt{2}\,p)$ [–]")
        axis.set_aspect("equal")
    axes[0].set_ylabel(r"$(2\sigma_{11}-\sigma_{22}-\sigma_{33})/(\sqrt{6}\,p)$ [–]")
    compression = select(states, intermediate_stress_ratio=0.0)["stress"].values
    if len(compression):
        ratio = float(np.median(deviatoric_stress(compression) / mean_stress(compression)))
        b = np.linspace(0.0, 1.0, 60)
        x, y = pi_plane(principal_stress(b, matsuoka_nakai_ratio(b, ratio)))
        for axis in axes:
            axis.plot(x, y, color="0.4", linewidth=1.0, label="Matsuoka–Nakai, critical")
        axes[0].legend(loc="lower right")
    figure.colorbar(scale, ax=axes, label="intermediate stress ratio $b$ [–]")
    return figure


def _draw_sextant(axis: Axes) -> None:
    """Axes of triaxial compression and extension, and circles of equal q/p."""
    reach = 1.35
    angle = np.linspace(np.pi / 6, np.pi / 2, 40)
    for ratio in (0.4, 0.8, 1.2):
        radius = np.sqrt(2.0 / 3.0) * ratio
        axis.plot(
            radius * np.cos(angle), radius * np.sin(angle), color="0.85", linewidth=0.7, zorder=0
        )
        axis.annotate(
            f"$q/p$ = {ratio}",
            (0.0, radius),
            xytext=(-3, 0),
            textcoords="offset points",
            ha="right",
            va="center",
            fontsize=7,
            color="0.4",
        )
    for direction in (np.pi / 2, np.pi / 6):
        axis.plot(
            [0.0, reach * np.cos(direction)],
            [0.0, reach * np.sin(direction)],
            color="0.6",
            linewidth=0.8,
            zorder=0,
        )
    axis.set(xlim=(-0.35, 1.15), ylim=(-0.05, 1.35))
    axis.grid(False)
