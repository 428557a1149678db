"""Responses of a cell to the checks of the physics axis.

`granbench.benchmark.axes.physics.checks` says what each check measures; here its raw responses are
made, which `axis` (beside this module) turns into violations.
"""

import json

import numpy as np
import torch
import xarray as xr
from torch import Tensor

from granbench.benchmark.axes.along_paths.free_run import strain_of
from granbench.benchmark.axes.physics.checks import (
    CARRIES_TENSION,
    CHECKED_STRAIN,
    CHECKS,
    NO_STRESS_OUT_OF_PLANE,
    PHYSICS_OBSTACLES,
    PRINCIPAL,
    READS_RECORDS,
    STRESS_CHECKS,
    checked_paths,
    checked_steps,
)
from granbench.benchmark.axes.physics.energy import cycle_work
from granbench.benchmark.axes.physics.symmetry import asymmetry, exchanges, turn
from granbench.benchmark.axes.physics.tangent import tangent_errors, tangent_obstacle
from granbench.cells.contract import Conditions, MaterialCell
from granbench.cells.robust_runs import (
    Series,
    robust_series,
    robust_states,
    robust_step,
)
from granbench.data.adapters import conditions_of
from granbench.models.classical import OUT_OF_PLANE
from granbench.models.ground_truth import holds_no_tension
from granbench.tensors import frobenius_norm, mean_stress

ROUNDING = 1e-6
"""Tension below this share of a path's largest mean stress is rounding and not counted."""


def physics(cell: MaterialCell, dataset: xr.Dataset) -> xr.Dataset:
    """Responses of a cell to every check that applies to it and to the dataset.

    Parameters
    ----------
    cell : the model
    dataset : the scored records

    Returns
    -------
    Dataset over `checked_path` (names of the paths): `stress_change` (check, checked_path,
    component), `tangent_error`, `kink_share`, `cycle_work` and `tension_share`, see
    `granbench.benchmark.predictions.LAYOUT`; NaN where the cell broke down. Responses of checks
    that do not apply are left out, with the reasons in the attribute `PHYSICS_OBSTACLES`.
    """
    rows = checked_paths(dataset)
    names = dataset["path_id"].values[rows].astype(str)
    if cell.reads_records:
        return _assembled({}, dataset, names, dict.fromkeys(CHECKS, READS_RECORDS))
    records = dataset.isel(path=rows)
    strain = strain_of(records)
    conditions = conditions_of(records, dtype=cell.dtype)
    course = robust_states(cell, strain, conditions)
    obstacles: dict[str, str] = {}
    responses = _of_single_increments(cell, records, strain, course["state"], obstacles)
    responses |= _of_whole_paths(cell, strain, conditions, course["stress"], obstacles)
    if not holds_no_tension(dataset):
        obstacles["compression"] = CARRIES_TENSION
    elif OUT_OF_PLANE in dataset and OUT_OF_PLANE not in cell.layout:
        obstacles["compression"] = NO_STRESS_OUT_OF_PLANE
    else:
        responses["tension_share"] = _tension_share(_mean_stress(cell, course, dataset))
    return _assembled(responses, dataset, names, obstacles)


def _of_single_increments(
    cell: MaterialCell,
    records: xr.Dataset,
    strain: Tensor,
    states: Tensor,
    obstacles: dict[str, str],
) -> dict[str, Tensor]:
    """Responses from states along the cell's own course, each (path, component) or (path,)."""
    steps = np.stack(
        [checked_steps(name, strain.shape[1]) for name in records["path_id"].values.astype(str)]
    )
    count = steps.shape[1]
    step = torch.from_numpy(steps)
    path = torch.arange(len(step))[:, None]
    increment = (strain[path, step] - strain[path, step - 1]).flatten(0, 1)
    norm = frobenius_norm(increment, cell.order).unsqueeze(-1)
    # A path that stands still has no direction: its increment stays zero.
    increment = increment * (CHECKED_STRAIN / torch.where(norm > 0.0, norm, 1.0))
    state = states[path, step - 1].flatten(0, 1)

    def worst(values: Tensor) -> Tensor:
        return values.unflatten(0, (-1, count)).amax(dim=1)

    before = state[:, cell.layout["stress"]]
    still = robust_step(
        cell, torch.zeros_like(increment).to(cell.dtype), state.to(cell.dtype)
    )["stress"]  # fmt: skip
    whole = _after(cell, increment, state, 1)
    responses = {"zero-increment": worst((still - before).abs())}
    for parts in (10, 100):
        change = _after(cell, increment, state, parts) - whole
        responses[f"substeps-{parts}"] = worst(change.abs())

    if obstacle := tangent_obstacle(cell, increment, state):
        obstacles["tangent"] = obstacle
        return responses
    stiffness = float(records["stress"].std() / records["strain"].std())
    found = tangent_errors(cell, increment, state, stiffness)
    error = worst(torch.where(found.kink, -torch.inf, found.error))
    # A path without a single derivative does not pass for want of one.
    responses["tangent_error"] = torch.where(torch.isneginf(error), torch.nan, error)
    responses["kink_share"] = found.kink.double().unflatten(0, (-1, count)).mean(dim=1)
    return responses


def _after(cell: MaterialCell, dstrain: Tensor, state: Tensor, parts: int) -> Tensor:
    """Stress after an increment in equal parts, (point, component)."""

    def run(points: slice, _: int) -> Series:
        part = (dstrain[points] / parts).to(cell.dtype)
        now = state[points].to(cell.dtype)
        for _ in range(parts):
            stress, now = cell.step(part, now)
        return {"stress": stress}

    widths = {"stress": (dstrain.shape[1],)}
    return robust_series(run, len(dstrain), None, widths)["stress"]


def _of_whole_paths(
    cell: MaterialCell,
    strain: Tensor,
    conditions: Conditions,
    stress: Tensor,
    obstacles: dict[str, str],
) -> dict[str, Tensor]:
    """Responses along paths from their start, each (path, component) or (path,)."""
    swaps = exchanges(cell.order)
    responses = {"swap": asymmetry(cell, strain, conditions, stress, swaps)}
    rotation = turn(cell.order)
    if rotation is None:
        obstacles["rotation"] = PRINCIPAL
    else:
        responses["rotation"] = asymmetry(cell, strain, conditions, stress, [rotation])
    responses["cycle_work"] = cycle_work(cell, strain, conditions)
    return responses


def _mean_stress(cell: MaterialCell, course: Series, dataset: xr.Dataset) -> Tensor:
    """Mean stress (path, step), Pa; with the stress out of the plane where the records have it."""
    if OUT_OF_PLANE not in dataset:
        return mean_stress(course["stress"], cell.order)
    out_of_plane = course["state"][..., cell.layout[OUT_OF_PLANE]]
    return mean_stress(torch.cat([course["stress"][..., :2], out_of_plane], dim=-1))


def _tension_share(pressure: Tensor) -> Tensor:
    """Share of steps at which the mean stress (path, step) is tensile; NaN after a breakdown."""
    tensile = pressure < -ROUNDING * pressure.abs().amax(dim=1, keepdim=True)
    share = tensile.double().mean(dim=1)
    return torch.where(torch.isfinite(pressure).all(dim=1), share, torch.nan)


def _assembled(
    responses: dict[str, Tensor], dataset: xr.Dataset, names: np.ndarray, obstacles: dict[str, str]
) -> xr.Dataset:
    parts = {name: values.cpu().numpy() for name, values in responses.items()}
    variables: dict[str, tuple[tuple[str, ...], np.ndarray]] = {}
    changes = [name for name in STRESS_CHECKS if name in parts]
    if changes:
        dims = ("check", "checked_path", "component")
        variables["stress_change"] = (dims, np.stack([parts.pop(name) for name in changes]))
    variables |= {name: (("checked_path",), values) for name, values in parts.items()}
    coordinates = {"checked_path": names.astype(object)}
    if changes:
        coordinates["check"] = np.asarray(changes, dtype=object)
        coordinates["component"] = dataset["component"].values.astype(object)
    return xr.Dataset(
        variables, coordinates, {PHYSICS_OBSTACLES: json.dumps(obstacles, sort_keys=True)}
    )
