"""Every protocol of the chosen axes, for every seed of a model."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from typing import TypeVar

import numpy as np
import torch
import xarray as xr

from granbench.benchmark.axes.along_paths.free_run import noise, rollout, strain_of, window
from granbench.benchmark.axes.along_paths.single_step import single_step
from granbench.benchmark.axes.cost.predict import cost
from granbench.benchmark.axes.embedded.predict import (
    analysis_start,
    embedded,
    embedded_obstacle,
    embedded_truth,
)
from granbench.benchmark.axes.physics.checks import CHECKED_STRAIN
from granbench.benchmark.axes.physics.predict import physics
from granbench.benchmark.predictions import (
    CELL_NOTES,
    EMBEDDED_FAILURES,
    EMBEDDED_OBSTACLE,
    SCORED_INTERNALS,
    assemble,
)
from granbench.benchmark.protocols import (
    AXES,
    COST,
    EMBEDDED,
    PHYSICS,
    ProtocolSpec,
    chosen_axes,
    protocols_of,
)
from granbench.benchmark.task import Task, with_ground_truth
from granbench.cells.check import CellCheck, checked_cell, spread_rows
from granbench.cells.check.snapshot import changed, snapshot
from granbench.cells.contract import Conditions, MaterialCell
from granbench.cells.robust_runs import Series
from granbench.cells.user_code import user_code
from granbench.data.adapters import conditions_of
from granbench.errors import ConfigurationError, DatasetError, ModelError
from granbench.fem.statement import EmbeddedAnalysis
from granbench.models.ground_truth import ground_truth_cell
from granbench.tensors import COMPONENT_ORDERS, frobenius_norm

Result = TypeVar("Result")
Progress = Callable[[int, str], None]


def predict(
    cells: Mapping[int, MaterialCell],
    dataset: xr.Dataset,
    axes: Iterable[str] = AXES,
    *,
    task: Task | None = None,
    attrs: Mapping[str, str] | None = None,
    training_seconds: Mapping[int, float] | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Predictions of a model in their layout (see `granbench.benchmark.predictions`).

    Parameters
    ----------
    cells : the model's cell for each seed; the seed also drives the noise
    dataset : the records to predict, all of its paths
    axes : which of `granbench.benchmark.protocols.AXES`
    task : gives the embedded analyses and the ground truth; None for the records alone, which have
        no analyses
    attrs : further attributes of the result, such as `command`
    training_seconds : how long each seed was trained, where that is known
    progress : called after each part with the seed and what was done

    Raises
    ------
    ModelError
        If a cell has another component order than the records, does not pass its check, raises
        an error, or lacks what they give; or if some seeds, but not all, are the same model.
    ConfigurationError
        If an axis is unknown, or there is no cell or no axis.
    DatasetError
        If the dataset names a ground truth that cannot be rebuilt.
    """
    chosen = chosen_axes(axes)
    dataset = with_ground_truth(dataset, task)
    analyses = () if task is None else task.analyses
    if not cells:
        raise ConfigurationError("there is nothing to evaluate: give at least one seed")
    for cell in cells.values():
        _check_order(cell, dataset)
    report = progress or (lambda seed, done: None)
    reads = any(cell.reads_records for cell in cells.values())
    with torch.no_grad(), ExitStack() as checks:
        passed = _checked(cells, dataset, analyses, chosen, checks)
        notes = [note for check in passed.values() for note in check.notes]
        predicted = _predicted(cells, dataset, chosen, report)
        if _same_model(passed, predicted, chosen) and len(set(map(id, cells.values()))) > 1:
            notes.append(
                f"seeds {', '.join(map(str, cells))} are one and the same model: it is scored as "
                "one deterministic model, and its seeds only draw the noise"
            )
            cells = dict.fromkeys(cells, next(iter(cells.values())))
        others = []
        if "noise" in chosen and not reads:
            others += _noised_truth(cells, dataset)
        if EMBEDDED in chosen:
            others.append(_embedded(cells, dataset, analyses, report))
        if PHYSICS in chosen:
            others.append(_for_each(cells, PHYSICS, lambda cell: physics(cell, dataset), report))
        if COST in chosen:
            others.append(_costs(cells, dataset, report).assign(_training(cells, training_seconds)))
    return assemble(
        predicted,
        dataset=dataset,
        seeds=cells,
        protocols=[spec.name for spec in protocols_of(chosen)],
        attrs={
            "model": next(iter(cells.values())).name,
            "reads_records": int(reads),
            **({CELL_NOTES: json.dumps(list(dict.fromkeys(notes)))} if notes else {}),
            **(attrs or {}),
        },
        others=others,
    )


def _checked(
    cells: Mapping[int, MaterialCell],
    dataset: xr.Dataset,
    analyses: Sequence[EmbeddedAnalysis],
    axes: Iterable[str],
    checks: ExitStack,
) -> dict[int, CellCheck]:
    """The check of each seed's cell, which lasts as long as `checks`.

    Cells start as the records do or, where only analyses are made, as those do.
    """
    of_analyses = set(axes) == {EMBEDDED} and not embedded_obstacle(
        dataset, analyses, cells.values()
    )
    passed: dict[int, CellCheck] = {}
    for cell in cells.values():
        if id(cell) not in passed:
            starts = (analysis_start(cell, dataset, analyses),) if of_analyses else ()
            probe = starts or _probe(cell, dataset)
            passed[id(cell)] = checks.enter_context(checked_cell(cell, *probe))
    return {seed: passed[id(cell)] for seed, cell in cells.items()}


def _same_model(
    checks: Mapping[int, CellCheck], predicted: Mapping[str, np.ndarray], axes: Iterable[str]
) -> bool:
    """Whether all seeds are one and the same model: whatever no seed enters is the same.

    Raises
    ------
    ModelError
        If some are, but not all.
    """
    seeds = list(checks)
    drawn = np.array([spec.axis == "noise" for spec in protocols_of(axes)], dtype=bool)
    if predicted and not drawn.all():
        answers = [stress[~drawn] for stress in predicted["stress"]]
        kinds = [_place_of(answer, answers, _equal_arrays) for answer in answers]
    else:
        kinds = [_place_of(check, list(checks.values()), _equal_cells) for check in checks.values()]
    if len(set(kinds)) == 1:
        return True
    if len(set(kinds)) < len(kinds):
        twice = next(kind for kind in kinds if kinds.count(kind) > 1)
        same = [str(seed) for seed, kind in zip(seeds, kinds, strict=True) if kind == twice]
        raise ModelError(
            f"seeds {' and '.join(same)} are one and the same model, which would count "
            f"{len(same)} times in every mean; give each model once, or models of different "
            "trainings"
        )
    return False


def _place_of(item: Result, items: list[Result], equal: Callable[[Result, Result], bool]) -> int:
    return next(place for place, other in enumerate(items) if equal(item, other))


def _equal_arrays(one: np.ndarray, other: np.ndarray) -> bool:
    return np.array_equal(one, other, equal_nan=True)


def _equal_cells(one: CellCheck, other: CellCheck) -> bool:
    if one.cell is other.cell:
        return True
    answers = _equal_arrays(one.answers.numpy(), other.answers.numpy())
    kinds = type(one.cell) is type(other.cell)
    return kinds and answers and not changed(snapshot(one.cell), snapshot(other.cell))


def _probe(cell: MaterialCell, dataset: xr.Dataset) -> tuple[Conditions, torch.Tensor]:
    """A few paths of the records for the check of a cell: their starts, and small increments.

    The increments have the directions of the paths, but no more than the strain at which the
    physics axis looks, which every model should bear.
    """
    records = dataset.isel(path=spread_rows(dataset.sizes["path"]))
    strain = strain_of(records)
    rows = torch.tensor(spread_rows(strain.shape[1]))
    increments = strain[:, rows].diff(dim=1)
    size = frobenius_norm(increments, cell.order).clamp(min=CHECKED_STRAIN)
    increments = increments * (CHECKED_STRAIN / size)[..., None]
    return conditions_of(records, dtype=cell.dtype), increments


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
    cells: Mapping[int, MaterialCell], dataset: xr.Dataset, axes: Iterable[str], report: Progress
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
            report(seed, spec.title)
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


def _embedded(
    cells: Mapping[int, MaterialCell],
    dataset: xr.Dataset,
    analyses: Sequence[EmbeddedAnalysis],
    report: Progress,
) -> xr.Dataset:
    """The responses of boundary-value problems, or why there are none."""
    obstacle = embedded_obstacle(dataset, analyses, cells.values())
    if obstacle:
        return xr.Dataset(attrs={EMBEDDED_OBSTACLE: obstacle})
    found = _for_each(cells, EMBEDDED, lambda cell: embedded(cell, dataset, analyses), report)
    failures = found["failure"].assign_coords(seed=list(cells)).to_series()
    reasons = {"/".join(map(str, place)): text for place, text in failures.items() if text}
    truth = embedded_truth(dataset, analyses)
    return xr.merge([found.drop_vars("failure"), truth]).assign_attrs(
        {EMBEDDED_OBSTACLE: "", EMBEDDED_FAILURES: json.dumps(reasons, sort_keys=True)}
    )


def _costs(cells: Mapping[int, MaterialCell], dataset: xr.Dataset, report: Progress) -> xr.Dataset:
    truth = ground_truth_cell(dataset)
    return _for_each(cells, COST, lambda cell: cost(cell, dataset, truth), report)


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
    report: Progress,
) -> xr.Dataset:
    """A measurement that no seed of ours enters: once for each cell, over `seed`."""
    known: dict[int, xr.Dataset] = {}
    found = []
    for seed, cell in cells.items():
        if id(cell) not in known:
            known[id(cell)] = _guarded(cell, axis, partial(measure, cell))
        found.append(known[id(cell)])
        report(seed, axis)
    joined = xr.concat(found, dim="seed", combine_attrs="override", join="exact")
    return joined.assign_attrs(found[0].attrs)


def _guarded(cell: MaterialCell, part: str, run: Callable[[], Result]) -> Result:
    with user_code(f"cell {cell.name!r} failed in protocol {part}"):
        return run()


def _check_order(cell: MaterialCell, dataset: xr.Dataset) -> None:
    labels = tuple(str(label) for label in dataset["component"].values)
    if COMPONENT_ORDERS[cell.order] != labels:
        raise ModelError(
            f"cell {cell.name!r} works in the component order {cell.order!r}, but the records "
            f"have components {', '.join(labels)}; wrap it so that the orders agree"
        )
