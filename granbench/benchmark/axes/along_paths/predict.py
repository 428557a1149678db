"""Predictions along recorded paths, under every protocol of the chosen axes."""

from functools import partial

import numpy as np
import torch
import xarray as xr

from granbench.benchmark.axes.along_paths.free_run import noise, rollout, window
from granbench.benchmark.axes.along_paths.protocols import (
    NOISE,
    PROTOCOLS,
    ROLLOUT,
    SINGLE_STEP,
    WINDOW,
    ProtocolSpec,
)
from granbench.benchmark.axes.along_paths.single_step import single_step
from granbench.benchmark.evaluation_run import EvaluationRun
from granbench.benchmark.scored_task import ScoredTask
from granbench.cells.contract import MaterialCell
from granbench.cells.robust_runs import Series

SCORED_INTERNALS = ("void_ratio",)
"""Internal variables that are kept beside the stress; no metric needs the others."""


def path_predictions(run: EvaluationRun) -> xr.Dataset:
    """Stress, and the internal variables that are scored, of every seed under every protocol.

    Returns
    -------
    Dataset over (seed, protocol, path, step): `stress` (.., component), `void_ratio` where every
    cell has it, and `noised_truth`, see `noised_truth`, where noise was asked for
    """
    protocols = [spec for spec in PROTOCOLS.values() if spec.axis in run.axes]
    runs: list[list[Series]] = []
    for seed, cell in run.cells.items():
        runs.append([])
        for spec in protocols:
            predict = partial(_predicted, spec, cell, run.records, seed)
            runs[-1].append(run.guarded(cell, spec.name, predict))
            run.report(seed, spec.title)
    internals = [
        name
        for name in runs[0][0]
        if name in SCORED_INTERNALS
        and name in run.records
        and all(name in cell.internals for cell in run.cells.values())
    ]
    found = labelled(
        {
            name: np.stack([[series[name].cpu().numpy() for series in each] for each in runs])
            for name in ("stress", *internals)
        },
        [spec.name for spec in protocols],
    )
    noised = [spec for spec in protocols if spec.axis == NOISE]
    if not noised or run.reads_records or run.task.ground_truth is None:
        return found
    truth = np.stack(
        [[noised_truth(run.task, spec, seed) for spec in noised] for seed in run.cells]
    )
    names = np.asarray([spec.name for spec in noised], dtype=object)
    dims = ("seed", "noise", "path", "step", "component")
    return found.assign(noised_truth=(dims, truth)).assign_coords(noise=names)


def labelled(predicted: dict[str, np.ndarray], protocols: list[str]) -> xr.Dataset:
    """Predicted series with the labels of their protocols.

    Parameters
    ----------
    predicted : `stress` (seed, protocol, path, step, component), Pa, compression positive, and
        internal variables (seed, protocol, path, step)
    protocols : their labels
    """
    dims = ("seed", "protocol", "path", "step", "component")
    first = [PROTOCOLS[label].first_predicted_step for label in protocols]
    return xr.Dataset(
        {name: (dims[: values.ndim], values) for name, values in predicted.items()},
        {
            "protocol": ("protocol", np.asarray(protocols, dtype=object)),
            "first_predicted_step": ("protocol", np.asarray(first, dtype=np.int64)),
        },
    )


@torch.no_grad()
def noised_truth(task: ScoredTask, spec: ProtocolSpec, seed: int) -> np.ndarray:
    """What the ground truth says along the strain that a noise protocol gives to a model.

    Parameters
    ----------
    task : its records, which a model made
    spec, seed : of the noise

    Returns
    -------
    Stress (path, step, component), Pa; NaN where the ground truth breaks down

    Raises
    ------
    DatasetError
        If no model made the records.
    """
    truth = task.require_ground_truth()
    return noise(truth, task.records, spec.noise, seed)["stress"].numpy()


def _predicted(spec: ProtocolSpec, cell: MaterialCell, records: xr.Dataset, seed: int) -> Series:
    if spec.axis == SINGLE_STEP:
        return single_step(cell, records)
    if spec.axis == WINDOW:
        return window(cell, records)
    if spec.axis == ROLLOUT:
        return rollout(cell, records)
    return noise(cell, records, spec.noise, seed)
