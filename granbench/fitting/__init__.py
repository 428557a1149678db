"""Classical models fitted to laboratory tests, with the uncertainty of their parameters.

The modules, each using those above it:

    parameter_space     the free parameters of a cell as a vector, and back
    cell_of_each_point  a cell with other parameters at every point: many vectors in one batch
    test_batch          tests that run together: what drives, what is compared
    rollouts            predictions of vectors for a batch, and their derivatives
    least_squares       residuals and Jacobian of all batches
    optimisation        Adam, then Levenberg-Marquardt, from many starts
    settings            settings of a fit
    observations        laboratory tests, thinned and grouped into batches
    compression_lines   starting values from an oedometer test
    starts              starting vectors
    uncertainty         identifiability, intervals and correlations at the minimum
    curves              measured against predicted, for figures and tables
    judgement           checks and warnings
    fitting, report     `fit`, and its results as files
"""

from granbench.fitting.fitting import Fit, fit
from granbench.fitting.optimisation import Effort
from granbench.fitting.settings import FitSettings

__all__ = ["Effort", "Fit", "FitSettings", "fit"]
