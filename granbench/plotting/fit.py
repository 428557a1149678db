"""Fitted models against laboratory tests."""

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from granbench.errors import ConfigurationError
from granbench.plotting.style import (
    TRUTH,
    ModelStyle,
    figure_grid,
    house_style,
    model_styles,
)
from granbench.records.turning_points import shown_rows

MOST_TESTS = 8
"""Tests that are drawn; of more, as many spread evenly over them."""

DOTS_PER_CURVE = 60

ROWS = {
    "deviatoric_stress": (1e-3, r"deviatoric stress $q$ [kPa]"),
    "volumetric_strain": (1e2, r"volumetric strain $\varepsilon_v$ [%]"),
}
"""Drawn quantities: factor from SI, and axis label."""

AXIAL = ("axial_stress", 1e-3)
AXIAL_STRAIN = r"axial strain $\varepsilon_{11}$ [%]"


@house_style
def fit_figure(curves: Mapping[str, xr.Dataset]) -> Figure:
    """Deviatoric stress and volumetric strain against axial strain, one column a test.

    Parameters
    ----------
    curves : of each model by name, over `test` and `step`: `axial_strain`, and `measured_` and
        `predicted_` of the quantities in `ROWS`, SI, compression positive, or of `axial_stress`
        where q was not measured; `predicted_axial_strain` where it differs; coordinate `role`, of
        whose title has `left out`. The models have the same tests.

    Raises
    ------
    ConfigurationError
        If no model is given, or two have different tests.
    """
    if not curves:
        raise ConfigurationError("give at least one fitted model to draw")
    first = next(iter(curves.values()))
    names = first["test"].values.astype(str)
    for model, dataset in curves.items():
        if not np.array_equal(dataset["test"].values.astype(str), names):
            raise ConfigurationError(f"{model} was fitted to other tests than the first model")
    shown = np.unique(np.linspace(0, len(names) - 1, min(MOST_TESTS, len(names))).round()).astype(
        int
    )
    figure, axes = figure_grid(len(ROWS), len(shown), panel=(2.7, 2.2), share_x=True)
    styles = model_styles(curves)
    for column, test in enumerate(shown):
        measured = first.isel(test=test)
        predicted = {model: dataset.isel(test=test) for model, dataset in curves.items()}
        panels = axes[column :: len(shown)]
        if np.isfinite(measured["measured_deviatoric_stress"].values).any():
            for axis, (quantity, (factor, label)) in zip(panels, ROWS.items(), strict=True):
                _draw(axis, measured, predicted, quantity, factor, styles)
                if column == 0:
                    axis.set_ylabel(label)
        else:
            # An oedometer test without lateral stress: neither q is known nor more than one strain.
            _draw(panels[0], measured, predicted, *AXIAL, styles)
            panels[0].set_ylabel(r"axial stress $\sigma_{11}$ [kPa]")
            panels[1].set_visible(False)
            panels[0].tick_params(labelbottom=True)
            panels[0].set_xlabel(AXIAL_STRAIN)
        out = str(first["role"].values[test]) == "left out"
        panels[0].set_title(f"{names[test]}\n(left out)" if out else names[test])
        panels[1].set_xlabel(AXIAL_STRAIN)
    handles = [Line2D([], [], label="measured", **TRUTH)]
    handles += [Line2D([], [], label=model, **styles[model].line()) for model in curves]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles))
    return figure


def _draw(
    axis: Axes,
    measured: xr.Dataset,
    predicted: Mapping[str, xr.Dataset],
    quantity: str,
    factor: float,
    styles: Mapping[str, ModelStyle],
) -> None:
    """One quantity of a test against the axial strain: dots as measured, a line for each model."""
    strain = 100.0 * measured["axial_strain"].values
    values = factor * measured[f"measured_{quantity}"].values
    axis.plot(strain, values, **TRUTH, markevery=shown_rows(strain, values, DOTS_PER_CURVE))
    for model, dataset in predicted.items():
        axis.plot(
            100.0 * dataset.get("predicted_axial_strain", dataset["axial_strain"]).values,
            factor * dataset[f"predicted_{quantity}"].values,
            **styles[model].line(),
        )
