"""`predict`: every seed of a model on the chosen axes."""

import json
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
import torch
import xarray as xr

from granbench.benchmark.axis import Axis
from granbench.benchmark.evaluation_run import EvaluationRun, SeedProgress
from granbench.benchmark.predictions import CELL_NOTES, assembled_predictions, known_answers
from granbench.benchmark.registry import axes as registered_axes
from granbench.benchmark.registry import axis_code, chosen_axes, of_every_axis
from granbench.benchmark.scored_task import ScoredTask
from granbench.benchmark.task import Task
from granbench.cells.check import CellCheck, checked_cell, spread_rows
from granbench.cells.check.snapshot import changed, snapshot
from granbench.cells.contract import Conditions, MaterialCell
from granbench.data.adapters import conditions_of
from granbench.errors import ConfigurationError, ModelError
from granbench.tensors import COMPONENT_ORDERS, component_order, frobenius_norm

Result = TypeVar("Result")

PROBE_STRAIN = 1e-3
"""Frobenius norm of the strain increments with which a cell is checked: about a step of the
datasets and of a finite-element analysis, which every model should bear."""


def predict(
    cells: Mapping[int, MaterialCell],
    dataset: xr.Dataset,
    axes: Iterable[str] | None = None,
    *,
    task: Task | None = None,
    attrs: Mapping[str, str] | None = None,
    training_seconds: Mapping[int, float] | None = None,
    progress: SeedProgress | None = None,
) -> xr.Dataset:
    """Predictions of a model in their layout (see `granbench.benchmark.predictions`).

    Parameters
    ----------
    cells : the model's cell for each seed; the seed also draws the noise
    dataset : the records to predict, all of its paths
    axes : names of registered axes; all of them by default
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
    if not cells:
        raise ConfigurationError("there is nothing to evaluate: give at least one seed")
    for cell in cells.values():
        _check_order(cell, dataset)
    scored = ScoredTask.of(dataset, task)
    run = EvaluationRun(cells, scored, chosen, training_seconds or {})
    if progress is not None:
        run = replace(run, report=progress)
    with torch.no_grad(), ExitStack() as checks:
        passed = _checked(run, checks)
        notes = [note for check in passed.values() for note in check.notes]
        used = [axis for axis in registered_axes() if set(axis.names) & set(chosen)]
        # Axes that are compared with the records show first whether the seeds are one model.
        parts = [_predicted(axis, run) for axis in used if axis.against_records]
        if _same_model(passed, parts) and len(set(map(id, cells.values()))) > 1:
            notes.append(
                f"seeds {', '.join(map(str, cells))} are one and the same model: it is scored as "
                "one deterministic model, and its seeds only draw the noise"
            )
            run = replace(run, cells=dict.fromkeys(cells, next(iter(cells.values()))))
        parts += [_predicted(axis, run) for axis in used if not axis.against_records]
    return assembled_predictions(
        parts,
        dataset=dataset,
        seeds=cells,
        attrs={
            "model": next(iter(cells.values())).name,
            "reads_records": int(run.reads_records),
            **({CELL_NOTES: json.dumps(list(dict.fromkeys(notes)))} if notes else {}),
            **(attrs or {}),
        },
    )


def _predicted(axis: Axis, run: EvaluationRun) -> xr.Dataset:
    with axis_code(axis):
        return axis.predict(run)


def _checked(run: EvaluationRun, checks: ExitStack) -> dict[int, CellCheck]:
    """The check of each seed's cell, which lasts as long as `checks`."""
    passed: dict[int, CellCheck] = {}
    for cell in run.cells.values():
        if id(cell) not in passed:
            passed[id(cell)] = checks.enter_context(checked_cell(cell, *_start(cell, run)))
    return {seed: passed[id(cell)] for seed, cell in run.cells.items()}


def _start(cell: MaterialCell, run: EvaluationRun) -> tuple[Any, ...]:
    """Where a cell is checked: as the records start, unless every axis starts elsewhere."""
    starts = []
    for axis in registered_axes():
        if set(axis.names) & set(run.axes):
            with axis_code(axis):
                starts.append(axis.start(cell, run.task))
    if starts[0] is not None and all(start is not None for start in starts):
        return starts[0]
    return _probe(cell, run.records)


def _same_model(checks: Mapping[int, CellCheck], parts: Iterable[xr.Dataset]) -> bool:
    """Whether all seeds are one and the same model: what no seed draws is the same.

    Parameters
    ----------
    checks : of the cells, which are compared where no answers are known
    parts : what was predicted so far

    Raises
    ------
    ModelError
        If some are, but not all.
    """
    seeds = list(checks)
    known = [answers for part in parts for answers in known_answers(part)]
    if known:
        answers = known[0]
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
    answers = _equal_arrays(one.stress.numpy(), other.stress.numpy())
    kinds = type(one.cell) is type(other.cell)
    return kinds and answers and not changed(snapshot(one.cell), snapshot(other.cell))


def _probe(cell: MaterialCell, dataset: xr.Dataset) -> tuple[Conditions, torch.Tensor]:
    """A few paths of the records for the check of a cell: their starts, and small increments.

    The increments have the directions of the paths and the norm `PROBE_STRAIN`.
    """
    records = dataset.isel(path=spread_rows(dataset.sizes["path"]))
    strain = torch.from_numpy(records["strain"].values.astype(np.float64))
    rows = torch.tensor(spread_rows(strain.shape[1]))
    increments = strain[:, rows].diff(dim=1)
    size = frobenius_norm(increments, cell.order).clamp(min=PROBE_STRAIN)
    increments = increments * (PROBE_STRAIN / size)[..., None]
    return conditions_of(records, dtype=cell.dtype), increments


def progress_parts(axes: Iterable[str]) -> int:
    """How many times `predict` reports progress for one seed."""
    chosen = chosen_axes(axes)
    return sum(
        of_every_axis(lambda axis: [axis.rounds(chosen)] if set(axis.names) & set(chosen) else [])
    )


def _check_order(cell: MaterialCell, dataset: xr.Dataset) -> None:
    labels = tuple(str(label) for label in dataset["component"].values)
    if COMPONENT_ORDERS[cell.order] != labels:
        raise ModelError(
            f"cell {cell.name!r} has the component order {cell.order!r}, but the records have "
            f"components {', '.join(labels)}; make it with order={component_order(labels)!r}"
        )
