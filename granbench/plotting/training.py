"""The learning curve of a training run."""

import xarray as xr
from matplotlib.figure import Figure

from granbench.plotting.style import figure_grid, house_style


@house_style
def learning_curve_figure(history: xr.Dataset, *, title: str = "") -> Figure:
    """Training and validation loss against epoch; a dot marks the weights that were kept.

    Parameters
    ----------
    history : over `epoch`: `training_loss`, `validation_loss`, mean squared errors in units of
        the training split's variance
    title : model and seed
    """
    figure, (axis,) = figure_grid(panel=(4.6, 3.2))
    epoch = history["epoch"].values
    axis.plot(epoch, history["training_loss"].values, color="0.55", label="training")
    validation = history["validation_loss"].values
    axis.plot(epoch, validation, color="0.1", linestyle="--", label="validation")
    best = int(validation.argmin())
    axis.plot(epoch[best], validation[best], "o", color="0.1", markersize=5, label="kept")
    axis.set_yscale("log")
    axis.set(xlabel="epoch", ylabel="normalised MSE [–]", title=title)
    axis.legend()
    return figure
