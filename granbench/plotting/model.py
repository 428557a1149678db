"""Response of a classical model in a few element tests, as small multiples.

A panel shows one quantity of its tests against another. What is known in closed form stands
beside them: points as dots, the truth of every figure here, and boundaries such as a critical
state line as thin grey lines.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from granbench.errors import DatasetError
from granbench.plotting.element_test import path_invariants
from granbench.plotting.style import (
    LINE_STYLES,
    TRUTH,
    figure_grid,
    house_style,
    ordered_colours,
)
from granbench.tensors import (
    COMPONENT_ORDERS,
    PRINCIPAL_DIRECTIONS,
    component_order,
    frobenius_norm,
)

Floats = NDArray[np.float64]
Corner = Literal["best", "upper left", "upper right", "lower left", "lower right"]

PANEL = (3.1, 2.5)
"""Inches of one panel."""

BOUNDARY_STYLES = ((0, (5, 2)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5)))
BOUNDARY_COLOUR = "0.45"
POINT_SIZE = 4.5
PALEST = 1.3
"""End of the scale of colours, relative to the last curve: thin lines vanish in its palest part."""


@dataclass(frozen=True)
class Quantity:
    """Quantity on an axis of a panel.

    Parameters
    ----------
    label : with symbol and unit
    scale : from SI to the unit of the label
    of : records -> (path, step), SI
    """

    label: str
    scale: float
    of: Callable[[xr.Dataset], Floats]


def _order(records: xr.Dataset) -> str:
    return component_order(records["component"].values)


def _component(records: xr.Dataset, variable: str, direction: str) -> Floats:
    label = PRINCIPAL_DIRECTIONS[_order(records)][direction]
    return np.asarray(records[variable].sel(component=label).values, dtype=np.float64)


def _stress_difference(records: xr.Dataset) -> Floats:
    return _component(records, "stress", "11") - _component(records, "stress", "33")


def _plastic_strain_norm(records: xr.Dataset) -> Floats:
    order = _order(records)
    parts = [records[f"plastic_strain_{label}"].values for label in COMPONENT_ORDERS[order]]
    return np.asarray(frobenius_norm(np.stack(parts, axis=-1), order))


QUANTITIES: Mapping[str, Quantity] = {
    "axial_strain": Quantity(
        r"axial strain $\varepsilon_a$ [%]", 100.0, lambda r: _component(r, "strain", "11")
    ),
    "volumetric_strain": Quantity(
        r"volumetric strain $\varepsilon_v$ [%]", 100.0, lambda r: path_invariants(r)[2]
    ),
    "stress_difference": Quantity(
        r"stress difference $\sigma_a-\sigma_l$ [kPa]", 1e-3, _stress_difference
    ),
    "mean_stress": Quantity("mean stress $p$ [kPa]", 1e-3, lambda r: path_invariants(r)[0]),
    "deviatoric_stress": Quantity(
        "deviatoric stress $q$ [kPa]", 1e-3, lambda r: path_invariants(r)[1]
    ),
    "void_ratio": Quantity("void ratio $e$ [–]", 1.0, lambda r: r["void_ratio"].values),
    "plastic_strain_norm": Quantity(
        r"plastic strain $\|\varepsilon^p\|_F$ [%]", 100.0, _plastic_strain_norm
    ),
}
"""Quantities by name; a and l are the axial and lateral directions, 11 and 33."""


@dataclass(frozen=True)
class ClosedForm:
    """A closed-form solution.

    Parameters
    ----------
    label : in the legend
    x, y : (point,), SI
    line : whether it is a boundary, drawn as a line, and not points on the curves
    """

    label: str
    x: Sequence[float] | Floats
    y: Sequence[float] | Floats
    line: bool = False


@dataclass(frozen=True)
class Panel:
    """One quantity of some tests against another.

    Parameters
    ----------
    title : what is tested
    abscissa, ordinate : keys of `QUANTITIES`
    tests : records, which may differ in component order; `path_id` says what each curve is
    closed_forms : drawn with them
    logarithmic : whether the abscissa is
    legend : where it stands, if there is one
    named : whether the legend names the curves, which another panel may do
    window : left, right, bottom and top of the axes in their units, NaN where the data decide
    """

    title: str
    abscissa: str
    ordinate: str
    tests: Sequence[xr.Dataset]
    closed_forms: Sequence[ClosedForm] = ()
    logarithmic: bool = False
    legend: Corner | None = "best"
    named: bool = True
    window: tuple[float, float, float, float] = (np.nan, np.nan, np.nan, np.nan)

    def curves(self) -> dict[str, tuple[Floats, Floats]]:
        """Every curve by its label: abscissa and ordinate (step,), in the units of the axes.

        Raises
        ------
        DatasetError
            If two tests have one label.
        """
        x, y = QUANTITIES[self.abscissa], QUANTITIES[self.ordinate]
        curves: dict[str, tuple[Floats, Floats]] = {}
        for records in self.tests:
            values = x.scale * x.of(records), y.scale * y.of(records)
            for name, *curve in zip(records["path_id"].values, *values, strict=True):
                if str(name) in curves:
                    raise DatasetError(
                        f"panel {self.title!r} has two curves {str(name)!r}; give each test a "
                        "path_id of its own"
                    )
                curves[str(name)] = (curve[0], curve[1])
        return curves


@house_style
def model_figure(panels: Sequence[Panel], columns: int = 2) -> Figure:
    """Small multiples of a model's tests.

    Curves of one panel differ in lightness and in dashes, so that they read in grey.

    Parameters
    ----------
    panels : row by row
    columns : panels in a row

    Raises
    ------
    DatasetError
        If two curves of a panel have one label.
    """
    figure, axes = figure_grid(-(-len(panels) // columns), columns, panel=PANEL)
    for axis in axes[len(panels) :]:
        axis.remove()
    for axis, panel in zip(axes, panels, strict=False):
        _draw(axis, panel)
    return figure


def _draw(axis: Axes, panel: Panel) -> None:
    x, y = QUANTITIES[panel.abscissa], QUANTITIES[panel.ordinate]
    boundaries = [form for form in panel.closed_forms if form.line]
    points = [form for form in panel.closed_forms if not form.line]
    curves = panel.curves()
    colours, _ = ordered_colours(np.append(np.arange(len(curves)), PALEST * (len(curves) - 1)))
    for (label, curve), colour, style in zip(curves.items(), colours, LINE_STYLES, strict=False):
        axis.plot(*curve, color=colour, linestyle=style, label=label if panel.named else None)
    for form, style in zip(boundaries, BOUNDARY_STYLES, strict=False):
        axis.plot(
            x.scale * np.asarray(form.x),
            y.scale * np.asarray(form.y),
            color=BOUNDARY_COLOUR,
            linestyle=style,
            linewidth=1.0,
            label=form.label,
        )
    for form in points:
        axis.plot(
            x.scale * np.asarray(form.x),
            y.scale * np.asarray(form.y),
            **TRUTH | {"color": "0.1", "markersize": POINT_SIZE, "zorder": 3, "clip_on": False},
            label=form.label,
        )
    axis.set(title=panel.title, xlabel=x.label, ylabel=y.label)
    if panel.logarithmic:
        axis.set_xscale("log")
        axis.xaxis.set_major_locator(LogLocator())
        axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.xaxis.set_minor_formatter(NullFormatter())
    left, right, bottom, top = (None if np.isnan(edge) else edge for edge in panel.window)
    axis.set_xlim(left, right)
    axis.set_ylim(bottom, top)
    if panel.legend is not None:
        axis.legend(loc=panel.legend, handlelength=2.6, labelspacing=0.25)
