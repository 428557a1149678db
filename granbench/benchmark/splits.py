"""The splits that models are scored on."""

import numpy as np


def split_order(splits: np.ndarray) -> list[str]:
    """The splits that occur, `test` first."""
    return sorted(set(map(str, splits)), key=lambda name: (name != "test", name))
