"""Training engine: one loop for every network, resumable to the bit."""

from granbench.baselines.training.engine import TrainingOutcome, train
from granbench.baselines.training.recipe import Limits, Recipe

__all__ = ["Limits", "Recipe", "TrainingOutcome", "train"]
