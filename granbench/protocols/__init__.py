"""Protocols: a material cell and a dataset to predictions."""

from granbench.protocols.embedded import embedded_truth
from granbench.protocols.evaluation import noised_truth, predict, progress_parts
from granbench.protocols.free_run import noise, rollout, window
from granbench.protocols.single_step import single_step

__all__ = [
    "embedded_truth",
    "noise",
    "noised_truth",
    "predict",
    "progress_parts",
    "rollout",
    "single_step",
    "window",
]
