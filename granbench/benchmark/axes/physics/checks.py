"""The laws that the physics axis checks, the unit of each violation and the tolerance.

Every check drives the cell through the one contract, from the start of recorded paths along their
true strain; no true stress enters. The cell itself runs along the path, so that the states at
which single increments are tried are such as it reaches on its own. A path's violation is its
worst: over the checked steps, or over the whole path, and over the components. What breaks down
(NaN, or a floating failure) violates the check as badly as anything can.

Which paths and steps are checked depends on the names of the paths alone, so that every model
meets the same.
"""

import hashlib
from dataclasses import dataclass

import numpy as np
import xarray as xr

from granbench.benchmark.axis import Part

NAME = "physics"
TANGENT, ROTATION, COMPRESSION = "tangent", "rotation", "compression"

CHECKED_PATHS = 16
"""Number of checked paths of each split; all where there are fewer."""

CHECKED_STEPS = 8
"""Number of checked steps of each checked path."""

CHECKED_STRAIN = 1e-3
"""Frobenius norm of the single increments that are checked; they have the directions of the path.
That is about a step of the random paths (their median is 1.3e-3), of the particle tests and of a
finite-element analysis."""


PHYSICS_OBSTACLES = "physics_not_applicable"
"""Global attribute where the physics axis was run: JSON, why a check does not apply, by name."""


@dataclass(frozen=True, kw_only=True)
class Check(Part):
    """One law and how its violation is measured; `definition` says it in one sentence.

    Parameters
    ----------
    tolerance : largest violation of a path that passes
    reason : of the tolerance
    """

    tolerance: float
    reason: str


def _check(name: str, title: str, definition: str, tolerance: float, reason: str) -> Check:
    return Check(
        name=name, axis=NAME, title=title, definition=definition, limit=tolerance,
        tolerance=tolerance, reason=reason,
    )  # fmt: skip


CHECKS: dict[str, Check] = {
    check.name: check
    for check in (
        _check(
            "tangent",
            "Tangent",
            "norm of the difference between the tangent and central differences of `step`, in "
            "double precision, divided by the larger norm of the two",
            1e-3,
            "smooth responses agree to 1e-8; that of CSUH, whose error control takes other "
            "substeps nearby, to 5e-4",
        ),
        _check(
            "zero-increment",
            "Zero increment",
            "change of stress over an increment of zero, in training standard deviations",
            1e-6,
            "the rounding of single precision at a few standard deviations",
        ),
        _check(
            "substeps-10",
            "1 against 10 substeps",
            "norm of the difference of the stress after one increment and after 10 equal parts "
            "of it, divided by the change of stress that the increment would make at the "
            "stiffness of the training data, a standard deviation of stress over one of strain",
            0.05,
            "implicit return mappings are off by up to 0.04 at such an increment, because the "
            "strain turns the stress while it grows",
        ),
        _check(
            "substeps-100",
            "1 against 100 substeps",
            "the same with 100 equal parts",
            0.05,
            "as for 10 substeps",
        ),
        _check(
            "rotation",
            "Rotation",
            "difference of the stress along the whole path and the stress, turned back, along "
            "the path turned by 30 degrees, in training standard deviations",
            1e-3,
            "rounding of single precision: some 1e-6 for elasticity, more where a model amplifies "
            "along the path what it starts from",
        ),
        _check(
            "swap",
            "Swap of axes",
            "difference of the stress along the whole path and the stress, exchanged back, "
            "along the path with two axes exchanged (Eq 6.18), in training standard deviations",
            1e-3,
            "as for rotation",
        ),
        _check(
            "dissipation",
            "Dissipation",
            "net work that the cell gives away over a closed strain cycle, divided by that of "
            "one training standard deviation along the same strain",
            1e-6,
            "rounding of single precision over some hundred steps: 1e-8 for elasticity",
        ),
        _check(
            "compression",
            "Compression",
            "share of a path's steps at which the mean stress is tensile",
            0.0,
            "grains without bonds carry no tension; rounding (1e-6 of the path's largest mean "
            "stress) is allowed for",
        ),
    )
}

READS_RECORDS = "the model reads its answers from the records and has none for other increments"
PRINCIPAL = "the records hold principal components, which cannot be turned"
CARRIES_TENSION = "the material of this task may carry tension"
NO_STRESS_OUT_OF_PLANE = (
    "the mean stress of this task includes the stress out of the plane, which the model does not "
    "predict"
)
"""Why a check does not apply: to a ceiling, to a task, or to a kind of model."""

NO_TANGENT = (
    "the cell offers no tangent and its step cannot be differentiated",
    "the model gives torch no gradients",
    "the tangent of the model fails",
)
"""How the reasons begin that `tangent` (beside this module) gives for models without a tangent."""

STRESS_CHECKS = ("zero-increment", "substeps-10", "substeps-100", "rotation", "swap")
"""Those that measure a change of stress, Pa, which scoring divides by standard deviations."""


def checked_paths(records: xr.Dataset) -> np.ndarray:
    """Rows of the paths that are checked: `CHECKED_PATHS` of each split, by a hash of their name.

    Parameters
    ----------
    records : scored records, or predictions of them; needs `path_id` and `split`

    Returns
    -------
    (checked_path,), in the order of the records
    """
    names = records["path_id"].values.astype(str)
    splits = records["split"].values.astype(str)
    ranked = sorted(range(len(names)), key=lambda row: _digest(str(names[row])))
    chosen = [
        row
        for split in set(splits)
        for row in [row for row in ranked if splits[row] == split][:CHECKED_PATHS]
    ]
    return np.sort(np.asarray(chosen, dtype=np.int64))


def checked_steps(path_id: str, steps: int) -> np.ndarray:
    """Steps of a path whose increments are checked: some of 1 ... steps - 1, sorted.

    Parameters
    ----------
    path_id : name of the path
    steps : recorded states of it, the start included
    """
    # NumPy promises never to change the raw bits of PCG64, so any version chooses the same.
    raw = np.random.PCG64(int.from_bytes(_digest(path_id)[:8], "big")).random_raw(steps - 1)
    return np.sort(np.argsort(raw, kind="stable")[:CHECKED_STEPS]) + 1


def _digest(path_id: str) -> bytes:
    return hashlib.sha256(f"physics {path_id}".encode()).digest()
