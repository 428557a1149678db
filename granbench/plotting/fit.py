"""Fitted models against laboratory tests."""

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from granbench.errors import ConfigurationError
from granbench.plotting.style import TRUTH, every, figure_grid, house_style, model_styles

MOST_TESTS = 8
"""Tests that are drawn; of more, as many spread evenly over them."""

DOTS_PER_CURVE = 60

ROWS = {
    "deviatoric_stress": (1e-3, r"deviatoric stress $q$ [kPa]"),
    "volumetric_strain": (1e2, r"volumetric strain $\varepsilon_v$ [%]"),
}
"""Drawn quantities: factor from SI, and axis label."""


@house_style
def fit_figure(curves: Mapping[str, xr.Dataset]) -> Figure:
    """Deviatoric stress and volumetric strain against axial strain, one column a test.

    Parameters
    ----------
    curves : of each model by name, over `test` and `step`: `axial_strain`, and `measured_` and
        `predicted_` of the quantities in `ROWS`, SI, compression positive; coordinate `role`, of
        which `left out` is said in the title. The models have the same tests.

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
        for row, (quantity, (factor, label)) in enumerate(ROWS.items()):
            axis = axes[row * len(shown) + column]
            measured = first.isel(test=test)
            dots = every(int(np.isfinite(measured["axial_strain"].values).sum()), DOTS_PER_CURVE)
            axis.plot(
                100.0 * measured["axial_strain"].values,
                factor * measured[f"measured_{quantity}"].values,
                **TRUTH,
                markevery=dots,
            )
            for model, dataset in curves.items():
                predicted = dataset.isel(test=test)
                axis.plot(
                    100.0 * predicted["axial_strain"].values,
                    factor * predicted[f"predicted_{quantity}"].values,
                    **styles[model].line(),
                )
            if column == 0:
                axis.set_ylabel(label)
        out = str(first["role"].values[test]) == "left out"
        axes[column].set_title(f"{names[test]}\n(left out)" if out else names[test])
        axes[len(shown) + column].set_xlabel(r"axial strain $\varepsilon_{11}$ [%]")
    handles = [Line2D([], [], label="measured", **TRUTH)]
    handles += [Line2D([], [], label=model, **styles[model].line()) for model in curves]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles))
    return figure
