"""Scatter between packings prepared alike: a lower bound of the error of any model."""

from dataclasses import asdict, dataclass

import numpy as np
import xarray as xr

from granbench.data.normalisation import Normalisation
from granbench.errors import DatasetError

SAME_LOADING = (
    "grading",
    "preparation_friction",
    "loading_family",
    "initial_mean_stress",
    "intermediate_stress_ratio",
    "programme",
)


@dataclass(frozen=True)
class ReplicateScatter:
    """Difference of two packings of one grading and preparation under the same loading.

    Parameters
    ----------
    pairs : number of path pairs
    specimens : number of packings that were prepared again
    stress_rms : RMS difference of stress over all steps of all pairs, one a component, divided
        by the training standard deviation
    stress_mse : mean square of the same over the components; twice the variance of a packing
        about the mean of its kind
    floor_mse : half of `stress_mse`: the score of a model that predicts that mean exactly, in the
        unit of the normalised MSE of models
    floor_median : the same of the median pair, for comparison with the median path of a model
    void_ratio_rms : RMS difference of void ratio, absolute; None without void ratio
    """

    pairs: int
    specimens: int
    stress_rms: tuple[float, ...]
    stress_mse: float
    floor_mse: float
    floor_median: float
    void_ratio_rms: float | None

    def as_dict(self) -> dict[str, object]:
        """Plain values for JSON."""
        return asdict(self)


def replicate_pairs(ds: xr.Dataset) -> list[tuple[int, int]]:
    """Rows (original, replicate) of paths that differ only in the seed of the packing.

    Parameters
    ----------
    ds : records with the coordinates `replicate` and `SAME_LOADING`
    """
    if any(name not in ds.coords for name in ("replicate", *SAME_LOADING)):
        return []
    columns = [[str(value) for value in ds[name].values] for name in SAME_LOADING]
    rows: dict[tuple[str, ...], list[int]] = {}
    for row, key in enumerate(zip(*columns, strict=True)):
        rows.setdefault(key, []).append(row)
    replicate = ds["replicate"].values
    return [
        (original, again)
        for alike in rows.values()
        for original in alike
        for again in alike
        if replicate[original] == 0 and replicate[again] > 0
    ]


def replicate_scatter(
    ds: xr.Dataset, normalisation: Normalisation | None = None
) -> ReplicateScatter:
    """The scatter over every pair of replicated paths.

    Parameters
    ----------
    ds : the whole dataset
    normalisation : that of the dataset's training split when not given

    Raises
    ------
    DatasetError
        If no specimen was prepared twice.
    """
    pairs = replicate_pairs(ds)
    if not pairs:
        raise DatasetError(
            f"{ds.attrs.get('dataset', 'the dataset')} has no replicates, so the scatter between "
            "packings is unknown; use a dataset whose specimens were prepared twice"
        )
    if normalisation is None:
        normalisation = Normalisation.from_training(ds)
    originals, again = (list(rows) for rows in zip(*pairs, strict=True))
    stress = ds["stress"].values.astype(np.float64) / normalisation.std["stress"]
    squares = (stress[originals] - stress[again]) ** 2
    void_ratio_rms = None
    if "void_ratio" in ds:
        void_ratio = ds["void_ratio"].values.astype(np.float64)
        void_ratio_rms = float(np.sqrt(((void_ratio[originals] - void_ratio[again]) ** 2).mean()))
    return ReplicateScatter(
        pairs=len(pairs),
        specimens=len(set(ds["specimen"].values[again].tolist())),
        stress_rms=tuple(float(rms) for rms in np.sqrt(squares.mean(axis=(0, 1)))),
        stress_mse=float(squares.mean()),
        floor_mse=float(squares.mean() / 2.0),
        floor_median=float(np.median(squares.mean(axis=(1, 2))) / 2.0),
        void_ratio_rms=void_ratio_rms,
    )
