"""Classical models fitted to laboratory tests, with the uncertainty of their parameters."""

from granbench.baselines.fitting.fitting import Fit, FitSettings, fit
from granbench.baselines.fitting.optimisation import Effort

__all__ = ["Effort", "Fit", "FitSettings", "fit"]
