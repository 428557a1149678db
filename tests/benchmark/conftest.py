"""Predictions made by hand from the records, for scoring alone."""

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from granbench.benchmark.axes.along_paths.predict import labelled
from granbench.benchmark.axes.along_paths.protocols import PROTOCOLS
from granbench.benchmark.predictions import assembled_predictions, evaluated
from granbench.data.normalisation import Normalisation


@pytest.fixture
def normalisation(records: xr.Dataset) -> Normalisation:
    return Normalisation.from_training(records)


@pytest.fixture
def truth(records: xr.Dataset) -> xr.Dataset:
    return evaluated(records)


@pytest.fixture
def predicted(truth: xr.Dataset) -> Callable[..., xr.Dataset]:
    """Makes predictions: the truth plus `stress_error` and `void_ratio_error` (broadcast)."""

    def make(
        stress_error: np.ndarray | float = 0.0,
        void_ratio_error: np.ndarray | float | None = 0.0,
        protocols: tuple[str, ...] = tuple(PROTOCOLS),
        seeds: tuple[int, ...] = (0, 1, 2),
    ) -> xr.Dataset:
        shape = (len(seeds), len(protocols), *truth["stress"].shape)
        stress = truth["stress"].values + np.broadcast_to(stress_error, shape)
        internals = {}
        if void_ratio_error is not None:
            internals["void_ratio"] = truth["void_ratio"].values + np.broadcast_to(
                void_ratio_error, shape[:-1]
            )
        part = labelled({"stress": stress, **internals}, list(protocols))
        return assembled_predictions([part], dataset=truth, seeds=seeds, attrs={"model": "by-hand"})

    return make
