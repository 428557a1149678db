"""Small `gp-*` datasets, made in this process, for tests that need records in the plane."""

import tempfile
from functools import cache
from pathlib import Path

import xarray as xr

from granbench.generators.classical.generator import GENERATOR
from granbench.generators.classical.jobs import run_paths
from granbench.records import describe


@cache
def _made(dataset: str, seed: int) -> xr.Dataset:
    (job,) = GENERATOR.planned_jobs(dataset, "smoke", seed)
    with tempfile.TemporaryDirectory() as folder:
        run_paths(job.configuration, seed, {}, Path(folder))
        return describe(GENERATOR.records(dataset, "smoke", seed, {job.key: Path(folder)}))


def plane_records(dataset: str = "gp-j2", seed: int = 0) -> xr.Dataset:
    """The smoke preset of a `gp-*` dataset: 24 training paths, 8 or 4 of each other split."""
    return _made(dataset, seed).copy(deep=True)
