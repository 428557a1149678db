"""Training engine: one loop for every network, resumable to the bit."""

from granbench.baselines.training.engine import TrainingOutcome, train
from granbench.baselines.training.history import learning_curve
from granbench.baselines.training.recipe import Limits, Recipe

__all__ = ["Limits", "Recipe", "TrainingOutcome", "learning_curve", "train"]
