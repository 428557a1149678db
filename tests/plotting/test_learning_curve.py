"""The learning curve: both losses, and the epoch whose weights were kept."""

import numpy as np
import pytest
import xarray as xr

from granbench.plotting import learning_curve_figure


def test_the_kept_epoch_has_the_lowest_validation_loss() -> None:
    epoch = np.arange(1, 9)
    history = xr.Dataset(
        {
            "training_loss": ("epoch", 1.0 / epoch),
            "validation_loss": ("epoch", 0.5 / epoch + 0.01 * (epoch - 5.0) ** 2),
        },
        {"epoch": epoch},
    )
    figure = learning_curve_figure(history, title="mlstm, seed 0")
    (axis,) = figure.axes
    kept = next(line for line in axis.lines if line.get_label() == "kept")
    best = int(history["validation_loss"].values.argmin())
    assert kept.get_xdata()[0] == epoch[best]
    assert kept.get_ydata()[0] == pytest.approx(history["validation_loss"].values[best])
    assert axis.get_yscale() == "log"
    assert axis.get_title() == "mlstm, seed 0"
