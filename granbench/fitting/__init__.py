"""Classical models fitted to laboratory tests, with the uncertainty of their parameters.

How the modules stand on each other, from below:

    parameter_space     the free parameters of a cell as a vector, and back
    cell_of_each_point  a cell with other parameters at every point: many vectors in one batch
    compression_lines   first values that an oedometer test shows
    observations        tests, thinned and grouped into batches: what drives, what is compared
    rollouts            what vectors predict for a batch, and its derivatives
    least_squares       residuals and Jacobian of all batches
    optimisation        Adam, then Levenberg-Marquardt, from many starts
    uncertainty         identifiability, intervals and correlations at the minimum
    curves, report      measured against predicted, for figures, tables and files
    fitting             starts, search and judgement put together: `fit`
"""

from granbench.fitting.fitting import Fit, fit
from granbench.fitting.optimisation import Effort
from granbench.fitting.settings import FitSettings

__all__ = ["Effort", "Fit", "FitSettings", "fit"]
