"""One figure one function: takes xarray or arrays, returns a matplotlib figure."""

from granbench.plotting import backend  # noqa: F401 - first: it imports matplotlib safely
from granbench.plotting.dataset import (
    critical_state_figure,
    cyclic_figure,
    dataset_figure,
    preparation_figure,
)
from granbench.plotting.packing import packing_figure
from granbench.plotting.pi_plane import pi_plane_figure
from granbench.plotting.plane import (
    increment_figure,
    strain_path_figure,
    stress_space_figure,
)
from granbench.plotting.quality import quality_figure
from granbench.plotting.style import model_styles, save_figure
from granbench.plotting.training import learning_curve_figure

__all__ = [
    "critical_state_figure",
    "cyclic_figure",
    "dataset_figure",
    "increment_figure",
    "learning_curve_figure",
    "model_styles",
    "packing_figure",
    "pi_plane_figure",
    "preparation_figure",
    "quality_figure",
    "save_figure",
    "strain_path_figure",
    "stress_space_figure",
]
