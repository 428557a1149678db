"""Small `fem-*` datasets, made in this process, for tests that need Gauss-point histories."""

import tempfile
from functools import cache
from pathlib import Path

import xarray as xr

from granbench.generators.fem.generator import GENERATOR
from granbench.generators.fem.jobs import run_analysis
from granbench.records import describe


@cache
def _made(dataset: str) -> xr.Dataset:
    with tempfile.TemporaryDirectory() as folder:
        results = {}
        for job in GENERATOR.planned_jobs(dataset, "smoke"):
            results[job.key] = Path(folder) / job.slug
            results[job.key].mkdir()
            run_analysis(job.configuration, 0, {}, results[job.key])
        return describe(GENERATOR.records(dataset, "smoke", 0, results))


def fem_records(dataset: str = "fem-ime") -> xr.Dataset:
    """The smoke preset of a `fem-*` dataset: coarse meshes, a tenth of the strain."""
    return _made(dataset).copy(deep=True)
