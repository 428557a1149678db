"""Statistics and metrics of the physics axis: violations of every checked path."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from granbench.benchmark.axes.physics.checks import NAME, TANGENT, Check
from granbench.benchmark.metric import WORST, Metric, Statistic
from granbench.benchmark.tolerance import SHARE_OF_PATHS, VIOLATION


@dataclass(frozen=True)
class Violations:
    """Violations of one law.

    Parameters
    ----------
    check : the law
    violation : (seed, path), dimensionless, at most `CEILING`, which a breakdown counts as
    other_responses : what else was measured, (seed, path), by name of the variable
    """

    check: Check
    violation: np.ndarray
    other_responses: Mapping[str, np.ndarray]


VIOLATION_OF_PATH = Statistic("violation", lambda found: found.violation)
VIOLATED = Statistic(
    "violated", lambda found: (found.violation > found.check.tolerance).astype(np.float64)
)
KINKS = Statistic("kink_share", lambda found: found.other_responses["kink_share"])

MEAN_VIOLATION, WORST_VIOLATION, VIOLATED_SHARE, KINK_SHARE = (
    "violation_mean", "violation_worst", "violated_share", "kink_share",
)  # fmt: skip

_metric: Any = partial(Metric, axis=NAME)
_DEFINITION = "violation of a path, see the table of checks; mean over the checked paths, or worst"

METRICS: tuple[Metric, ...] = (
    _metric(
        name=MEAN_VIOLATION, title="Violation", heading="mean\nviolation", definition=_DEFINITION,
        statistic=VIOLATION_OF_PATH, tolerance=VIOLATION, of_truth=None,
    ),
    _metric(
        name=WORST_VIOLATION, title="Violation, worst path", heading="worst\npath",
        definition=_DEFINITION, statistic=VIOLATION_OF_PATH, aggregation=WORST,
        tolerance=VIOLATION, of_truth=None,
    ),
    _metric(
        name=VIOLATED_SHARE, title="Paths beyond the tolerance", heading="paths\nbeyond",
        definition="share of the checked paths beyond the tolerance: the verdict",
        statistic=VIOLATED, tolerance=SHARE_OF_PATHS, style="percent",
    ),
    _metric(
        name=KINK_SHARE, title="Points without a derivative",
        definition="share of the points at which there is no derivative to compare with, and "
        "which are left out",
        statistic=KINKS, parts=(TANGENT,), tolerance=SHARE_OF_PATHS, style="percent",
        of_truth=None, shown=(),
    ),
)  # fmt: skip
"""The metrics in the order of the scorecard.

A ground truth may violate a law by what is allowed."""
