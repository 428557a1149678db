"""Figures of drawn strain paths: records in the `plane` order.

What was recorded is drawn as dots; a distribution is a line.
"""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from granbench.errors import DatasetError
from granbench.plotting.style import (
    LINE_STYLES,
    MARKERS,
    MODEL_COLOURS,
    TRUTH,
    figure_grid,
    house_style,
)
from granbench.records.observations import named_paths
from granbench.records.turning_points import shown_rows
from granbench.tensors import (
    component_order,
    deviatoric_stress,
    frobenius_norm,
    full_components,
    mean_stress,
)

DOTS_PER_CURVE = 200
DOTS_PER_CLOUD = 3000


@house_style
def strain_path_figure(records: xr.Dataset, *, paths: Sequence[str] | None = None) -> Figure:
    """Strain and stress components along a few paths, one column a path.

    Parameters
    ----------
    records : stress-strain records in the `plane` order
    paths : names (`path_id`) of the paths to draw; by default the first of the training split
        and of every split out of distribution

    Raises
    ------
    DatasetError
        If the records are not in the plane, or a named path is not among them.
    """
    _require_plane(records)
    chosen = records.isel(path=_first_of_splits(records))
    if paths is not None:
        chosen = named_paths(records, paths)
    count = chosen.sizes["path"]
    figure, axes = figure_grid(2, count, panel=(2.5, 2.3), share_x=True)
    step = np.arange(chosen.sizes["step"])
    labels = [str(label) for label in chosen["component"].values]
    rows = (
        (axes[:count], "strain", 100.0, r"\varepsilon", "strain [%]"),
        (axes[count:], "stress", 1e-3, r"\sigma", "stress [kPa]"),
    )
    for panels, name, scale, symbol, title in rows:
        values = scale * chosen[name].values.astype(np.float64)
        for axis, curves in zip(panels, values, strict=True):
            for number, label in enumerate(labels):
                axis.plot(
                    step,
                    curves[:, number],
                    **TRUTH | {"color": MODEL_COLOURS[number], "marker": MARKERS[number]},
                    markevery=shown_rows(step, curves[:, number], DOTS_PER_CURVE),
                    label=f"${symbol}_{{{label}}}$",
                )
        panels[0].set_ylabel(title)
        panels[0].legend(loc="best", handletextpad=0.1)
    for axis, name in zip(axes[:count], chosen["path_id"].values, strict=True):
        axis.set_title(str(name), fontsize=8)
    for axis in axes[count:]:
        axis.set_xlabel("step [–]")
    return figure


@house_style
def increment_figure(records: xr.Dataset) -> Figure:
    """Distribution of the norm of the strain increments, one line a split (Fig 6.7).

    Raises
    ------
    DatasetError
        If the records are not in the plane.
    """
    _require_plane(records)
    figure, (axis,) = figure_grid(panel=(5.6, 3.2))
    for number, split in enumerate(_splits(records)):
        strain = _of_split(records, split)["strain"].values.astype(np.float64)
        norms = np.sort(frobenius_norm(np.diff(strain, axis=1), "plane").ravel())
        norms = norms[norms > 0.0]  # for the logarithm
        shown = np.unique(np.linspace(0, norms.size - 1, 300).round().astype(int))
        axis.plot(
            norms[shown],
            100.0 * (shown + 1) / norms.size,
            color=MODEL_COLOURS[number % len(MODEL_COLOURS)],
            linestyle=LINE_STYLES[number % len(LINE_STYLES)],
            label=split,
        )
    axis.set_xscale("log")
    axis.set(
        xlabel=r"norm of the strain increment $\|\Delta\varepsilon\|$ [–]",
        ylabel="increments at or below [%]",
        ylim=(0.0, 101.0),
    )
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), title="split")
    return figure


@house_style
def stress_space_figure(records: xr.Dataset) -> Figure:
    """Mean and deviatoric stress that the paths visit: in training, and out of distribution.

    With a stress out of the plane these are the invariants of the whole tensor, else those in
    the plane.

    Raises
    ------
    DatasetError
        If the records are not in the plane.
    """
    _require_plane(records)
    outside = [split for split in _splits(records) if split.startswith("ood-")]
    groups = [["train"] if "train" in _splits(records) else _splits(records)[:1]]
    groups += [outside] if outside else []
    figure, axes = figure_grid(1, len(groups), share_y=True)
    for axis, splits in zip(axes, groups, strict=True):
        for number, split in enumerate(splits):
            p, q = _invariants(_of_split(records, split))
            chosen = np.linspace(0, p.size - 1, min(p.size, DOTS_PER_CLOUD)).astype(int)
            axis.plot(
                1e-3 * p.ravel()[chosen],
                1e-3 * q.ravel()[chosen],
                **TRUTH
                | {
                    "color": MODEL_COLOURS[number % len(MODEL_COLOURS)] if outside else "0.25",
                    "marker": MARKERS[number % len(MARKERS)],
                    "markersize": 1.6,
                },
                label=split,
            )
        axis.set(xlabel="mean stress $p$ [kPa]")
        # The cloud leaves no corner free for the names.
        axis.legend(
            loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2 if len(splits) > 1 else 1,
            markerscale=3.0, handletextpad=0.1,
        )  # fmt: skip
    axes[0].set_ylabel("deviatoric stress $q$ [kPa]")
    return figure


def _invariants(records: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """p and q, Pa, each (path, step)."""
    stress = records["stress"].values.astype(np.float64)
    if "out_of_plane_stress" not in records:
        return mean_stress(stress, "plane"), deviatoric_stress(stress, "plane")
    full = full_components(stress, records["out_of_plane_stress"].values.astype(np.float64))
    return mean_stress(full, "full"), deviatoric_stress(full, "full")


def _splits(records: xr.Dataset) -> list[str]:
    """Names of the splits, in the order of their first path."""
    return list(dict.fromkeys(map(str, records["split"].values)))


def _of_split(records: xr.Dataset, split: str) -> xr.Dataset:
    return records.isel(path=np.flatnonzero(records["split"].values.astype(str) == split))


def _first_of_splits(records: xr.Dataset) -> list[int]:
    split = records["split"].values.astype(str)
    # Validation and test are drawn from the family of training.
    shown = [name for name in _splits(records) if name not in ("validation", "test")]
    return [int(np.argmax(split == name)) for name in shown or _splits(records)]


def _require_plane(records: xr.Dataset) -> None:
    order = component_order(records["component"].values)
    if order != "plane":
        raise DatasetError(
            f"{records.attrs.get('dataset', 'the dataset')} has {order} components; this figure "
            "shows records in the plane: draw another one"
        )
