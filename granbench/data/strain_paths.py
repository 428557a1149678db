"""Statistics of drawn strain paths: their size, their increments and their stresses."""

from dataclasses import asdict, dataclass

import numpy as np
import xarray as xr

from granbench.tensors import component_order, frobenius_norm


@dataclass(frozen=True)
class StrainPathStatistics:
    """Statistics over every step of several paths.

    Parameters
    ----------
    paths : number of paths
    median_increment : of the Frobenius norm of the strain increments (Fig 6.7 of the thesis)
    strain_std : standard deviation of each strain component, by its label
    largest_strain : largest magnitude of a strain component
    stress_std : standard deviation of each stress component, Pa, by its label
    median_volumetric_factor : see the coordinate `volumetric_factor`; None without it
    tensile_share : share of the steps at which a principal stress in the plane is tensile; None
        where paths start without stress
    """

    paths: int
    median_increment: float
    strain_std: dict[str, float]
    largest_strain: float
    stress_std: dict[str, float]
    median_volumetric_factor: float | None
    tensile_share: float | None

    def as_dict(self) -> dict[str, object]:
        """Plain values for JSON."""
        return asdict(self)


def strain_path_statistics(records: xr.Dataset) -> StrainPathStatistics:
    """The statistics of all paths of records in any component order."""
    labels = tuple(map(str, records["component"].values))
    strain = records["strain"].values.astype(np.float64)
    stress = records["stress"].values.astype(np.float64)
    increments = frobenius_norm(np.diff(strain, axis=1), component_order(labels))
    factor = None
    if "volumetric_factor" in records.coords:
        factor = float(np.median(records["volumetric_factor"].values))
    return StrainPathStatistics(
        paths=records.sizes["path"],
        median_increment=float(np.median(increments)),
        strain_std=_by_label(labels, strain.std(axis=(0, 1))),
        largest_strain=float(np.abs(strain).max()),
        stress_std=_by_label(labels, stress.std(axis=(0, 1))),
        median_volumetric_factor=factor,
        tensile_share=_tensile_share(records, stress),
    )


def _tensile_share(records: xr.Dataset, stress: np.ndarray) -> float | None:
    in_plane = component_order(records["component"].values) == "plane"
    if not in_plane or not (records["initial_mean_stress"].values > 0.0).all():
        return None
    xx, yy, xy = np.moveaxis(stress, -1, 0)
    return float((0.5 * (xx + yy) < np.hypot(0.5 * (xx - yy), xy)).mean())


def _by_label(labels: tuple[str, ...], values: np.ndarray) -> dict[str, float]:
    return dict(zip(labels, map(float, values), strict=True))
