"""Every protocol of the chosen axes, for every seed of a model."""

import json
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import TypeVar

import numpy as np
import torch
import xarray as xr

from granbench.axes import AXES, COST, EMBEDDED, PHYSICS, ProtocolSpec, chosen_axes, protocols_of
from granbench.cell import MaterialCell
from granbench.errors import (
    ConfigurationError,
    DatasetError,
    GranbenchError,
    ModelError,
    where_it_fell,
)
from granbench.models.ground_truth import ground_truth_cell
from granbench.predictions import (
    EMBEDDED_FAILURES,
    EMBEDDED_OBSTACLE,
    SCORED_INTERNALS,
    assemble,
)
from granbench.protocols.cost import cost
from granbench.protocols.embedded import embedded, embedded_obstacle, embedded_truth
from granbench.protocols.free_run import noise, rollout, window
from granbench.protocols.physics import physics
from granbench.protocols.single_step import single_step
from granbench.protocols.surviving import Series
from granbench.tensors import COMPONENT_ORDERS

Result = TypeVar("Result")
Told = Callable[[int, str], None]


def predict(
    cells: Mapping[int, MaterialCell],
    dataset: xr.Dataset,
    axes: Iterable[str] = AXES,
    *,
    attrs: Mapping[str, str] | None = None,
    training_seconds: Mapping[int, float] | None = None,
    progress: Told | None = None,
) -> xr.Dataset:
    """Predictions of a model in their layout (see `granbench.predictions`).

    Parameters
    ----------
    cells : the model's cell for each seed; the seed also drives the noise
    dataset : the records to predict, all of its paths
    axes : which of `granbench.axes.AXES`
    attrs : further attributes of the result, such as `command`
    training_seconds : how long each seed was trained, where that is known
    progress : called after each part with the seed and what was done

    Raises
    ------
    ModelError
        If a cell has another component order than the records, or lacks what they give.
    ConfigurationError
        If an axis is unknown, or there is no cell or no axis.
    DatasetError
        If the dataset names a ground truth that cannot be rebuilt.
    """
    chosen = chosen_axes(axes)
    if not cells:
        raise ConfigurationError("there is nothing to evaluate: give at least one seed")
    for cell in cells.values():
        _check_order(cell, dataset)
    told = progress or (lambda seed, done: None)
    reads = any(cell.reads_records for cell in cells.values())
    with torch.no_grad():
        predicted = _predicted(cells, dataset, chosen, told)
        others = []
        if "noise" in chosen and not reads:
            others += _noised_truth(cells, dataset)
        if EMBEDDED in chosen:
            others.append(_embedded(cells, dataset, told))
        if PHYSICS in chosen:
            others.append(_for_each(cells, PHYSICS, lambda cell: physics(cell, dataset), told))
        if COST in chosen:
            others.append(_costs(cells, dataset, told).assign(_training(cells, training_seconds)))
    return assemble(
        predicted,
        dataset=dataset,
        seeds=cells,
        protocols=[spec.name for spec in protocols_of(chosen)],
        attrs={
            "model": next(iter(cells.values())).name,
            "reads_records": int(reads),
            **(attrs or {}),
        },
        others=others,
    )


def progress_parts(axes: Iterable[str]) -> int:
    """How often `predict` tells of progress for one seed."""
    chosen = chosen_axes(axes)
    return len(protocols_of(chosen)) + sum(axis in chosen for axis in (EMBEDDED, PHYSICS, COST))


@torch.no_grad()
def noised_truth(dataset: xr.Dataset, spec: ProtocolSpec, seed: int) -> np.ndarray:
    """What the ground truth says along the strain that a noise protocol gives to a model.

    Parameters
    ----------
    dataset : the scored records, which a model made
    spec, seed : of the noise

    Returns
    -------
    Stress (path, step, component), Pa; NaN where the ground truth breaks down

    Raises
    ------
    DatasetError
        If no model made the records.
    """
    truth = ground_truth_cell(dataset)
    if truth is None:
        raise DatasetError("the records name no ground truth; use a dataset that a model made")
    return noise(truth, dataset, spec.noise, seed)["stress"].numpy()


def _predicted(
    cells: Mapping[int, MaterialCell], dataset: xr.Dataset, axes: Iterable[str], told: Told
) -> dict[str, np.ndarray]:
    """`stress` and the internal variables that are scored, over (seed, protocol, path, ...)."""
    protocols = protocols_of(axes)
    if not protocols:
        return {}
    runs: list[list[Series]] = []
    for seed, cell in cells.items():
        runs.append([])
        for spec in protocols:
            runs[-1].append(_guarded(cell, spec.name, partial(_run, spec, cell, dataset, seed)))
            told(seed, spec.title)
    internals = [
        name
        for name in runs[0][0]
        if name in SCORED_INTERNALS
        and name in dataset
        and all(name in cell.internals for cell in cells.values())
    ]
    return {
        name: np.stack([[series[name].cpu().numpy() for series in run] for run in runs])
        for name in ("stress", *internals)
    }


def _run(spec: ProtocolSpec, cell: MaterialCell, dataset: xr.Dataset, seed: int) -> Series:
    if spec.axis == "single-step":
        return single_step(cell, dataset)
    if spec.axis == "window":
        return window(cell, dataset)
    if spec.axis == "rollout":
        return rollout(cell, dataset)
    return noise(cell, dataset, spec.noise, seed)


def _noised_truth(cells: Mapping[int, MaterialCell], dataset: xr.Dataset) -> list[xr.Dataset]:
    """`noised_truth` over (seed, noise, path, step, component); nothing without a ground truth."""
    if ground_truth_cell(dataset) is None:
        return []
    specs = protocols_of(["noise"])
    stress = np.stack([[noised_truth(dataset, spec, seed) for spec in specs] for seed in cells])
    dims = ("seed", "noise", "path", "step", "component")
    names = np.asarray([spec.name for spec in specs], dtype=object)
    return [xr.Dataset({"noised_truth": (dims, stress)}, {"noise": names})]


def _embedded(cells: Mapping[int, MaterialCell], dataset: xr.Dataset, told: Told) -> xr.Dataset:
    """The responses of boundary-value problems, or why there are none."""
    obstacle = embedded_obstacle(dataset, cells.values())
    if obstacle:
        return xr.Dataset(attrs={EMBEDDED_OBSTACLE: obstacle})
    found = _for_each(cells, EMBEDDED, lambda cell: embedded(cell, dataset), told)
    failures = found["failure"].assign_coords(seed=list(cells)).to_series()
    reasons = {"/".join(map(str, place)): text for place, text in failures.items() if text}
    return xr.merge([found.drop_vars("failure"), embedded_truth(dataset)]).assign_attrs(
        {EMBEDDED_OBSTACLE: "", EMBEDDED_FAILURES: json.dumps(reasons, sort_keys=True)}
    )


def _costs(cells: Mapping[int, MaterialCell], dataset: xr.Dataset, told: Told) -> xr.Dataset:
    truth = ground_truth_cell(dataset)
    return _for_each(cells, COST, lambda cell: cost(cell, dataset, truth), told)


def _training(
    cells: Mapping[int, MaterialCell], seconds: Mapping[int, float] | None
) -> dict[str, tuple[str, np.ndarray]]:
    known = seconds or {}
    times = [known.get(seed, np.nan) for seed in cells]
    counts = [cell.parameters_count() for cell in cells.values()]
    return {
        "training_seconds": ("seed", np.asarray(times, dtype=np.float64)),
        "parameters": ("seed", np.asarray(counts, dtype=np.float64)),
    }


def _for_each(
    cells: Mapping[int, MaterialCell],
    axis: str,
    measure: Callable[[MaterialCell], xr.Dataset],
    told: Told,
) -> xr.Dataset:
    """A measurement that no seed of ours enters: once for each cell, over `seed`."""
    known: dict[int, xr.Dataset] = {}
    found = []
    for seed, cell in cells.items():
        if id(cell) not in known:
            known[id(cell)] = _guarded(cell, axis, partial(measure, cell))
        found.append(known[id(cell)])
        told(seed, axis)
    joined = xr.concat(found, dim="seed", combine_attrs="override", join="exact")
    return joined.assign_attrs(found[0].attrs)


def _guarded(cell: MaterialCell, part: str, run: Callable[[], Result]) -> Result:
    try:
        return run()
    except GranbenchError:
        raise
    except Exception as error:
        # The cell is a stranger's code: say where it fell, and keep the cause for a debugger.
        raise ModelError(
            f"cell {cell.name!r} failed in protocol {part} {where_it_fell(error)}; mend the cell"
        ) from error


def _check_order(cell: MaterialCell, dataset: xr.Dataset) -> None:
    labels = tuple(str(label) for label in dataset["component"].values)
    if COMPONENT_ORDERS[cell.order] != labels:
        raise ModelError(
            f"cell {cell.name!r} works in the component order {cell.order!r}, but the records "
            f"have components {', '.join(labels)}; wrap it so that the orders agree"
        )
