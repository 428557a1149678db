"""Measured against predicted: stress and void ratio along paths, error against horizon."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from granbench.benchmark.axes.along_paths.protocols import PROTOCOLS
from granbench.errors import ConfigurationError
from granbench.plotting.error_curves import ErrorLine, draw_error_line, draw_floor
from granbench.plotting.style import TRUTH, figure_grid, house_style, model_styles
from granbench.records.turning_points import shown_rows
from granbench.tensors import component_order, deviatoric_stress, mean_stress

DOTS_PER_CURVE = 45
PASCALS_PER_MEGAPASCAL = 1e6
WANDERING_FAMILIES = ("random-strain",)
"""Their axial strain goes to and fro, so a curve over it is a tangle: they are drawn over steps."""

ROWS = (
    r"deviatoric stress $q$ [MPa]",
    r"mean stress $p$ [MPa]",
    r"void ratio $e$ [–]",
)


class ErrorCurve(Protocol):
    """Error against horizon of one protocol and split, as a `Curve` of a scorecard has it."""

    @property
    def protocol(self) -> str:
        """Label of the protocol."""

    @property
    def split(self) -> str:
        """The paths it is the mean of."""

    @property
    def horizon(self) -> Sequence[int]:
        """Steps since truth was given."""

    @property
    def value(self) -> Sequence[float]:
        """Mean squared normalised error."""

    @property
    def low(self) -> Sequence[float]:
        """Lower end of its interval."""

    @property
    def high(self) -> Sequence[float]:
        """Upper end of its interval."""


def typical_paths(
    records: xr.Dataset, predictions: xr.Dataset, *, split: str = "test", protocol: str = "rollout"
) -> list[str]:
    """One path of each loading family: the one of median error, neither the best nor the worst.

    Parameters
    ----------
    records : the truth
    predictions : of the model that the choice goes by; its first seed counts
    split, protocol : where the error is looked at

    Raises
    ------
    ConfigurationError
        If the predictions lack the split or the protocol.
    """
    predicted = _one_run(predictions, protocol)
    candidates = np.flatnonzero(predicted["split"].values.astype(str) == split)
    if not candidates.size:
        raise ConfigurationError(f"the predictions have no path of split {split!r} to draw")
    predicted = predicted.isel(path=candidates)
    true = _rows(records, predicted["path_id"].values.tolist())["stress"].values
    norm = np.linalg.norm(predicted["stress"].values - true, axis=-1)
    # A broken-down path is the worst of all.
    error = np.nan_to_num((norm / np.linalg.norm(true, axis=-1)).mean(axis=-1), nan=np.inf)
    families = predicted["loading_family"].values.astype(str)
    chosen = []
    for family in sorted(set(families)):
        rows = np.flatnonzero(families == family)
        ranked = rows[np.argsort(error[rows], kind="stable")]
        chosen.append(str(predicted["path_id"].values[ranked[(len(ranked) - 1) // 2]]))
    return chosen


@house_style
def prediction_figure(
    records: xr.Dataset,
    predictions: Mapping[str, xr.Dataset],
    paths: Sequence[str],
    *,
    protocol: str = "rollout",
) -> Figure:
    """q, p and void ratio of some paths, one column a path: measured as dots, models as lines.

    Parameters
    ----------
    records : the truth
    predictions : of each model by name; the first seed is drawn
    paths : names (`path_id`)
    protocol : label in `granbench.benchmark.axes.along_paths.protocols.PROTOCOLS`

    Raises
    ------
    ConfigurationError
        If no path or model is given, or a path or protocol is not in the predictions.
    """
    if not paths or not predictions:
        raise ConfigurationError("give at least one path and one model to draw")
    truth = _rows(records, paths)
    runs = {name: _rows(_one_run(ds, protocol), paths) for name, ds in predictions.items()}
    quantities = ROWS if "void_ratio" in records else ROWS[:2]
    figure, axes = figure_grid(len(quantities), len(paths), panel=(2.7, 2.1), share_x=True)
    order = component_order(records["component"].values)
    styles = model_styles(runs)
    for column, path in enumerate(paths):
        member = truth.isel(path=column)
        family = str(member["loading_family"].values)
        abscissa, label = _abscissa(member, family)
        panels = axes[column :: len(paths)]
        for axis, series in zip(panels, _quantities(member, order), strict=True):
            dots = shown_rows(abscissa, series, DOTS_PER_CURVE)
            axis.plot(abscissa, series, **TRUTH, markevery=dots)
        for name, run in runs.items():
            series_of_run = _quantities(run.isel(path=column), order)
            for axis, series in zip(panels, series_of_run, strict=False):
                axis.plot(abscissa, series, **styles[name].line())
        panels[0].set_title(f"{family}\n{path.partition('/')[0]}", fontsize=9.0)
        panels[-1].set_xlabel(label)
        _frame(panels, member, order)
    for axis, label in zip(axes[:: len(paths)], quantities, strict=True):
        axis.set_ylabel(label)
    handles = [Line2D([], [], label="measured (DEM)", **TRUTH)]
    handles += [Line2D([], [], label=name, **styles[name].line()) for name in runs]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles))
    return figure


@house_style
def horizon_figure(
    curves: Mapping[str, Sequence[ErrorCurve]],
    *,
    split: str = "test",
    protocols: Sequence[str] = ("window", "rollout"),
    floor: float | None = None,
) -> Figure:
    """Mean squared normalised stress error against the steps since truth was given.

    Parameters
    ----------
    curves : of each model by name
    split : which of the curves
    protocols : one panel each
    floor : the error that scatter between packings made alike gives whole paths, a dashed line

    Raises
    ------
    ConfigurationError
        If no model has such a curve.
    """
    figure, axes = figure_grid(1, len(protocols), panel=(4.1, 3.2))
    styles = model_styles(curves)
    drawn: set[str] = set()
    for axis, protocol in zip(axes, protocols, strict=True):
        for name, of_model in curves.items():
            for curve in of_model:
                if (curve.split, curve.protocol) == (split, protocol) and any(curve.value):
                    parts = (curve.horizon, curve.value, curve.low, curve.high)
                    draw_error_line(axis, ErrorLine(name, styles[name], *parts))
                    drawn.add(name)
        if floor and PROTOCOLS[protocol].restart is None:
            draw_floor(axis, floor)
        axis.set_yscale("log")
        axis.set(
            title=PROTOCOLS[protocol].title,
            xlabel="horizon [steps since truth was given]",
        )
    if not drawn:
        raise ConfigurationError(f"no model has an error curve for split {split!r} to draw")
    axes[0].set_ylabel("normalised stress MSE [–]")
    handles = {
        label: handle
        for axis in axes
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        handles.values(), handles.keys(), loc="outside lower center", ncols=min(6, len(handles))
    )
    return figure


def _one_run(predictions: xr.Dataset, protocol: str) -> xr.Dataset:
    labels = [str(label) for label in predictions["protocol"].values]
    if protocol not in labels:
        raise ConfigurationError(
            f"the predictions lack protocol {protocol!r}; they have {', '.join(labels)}"
        )
    return predictions.isel(seed=0, protocol=labels.index(protocol))


def _rows(dataset: xr.Dataset, paths: Sequence[str]) -> xr.Dataset:
    position = {str(name): row for row, name in enumerate(dataset["path_id"].values)}
    if missing := [str(path) for path in paths if str(path) not in position]:
        raise ConfigurationError(f"there is no path {missing[0]!r} to draw")
    return dataset.isel(path=[position[str(path)] for path in paths])


def _abscissa(member: xr.Dataset, family: str) -> tuple[np.ndarray, str]:
    if family in WANDERING_FAMILIES:
        return np.arange(member.sizes["step"]), "step [–]"
    axial = 100.0 * member["strain"].isel(component=0).values
    return axial, r"axial strain $\varepsilon_{11}$ [%]"


def _quantities(member: xr.Dataset, order: str) -> list[np.ndarray]:
    stress = member["stress"].values.astype(np.float64) / PASCALS_PER_MEGAPASCAL
    series = [deviatoric_stress(stress, order), mean_stress(stress, order)]
    if "void_ratio" in member:
        series.append(member["void_ratio"].values)
    return series


def _frame(panels: Sequence[Axes], member: xr.Dataset, order: str) -> None:
    """Keep the measured curve readable where a model runs away."""
    for axis, series in zip(panels, _quantities(member, order), strict=True):
        low, high = float(series.min()), float(series.max())
        span = max(high - low, 0.1 * abs(high))
        bottom, top = axis.get_ylim()
        axis.set_ylim(max(bottom, low - span), min(top, high + span))
