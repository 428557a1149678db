"""Scaling of values: means and standard deviations of the training split alone."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from granbench.data.splits import select_split
from granbench.errors import DatasetError
from granbench.records.schema import INTERNALS

VARIED = ("strain", "stress", "void_ratio")
"""Variables whose standard deviation divides scores; every component must vary."""


@dataclass(frozen=True)
class Normalisation:
    """Mean and standard deviation over every step of every training path.

    Parameters
    ----------
    mean, std : by variable name; (component,) for stress and strain, () for a series, in the
        variable's unit
    """

    mean: Mapping[str, NDArray[np.float64]]
    std: Mapping[str, NDArray[np.float64]]

    @classmethod
    def from_training(cls, ds: xr.Dataset) -> "Normalisation":
        """Statistics of `strain`, `stress` and the internal variables of a dataset.

        Parameters
        ----------
        ds : the whole dataset; only its split `train` is read

        Raises
        ------
        RegistryError
            If there is no training split.
        DatasetError
            If strain, stress or void ratio have a component that never varies. Another internal
            variable may be constant.
        """
        training = select_split(ds, "train")
        mean, std = {}, {}
        for name in ("strain", "stress", *INTERNALS):
            if name not in training:
                continue
            values = training[name].values.astype(np.float64)
            mean[name] = values.mean(axis=(0, 1))
            std[name] = values.std(axis=(0, 1))
            if name in VARIED and not (std[name] > 0.0).all():
                raise DatasetError(
                    f"{ds.attrs.get('dataset', 'the dataset')}: variable {name!r} has a component "
                    "that never varies in the training split, so its standard deviation is zero; "
                    "use more training paths"
                )
        return cls(mean, std)
