"""Figures of a dataset: what a soil mechanician looks at first.

Every function takes records in the `principal` order (`granbench.records`) and returns a new
figure; measured points are dots, fitted lines are lines.
"""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter, NullLocator

from granbench.errors import DatasetError
from granbench.plotting.style import (
    MARKERS,
    TRUTH,
    figure_grid,
    house_style,
    ordered_colours,
)
from granbench.records.observations import (
    CriticalStateLine,
    comparable_compressions,
    critical_states,
    initial_void_ratio_at,
    named_paths,
    select,
    stress_ratio,
)
from granbench.records.turning_points import shown_rows
from granbench.tensors import mean_stress

DOTS_PER_CURVE = 60
COMPARED_PRESSURE = 0.5e6
"""Pa; the anchor pressure of `dem-triaxial`, at which preparations are compared."""
AXIAL_STRAIN = r"axial strain $\varepsilon_{11}$ [%]"
STRESS_RATIO = r"stress ratio $q/p$ [–]"
VOID_RATIO = r"void ratio $e$ [–]"


@house_style
def dataset_figure(records: xr.Dataset, *, paths: Sequence[str] | None = None) -> Figure:
    """q/p and void ratio against axial strain, by initial void ratio.

    Parameters
    ----------
    records : stress-strain records
    paths : names (`path_id`) of the tests to draw; by default the largest group of constant-p
        tests that differ in density only, or, where there is none, a dozen spread over the file

    Raises
    ------
    DatasetError
        If a named path is not in the records.
    """
    chosen, title = _chosen(records, paths)
    by = next((n for n in ("initial_void_ratio", "initial_mean_stress") if n in chosen.coords), "")
    colours, scale = ordered_colours(
        chosen[by].values if by else np.arange(chosen.sizes["path"], dtype=float)
    )
    has_voids = "void_ratio" in chosen
    figure, axes = figure_grid(1, 2 if has_voids else 1)
    strain = 100.0 * chosen["strain"].isel(component=0).values
    curves = [(axes[0], stress_ratio(chosen), STRESS_RATIO)]
    if has_voids:
        curves.append((axes[1], chosen["void_ratio"].values, VOID_RATIO))
    for axis, series, label in curves:
        for row, colour in enumerate(colours):
            dots = shown_rows(strain[row], series[row], DOTS_PER_CURVE)
            axis.plot(strain[row], series[row], **TRUTH | {"color": colour}, markevery=dots)
        axis.set(xlabel=AXIAL_STRAIN, ylabel=label)
    if by:
        label = {
            "initial_void_ratio": r"initial void ratio $e_0$ [–]",
            "initial_mean_stress": r"initial mean stress $p_0$ [Pa]",
        }[by]
        figure.colorbar(scale, ax=axes, label=label)
    figure.suptitle(title)
    return figure


def _chosen(records: xr.Dataset, paths: Sequence[str] | None) -> tuple[xr.Dataset, str]:
    if paths is not None:
        return named_paths(records, paths), f"{len(paths)} tests"
    needed = ("grading", "intermediate_stress_ratio", "initial_mean_stress", "initial_void_ratio")
    if all(name in records.coords for name in needed):
        group = comparable_compressions(records)
        if group.sizes["path"]:
            first = group.isel(path=0)
            return group, (
                f"{first['grading'].item()}: constant $p$ = "
                f"{first['initial_mean_stress'].item() / 1e6:g} MPa, "
                f"$b$ = {first['intermediate_stress_ratio'].item():g}"
            )
    rows = np.unique(np.linspace(0, records.sizes["path"] - 1, 12).round().astype(int))
    return records.isel(path=rows), f"{len(rows)} of {records.sizes['path']} paths"


@house_style
def critical_state_figure(records: xr.Dataset) -> Figure:
    """Void ratio against mean stress at the end of the monotonic tests, with the fitted line.

    Each grading has a line of its own, e = e_c0 - lambda_c (p/p_a)^0.7 (Li and Wang 1998).

    Raises
    ------
    DatasetError
        If no test is strained far enough.
    """
    states = critical_states(records)
    require_paths(states, records, "monotonic tests up to 30 % axial strain")
    names, colours = _gradings(states)
    figure, (axis,) = figure_grid(panel=(5.6, 3.8))
    for number, (name, colour) in enumerate(zip(names, colours, strict=True)):
        own = select(states, grading=name)
        pressure = mean_stress(own["stress"].values)
        axis.plot(
            pressure / 1e6,
            own["void_ratio"].values,
            **TRUTH | {"color": colour, "marker": MARKERS[number % len(MARKERS)], "markersize": 4},
            label=name,
        )
        if np.unique(own["initial_mean_stress"].values).size > 1:
            line = CriticalStateLine.fit(pressure, own["void_ratio"].values)
            grid = np.geomspace(pressure.min(), pressure.max(), 50)
            axis.plot(grid / 1e6, line.void_ratio(grid), color=colour, linewidth=1.0)
    axis.set_xscale("log")
    # Less than a decade is usual: powers of ten alone would leave one label, all digits a blot.
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter(FormatStrFormatter("%g"))
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set(xlabel="mean stress $p$ [MPa]", ylabel=VOID_RATIO, title="Critical state")
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), title="grading")
    return figure


@house_style
def preparation_figure(records: xr.Dataset) -> Figure:
    """Initial void ratio at one mean stress against preparation friction, one line a grading.

    Specimens are consolidated to different pressures; see `initial_void_ratio_at` for how their
    void ratios are brought to that of `COMPARED_PRESSURE`. The bar spans the paths.

    Raises
    ------
    DatasetError
        If the records do not say how their specimens were prepared.
    """
    for name in ("preparation_friction", "initial_void_ratio", "initial_mean_stress", "grading"):
        if name not in records.coords:
            raise DatasetError(
                f"{records.attrs.get('dataset', 'the dataset')} lacks the coordinate {name!r} "
                "that the preparation figure needs; use a dataset of DEM specimens"
            )
    names, colours = _gradings(records)
    figure, (axis,) = figure_grid(panel=(5.6, 3.8))
    for number, (name, colour) in enumerate(zip(names, colours, strict=True)):
        voids = initial_void_ratio_at(select(records, grading=name), COMPARED_PRESSURE)
        by_friction = voids.groupby("preparation_friction")
        mean, low, high = by_friction.mean(), by_friction.min(), by_friction.max()
        axis.errorbar(
            mean["preparation_friction"].values,
            mean.values,
            yerr=np.abs(np.stack([mean - low, high - mean])),
            color=colour,
            marker=MARKERS[number % len(MARKERS)],
            markersize=4,
            linewidth=1.0,
            elinewidth=0.8,
            label=name,
        )
    axis.set_xscale("symlog", linthresh=0.005, linscale=0.6)
    frictions = np.unique(records["preparation_friction"].values)
    axis.set_xticks(frictions, [f"{friction:g}" for friction in frictions])
    axis.xaxis.set_minor_locator(NullLocator())
    axis.set(
        xlabel=r"preparation friction $\mu_0$ [–]",
        ylabel=r"initial void ratio $e_0$ [–]",
        title=f"Preparation, at $p_0$ = {COMPARED_PRESSURE / 1e6:g} MPa",
    )
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), title="grading")
    return figure


@house_style
def cyclic_figure(records: xr.Dataset, *, tests: int = 3) -> Figure:
    """Hysteresis: stress ratio and void ratio against axial strain of a few cyclic tests.

    The stress ratio is signed, (sigma_11 - sigma_33)/p, so that a loop may pass through zero.

    Parameters
    ----------
    records : stress-strain records
    tests : how many, spread from the densest to the loosest

    Raises
    ------
    DatasetError
        If there is no cyclic test.
    """
    cyclic = select(records, loading_family="cyclic")
    require_paths(cyclic, records, "cyclic tests")
    order = np.argsort(cyclic["initial_void_ratio"].values, kind="stable")
    rows = order[np.unique(np.linspace(0, len(order) - 1, tests).round().astype(int))]
    figure, axes = figure_grid(2, len(rows), panel=(3.2, 2.5), share_x=True, share_y=True)
    for column, row in enumerate(rows):
        test = cyclic.isel(path=row)
        stress = test["stress"].values.astype(np.float64)
        strain = 100.0 * test["strain"].isel(component=0).values
        upper, lower = axes[column], axes[len(rows) + column]
        for axis, series in (
            (upper, (stress[:, 0] - stress[:, 2]) / mean_stress(stress)),
            (lower, test["void_ratio"].values),
        ):
            axis.plot(strain, series, color="0.75", linewidth=0.7)  # the order of the dots
            axis.plot(strain, series, **TRUTH)
        upper.set_title(
            f"{test['grading'].item()}, $e_0$ = {test['initial_void_ratio'].item():.3f}, "
            f"$p_0$ = {test['initial_mean_stress'].item() / 1e6:g} MPa",
            fontsize=8,
        )
        lower.set_xlabel(AXIAL_STRAIN)
    axes[0].set_ylabel(r"$(\sigma_{11}-\sigma_{33})/p$ [–]")
    axes[len(rows)].set_ylabel(VOID_RATIO)
    return figure


def _gradings(records: xr.Dataset) -> tuple[list[str], list]:
    """Names of the gradings, narrow to wide by grading index, and a colour for each."""
    labels = records["grading"].values.astype(str)
    index = records["grading_index"].values
    names = sorted(set(labels), key=lambda name: (float(index[labels == name].mean()), name))
    colours, _ = ordered_colours(np.arange(len(names), dtype=float))
    return names, colours


def require_paths(chosen: xr.Dataset | xr.DataArray, records: xr.Dataset, what: str) -> None:
    """Refuse an empty choice of paths.

    Raises
    ------
    DatasetError
        Naming the dataset and the kind of tests that it lacks.
    """
    if not chosen.sizes["path"]:
        raise DatasetError(
            f"{records.attrs.get('dataset', 'the dataset')} has no {what}, which this figure "
            "shows; draw another one"
        )
