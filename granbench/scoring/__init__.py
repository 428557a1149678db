"""Scoring: predictions and truth to numbers, without any model and without torch."""

from granbench.scoring.every_axis import score
from granbench.scoring.metrics import METRIC_VERSION
from granbench.scoring.scorecard import Curve, Score, Scorecard

__all__ = ["METRIC_VERSION", "Curve", "Score", "Scorecard", "score"]
