"""Peak and critical states of recorded tests, and selections of tests.

Functions that use strain or stress need records in the `principal` order.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from granbench.errors import DatasetError
from granbench.tensors import deviatoric_stress, mean_stress

ATMOSPHERIC_PRESSURE = 101_325.0
"""Reference pressure of `CriticalStateLine`, Pa."""

PRESSURE_EXPONENT = 0.7
"""Exponent of Li and Wang (1998), with which the critical-state line of sands and of frictional
spheres is straight; in e - ln p it is curved."""

MONOTONIC_FAMILIES = ("constant-p", "constant-sigma3")
CRITICAL_STRAIN = 0.3
"""Axial strain from which on a test counts as having reached its critical state."""

AVERAGED_SHARE = 0.05
"""Fraction of a record, at its end, over which the critical state is averaged: the stress of a few
thousand grains fluctuates by some percent from step to step."""


@dataclass(frozen=True)
class CriticalStateLine:
    """e = intercept - slope (p / p_a)^0.7, with p_a the atmospheric pressure.

    Parameters
    ----------
    intercept, slope : dimensionless
    residual_rms : RMS distance in e of the states from the line

    References
    ----------
    Li and Wang (1998), J. Geotech. Geoenviron. Eng. 124(12), Eq 3.
    """

    intercept: float
    slope: float
    residual_rms: float

    @classmethod
    def fit(cls, pressure: NDArray, void_ratio: NDArray) -> "CriticalStateLine":
        """Fit the line to states by least squares.

        Parameters
        ----------
        pressure : (state,), mean stress, Pa
        void_ratio : (state,)

        Raises
        ------
        DatasetError
            If the states have fewer than two different pressures.
        """
        if np.unique(pressure).size < 2:
            raise DatasetError(
                "a critical-state line needs final states at two mean stresses or more; select "
                "more tests"
            )
        scaled = (np.asarray(pressure) / ATMOSPHERIC_PRESSURE) ** PRESSURE_EXPONENT
        terms = np.stack([np.ones_like(scaled), -scaled], axis=-1)
        (intercept, slope), *_ = np.linalg.lstsq(terms, np.asarray(void_ratio), rcond=None)
        residual = terms @ (intercept, slope) - void_ratio
        return cls(float(intercept), float(slope), float(np.sqrt(np.mean(residual**2))))

    def void_ratio(self, pressure: NDArray) -> NDArray:
        """Critical void ratio at mean stresses (...), Pa."""
        scaled = (np.asarray(pressure) / ATMOSPHERIC_PRESSURE) ** PRESSURE_EXPONENT
        return self.intercept - self.slope * scaled


def initial_void_ratio_at(records: xr.Dataset, pressure: float) -> xr.DataArray:
    """Initial void ratio that each path of one grading would have at another mean stress.

    Specimens are loaded from different consolidation pressures. To compare preparations, e0 is
    moved along e0 = c - slope (p0/p_a)^0.7, with one slope for all that best fits the differences
    between pressures *within* specimens.

    Parameters
    ----------
    records : paths of one grading
    pressure : mean stress to compare at, Pa

    Returns
    -------
    (path,), dimensionless
    """
    scaled = (records["initial_mean_stress"] / ATMOSPHERIC_PRESSURE) ** PRESSURE_EXPONENT
    void_ratio = records["initial_void_ratio"]
    specimen = records["specimen"]
    x = scaled - scaled.groupby(specimen).mean().sel(specimen=specimen).values
    y = void_ratio - void_ratio.groupby(specimen).mean().sel(specimen=specimen).values
    squares = float((x**2).sum())
    slope = float((x * y).sum()) / squares if squares > 0.0 else 0.0
    reference = (pressure / ATMOSPHERIC_PRESSURE) ** PRESSURE_EXPONENT
    return void_ratio - slope * (scaled - reference)


def stress_ratio(records: xr.Dataset) -> NDArray[np.float64]:
    """q/p at every step, (path, step)."""
    stress = records["stress"].values.astype(np.float64)
    return deviatoric_stress(stress) / mean_stress(stress)


def select(records: xr.Dataset, **wanted: object) -> xr.Dataset:
    """The paths whose coordinates have the given values.

    Parameters
    ----------
    records : all paths
    wanted : value of a coordinate, by name; a tuple means any of its values
    """
    chosen = np.ones(records.sizes["path"], dtype=bool)
    for name, value in wanted.items():
        values = value if isinstance(value, tuple) else (value,)
        chosen &= np.isin(records[name].values, values)
    return records.isel(path=np.flatnonzero(chosen))


def named_paths(records: xr.Dataset, names: Sequence[str]) -> xr.Dataset:
    """The paths of the given names (`path_id`).

    Raises
    ------
    DatasetError
        If one of them is not in the records.
    """
    known = records["path_id"].values.astype(str)
    if missing := sorted(set(names) - set(known)):
        raise DatasetError(
            f"{records.attrs.get('dataset', 'the dataset')} has no path {missing[0]!r}; "
            "list them with `granbench data info`"
        )
    return select(records, path_id=tuple(names))


def strained(records: xr.Dataset, axial_strain: float = CRITICAL_STRAIN) -> xr.Dataset:
    """The monotonic tests that reach an axial strain.

    Parameters
    ----------
    records : all paths
    axial_strain : compression positive
    """
    tests = select(records, loading_family=MONOTONIC_FAMILIES)
    reached = tests["strain"].isel(step=-1, component=0).values >= axial_strain
    return tests.isel(path=np.flatnonzero(reached))


def comparable_compressions(records: xr.Dataset) -> xr.Dataset:
    """The largest group of constant-p tests with one grading, pressure and b, by void ratio.

    Of groups with equally many specimens, the one with the smallest b, the conventional
    compression, is taken. The result is empty if there is no constant-p test.
    """
    tests = select(records, loading_family="constant-p")
    keys = [
        (float(b), str(grading), float(pressure))
        for b, grading, pressure in zip(
            tests["intermediate_stress_ratio"].values,
            tests["grading"].values,
            tests["initial_mean_stress"].values,
            strict=True,
        )
    ]
    if not keys:
        return tests
    chosen = min(set(keys), key=lambda key: (-keys.count(key), key))
    rows = [row for row, key in enumerate(keys) if key == chosen]
    group = tests.isel(path=rows)
    return group.isel(path=np.argsort(group["initial_void_ratio"].values, kind="stable"))


def critical_states(records: xr.Dataset) -> xr.Dataset:
    """Mean state at the end of every monotonic test that reached the critical state.

    Returns
    -------
    Dataset with `stress`, (path, component), Pa, and `void_ratio`, (path,), and the coordinates of
    the paths
    """
    tests = strained(records)
    steps = max(1, round(AVERAGED_SHARE * tests.sizes["step"]))
    ends = tests[["stress", "void_ratio"]].isel(step=slice(-steps, None))
    return ends.mean("step", keep_attrs=True, dtype=np.float64)


def peak_stresses(records: xr.Dataset) -> xr.DataArray:
    """Stress at the largest q/p of every monotonic test, (path, component), Pa."""
    tests = select(records, loading_family=MONOTONIC_FAMILIES)
    peak = xr.DataArray(stress_ratio(tests).argmax(axis=1), dims="path")
    return tests["stress"].isel(step=peak).astype(np.float64)


def matsuoka_nakai_ratio(b: NDArray, compression_ratio: float) -> NDArray[np.float64]:
    """q/p on the Matsuoka-Nakai surface through a given q/p in triaxial compression.

    Parameters
    ----------
    b : (...), intermediate stress ratio, 0 to 1
    compression_ratio : q/p at b = 0, above 0 and below 3

    Returns
    -------
    (...), q/p

    Notes
    -----
    The surface is I1 I2 / I3 = constant (Matsuoka and Nakai 1974). At given b the left side
    increases with r = q/p from 9 at r = 0, so that r is found by bisection; it never exceeds that
    of triaxial compression.
    """
    b = np.asarray(b, dtype=float)
    target = _invariant_ratio(np.zeros_like(b), np.full_like(b, compression_ratio))
    tensile = 3.0 * np.sqrt(1.0 - b + b**2) / (1.0 + b)  # q/p at which the minor stress is 0
    low, high = np.zeros_like(b), np.minimum(compression_ratio, tensile * (1.0 - 1e-9))
    for _ in range(60):
        middle = 0.5 * (low + high)
        below = _invariant_ratio(b, middle) < target
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return 0.5 * (low + high)


def _invariant_ratio(b: NDArray, ratio: NDArray) -> NDArray:
    """I1 I2 / I3 at p = 1, q = `ratio` and intermediate stress ratio b."""
    stress = principal_stress(b, ratio)
    s1, s2, s3 = stress[..., 0], stress[..., 1], stress[..., 2]
    return (s1 + s2 + s3) * (s1 * s2 + s2 * s3 + s3 * s1) / (s1 * s2 * s3)


def principal_stress(b: NDArray, ratio: NDArray) -> NDArray[np.float64]:
    """Principal stresses of unit mean stress, (..., 3), with given b and q/p, both (...)."""
    # With s1 - s3 = d: deviator (2 - b, 2b - 1, -1 - b) d/3 and q = d sqrt(1 - b + b^2).
    spread = ratio / np.sqrt(1.0 - b + b**2)
    weights = np.stack([2.0 - b, 2.0 * b - 1.0, -1.0 - b], axis=-1)
    return 1.0 + weights * spread[..., None] / 3.0
