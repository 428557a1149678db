"""Every protocol of the chosen axes, for every seed of a model."""

import traceback
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np
import torch
import xarray as xr

from granbench.cell import MaterialCell
from granbench.errors import ConfigurationError, GranbenchError, ModelError
from granbench.predictions import (
    AXES,
    SCORED_INTERNALS,
    ProtocolSpec,
    assemble,
    protocols_of,
)
from granbench.protocols.free_run import noise, rollout, window
from granbench.protocols.single_step import single_step
from granbench.protocols.surviving import Series
from granbench.tensors import COMPONENT_ORDERS


def predict(
    cells: Mapping[int, MaterialCell],
    dataset: xr.Dataset,
    axes: Iterable[str] = AXES,
    *,
    attrs: Mapping[str, str] | None = None,
    progress: Callable[[int, ProtocolSpec], None] | None = None,
) -> xr.Dataset:
    """Predictions of a model in their layout (see `granbench.predictions`).

    Parameters
    ----------
    cells : the model's cell for each seed; the seed also drives the noise
    dataset : the records to predict, all of its paths
    axes : which of `granbench.predictions.AXES`
    attrs : further attributes of the result, such as `command`
    progress : called with (seed, protocol) after each

    Raises
    ------
    ModelError
        If a cell has another component order than the records, or lacks what they give.
    ConfigurationError
        If an axis is unknown, or there is no cell.
    """
    protocols = protocols_of(axes)
    if not cells or not protocols:
        raise ConfigurationError("nothing to evaluate: give at least one seed and one axis")
    runs: list[list[Series]] = []
    for seed, cell in cells.items():
        _check_order(cell, dataset)
        runs.append([])
        with torch.no_grad():
            for spec in protocols:
                runs[-1].append(_run(spec, cell, dataset, seed))
                if progress:
                    progress(seed, spec)
    internals = [
        name
        for name in runs[0][0]
        if name in SCORED_INTERNALS
        and name in dataset
        and all(name in cell.internals for cell in cells.values())
    ]

    def gather(name: str) -> np.ndarray:
        return np.stack([[series[name].cpu().numpy() for series in run] for run in runs])

    return assemble(
        gather("stress"),
        {name: gather(name) for name in internals},
        dataset=dataset,
        seeds=cells,
        protocols=[spec.name for spec in protocols],
        attrs={"model": next(iter(cells.values())).name, **(attrs or {})},
    )


def _run(spec: ProtocolSpec, cell: MaterialCell, dataset: xr.Dataset, seed: int) -> Series:
    try:
        if spec.axis == "single-step":
            return single_step(cell, dataset)
        if spec.axis == "window":
            return window(cell, dataset)
        if spec.axis == "rollout":
            return rollout(cell, dataset)
        return noise(cell, dataset, spec.noise, seed)
    except GranbenchError:
        raise
    except Exception as error:
        # The cell is a stranger's code: say where it fell, and keep the cause for a debugger.
        place = traceback.extract_tb(error.__traceback__)[-1]
        raise ModelError(
            f"cell {cell.name!r} failed in protocol {spec.name} with {type(error).__name__} "
            f"({error}) at {Path(place.filename).name} line {place.lineno}; mend the cell"
        ) from error


def _check_order(cell: MaterialCell, dataset: xr.Dataset) -> None:
    labels = tuple(str(label) for label in dataset["component"].values)
    if COMPONENT_ORDERS[cell.order] != labels:
        raise ModelError(
            f"cell {cell.name!r} works in the component order {cell.order!r}, but the records "
            f"have components {', '.join(labels)}; wrap it so that the orders agree"
        )
