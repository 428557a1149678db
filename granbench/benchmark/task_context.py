"""What records give to a model at the start of a path, and what of it a task leaves out."""

from collections.abc import Sequence

import xarray as xr

from granbench.errors import DatasetError
from granbench.records.schema import INTERNALS


def context_of(records: xr.Dataset) -> tuple[str, ...]:
    """Quantities that records give to a model at the start of a path."""
    from granbench.data.adapters import SPECIMEN_SCALARS

    void_ratio = ["initial_void_ratio"] if "void_ratio" in records else []
    return (
        "stress",
        "initial_mean_stress",
        *void_ratio,
        *(name for name in INTERNALS if name in records),
        *(name for name in SPECIMEN_SCALARS if name in records.coords),
    )


def unused_context(records: xr.Dataset, context: Sequence[str], task: str) -> list[str]:
    """Constants of the specimen that the records have and a task does not list.

    Parameters
    ----------
    records : the whole dataset
    context : quantities that the task lists
    task : its name, for errors

    Raises
    ------
    DatasetError
        If the records lack a quantity, or the task lacks one that every model is given.
    """
    given = context_of(records)
    if missing := [name for name in context if name not in given]:
        dataset = records.attrs.get("dataset", "the dataset")
        raise DatasetError(
            f"task {task}: context: {dataset} has no {missing[0]!r} at the start of a path; it "
            f"has {', '.join(given)}"
        )
    left_out = [name for name in given if name not in context]
    always = [
        name for name in left_out if name not in records.coords or name.startswith("initial_")
    ]
    if always:
        raise DatasetError(
            f"task {task}: context: lacks {always[0]!r}, which every model is given; add it"
        )
    return left_out
