"""Small `gp-*` datasets, made in this process, for tests that need records in the plane."""

import tempfile
from functools import cache
from pathlib import Path

import xarray as xr

from granbench.generators.classical.dataset import assemble
from granbench.generators.classical.design import GROUND_TRUTHS, PRESETS, splits
from granbench.generators.classical.jobs import campaign_job, run_paths
from granbench.records import describe


@cache
def _made(dataset: str, seed: int) -> xr.Dataset:
    truth, preset = GROUND_TRUTHS[dataset], PRESETS["smoke"]
    plans = splits(truth, preset)
    with tempfile.TemporaryDirectory() as folder:
        job = campaign_job(truth, preset, plans, seed)
        run_paths(job.configuration, seed, {}, Path(folder))
        return describe(assemble(truth, preset, plans, Path(folder), seed))


def plane_records(dataset: str = "gp-j2", seed: int = 0) -> xr.Dataset:
    """The smoke preset of a `gp-*` dataset: 24 training paths, 8 of each other kind or 4."""
    return _made(dataset, seed).copy(deep=True)
