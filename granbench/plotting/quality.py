"""Quality of control of the tests of a dataset: servo, stress ratio, inertia."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from granbench.errors import DatasetError
from granbench.plotting.style import figure_grid, house_style

QUALITY_LIMITS = {
    "servo_error_rms": 0.01,
    "stress_ratio_error_rms": 0.02,
    "peak_inertial_number": 2.5e-3,
}
"""Limits that every path of `dem-triaxial` meets; the generator enforces them."""

_LABELS = {
    "servo_error_rms": ("RMS error of the held stress [%]", 100.0),
    "stress_ratio_error_rms": ("RMS error of $b$ [–]", 1.0),
    "peak_inertial_number": ("largest inertial number $I$ [$10^{-3}$]", 1e3),
}


@house_style
def quality_figure(records: xr.Dataset) -> Figure:
    """Share of paths below each value of the three quality measures, with their limits.

    Raises
    ------
    DatasetError
        If the records carry none of the measures.
    """
    measured = [name for name in QUALITY_LIMITS if name in records.coords]
    if not measured:
        raise DatasetError(
            f"{records.attrs.get('dataset', 'the dataset')} records no servo error and no "
            "inertial number; the quality figure needs a DEM dataset"
        )
    figure, axes = figure_grid(1, len(measured), panel=(2.9, 2.7), share_y=True)
    for axis, name in zip(axes, measured, strict=True):
        label, scale = _LABELS[name]
        values = records[name].values
        values = np.sort(values[np.isfinite(values)])
        share = np.arange(1, values.size + 1) / max(1, values.size)
        axis.step(scale * values, 100.0 * share, where="post", color="0.15")
        limit = scale * QUALITY_LIMITS[name]
        axis.axvline(limit, color="0.5", linestyle="--", linewidth=1.0)
        axis.annotate(
            "limit",
            (limit, 4.0),
            xytext=(-3, 0),
            textcoords="offset points",
            ha="right",
            color="0.35",
        )
        axis.set(xlabel=label, xlim=(0.0, None), ylim=(0.0, 101.0))
    axes[0].set_ylabel("paths at or below [%]")
    return figure
