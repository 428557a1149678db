"""Small `fem-*` datasets, made in this process, for tests that need Gauss-point histories."""

import tempfile
from functools import cache
from pathlib import Path

import xarray as xr

from granbench.generators.fem.dataset import assemble
from granbench.generators.fem.design import GROUND_TRUTHS, PRESETS, planned_analyses
from granbench.generators.fem.jobs import campaign_job, run_analysis
from granbench.records import describe


@cache
def _made(dataset: str) -> xr.Dataset:
    truth, preset = GROUND_TRUTHS[dataset], PRESETS["smoke"]
    plans = planned_analyses(truth, preset, 0)
    with tempfile.TemporaryDirectory() as folder:
        results = {plan.name: Path(folder) / plan.name for plan in plans}
        for plan in plans:
            results[plan.name].mkdir()
            job = campaign_job(truth, preset, plan, 0)
            run_analysis(job.configuration, 0, {}, results[plan.name])
        return describe(assemble(truth, preset, plans, results, 0))


def fem_records(dataset: str = "fem-ime") -> xr.Dataset:
    """The smoke preset of a `fem-*` dataset: 18 analyses of coarse meshes to a tenth of the
    strain."""
    return _made(dataset).copy(deep=True)
